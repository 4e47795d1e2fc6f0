"""Settings of an identification: its search by name, what is fitted and how tests weigh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from functools import cache
from typing import Annotated, Any, Literal, TypeAlias, get_type_hints

from mrwork.base.arguments import Count, Level, Seed, checked
from mrwork.base.hints import May, Record, Within, fields_of
from mrwork.base.keys import check_known
from mrwork.errors import RecordError, SettingError
from mrwork.identification.residual import NuisanceName
from mrwork.records.repairs import DETECT, as_words
from mrwork.search.loop import Optimiser
from mrwork.store.codec import built

_MULTISTART = "multistart"


@checked
class Multistart:
    """Settings of the multistart search: local minimisations from the best of many samples, in rounds.

    Parameters
    ----------
    samples
        Points of the Latin hypercube per free parameter; local minimisations start from the best of them.
    starts
        Local minimisations of a round, which run in one batch.
    least_rounds, most_rounds
        Least and largest number of rounds. The least ones run together.
    found
        Number of minimisations that must have reached the least misfit before the search may end early.
    closeness
        Misfits that differ by less than this share belong to the same minimum.
    most_iterations
        Largest number of iterations of a local minimisation.
    """

    samples: Count = 20
    starts: Count = 8
    least_rounds: Count = 2
    most_rounds: Count = 6
    found: Count = 3
    closeness: Level = 0.02
    most_iterations: Count = 60

    def __post_init__(self) -> None:
        if self.most_rounds < self.least_rounds:
            raise SettingError(
                f"`most_rounds` is {self.most_rounds}, below `least_rounds`, {self.least_rounds}; give as many or more"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class UnregisteredSearch:
    """Record of a search that is not registered, read from a file without its code: its class name and settings."""

    kind: str
    settings: Mapping[str, Any]


_Bound: TypeAlias = Annotated[float, May.BE_INFINITE]
# Any: each optimiser has its own type of state.
Search: TypeAlias = Multistart | UnregisteredSearch | Optimiser[Any]


def has_generations(search: Search) -> bool:
    """Whether the settings of a search have the size of a population and a largest number of generations."""
    return not isinstance(search, Multistart | UnregisteredSearch)


def resize_search(search: Search, *, population: int | None = None, generations: int | None = None) -> Search:
    """The search with another population or largest number of generations; `None` keeps the present one."""
    # Any, because the protocol of optimisers does not declare that the settings are a dataclass.
    settings: Any = search
    if population is not None:
        settings = replace(settings, population=population)
    if generations is not None:
        settings = replace(settings, stop=replace(settings.stop, max_generations=generations))
    return settings  # type: ignore[no-any-return] # of the same class


def refuse_unregistered(search: Search | str | None) -> None:
    """Refuse a search whose code is not known."""
    if isinstance(search, UnregisteredSearch):
        raise SettingError(
            f"the search {search.kind} of this fit is not registered, so it cannot run again from a file; "
            f"identify again with an instance of {search.kind} or the name of a registered search as `search`"
        )


@cache
def searches() -> Mapping[str, Search]:
    """Every search with its default settings, by the name that users and records use.

    The first call imports the optimisers, a tenth of the time of a small fit.
    """
    from mrwork.search.registry import ALL_OPTIMISERS

    return {_MULTISTART: Multistart(), **ALL_OPTIMISERS}


def search_named(name: str) -> Search:
    """The search called `name`, with its default settings."""
    check_known(name, searches(), f"there is no search called {name!r}")
    return searches()[name]


def _record_of_search(search: Search) -> dict[str, Any]:
    """Plain values of the settings of a search; `kind` is its registered name, otherwise its class name."""
    if isinstance(search, UnregisteredSearch):
        return {"kind": search.kind} | dict(search.settings)
    return {"kind": _kind_of(search)} | _settings_of(search)


def _settings_of(search: Any) -> dict[str, Any]:
    """The fields of a dataclass; of another class, the settings that every optimiser has."""
    if is_dataclass(search) and not isinstance(search, type):
        return asdict(search)
    return {"population": search.population, "stop": asdict(search.stop), "elite": asdict(search.elite)}


def _kind_of(search: Any) -> str:
    """The registered name of a search: of those of its class, the one with the most equal settings."""
    # The default search is not looked up, because that would import all optimisers.
    if type(search) is Multistart:
        return _MULTISTART
    own = _settings_of(search)

    equal = {
        name: sum(own[setting] == value for setting, value in _settings_of(each).items())
        for name, each in searches().items()
        if type(search) is type(each)
    }
    return max(equal, key=equal.__getitem__, default=type(search).__name__)


def _search_of_record(record: Mapping[str, Any]) -> Search:
    """Undo `_record_of_search`; a search that is not registered becomes an `UnregisteredSearch`."""
    kind = record.get("kind")
    if not isinstance(kind, str):
        raise ValueError(f"the kind of search {kind!r} is no name")
    settings = {name: value for name, value in record.items() if name != "kind"}
    # The default search is not looked up, because that would import all optimisers.
    if kind != _MULTISTART and kind not in searches():
        return UnregisteredSearch(kind=kind, settings=settings)
    own = Multistart if kind == _MULTISTART else type(searches()[kind])
    _refuse_unknown(own, settings)
    return built(own, settings)  # type: ignore[no-any-return] # the type is the one given


def _refuse_unknown(kind: type, settings: Mapping[str, Any]) -> None:
    known = fields_of(kind)
    for name, value in settings.items():
        if name not in known:
            raise ValueError(f"{kind.__name__} has no setting {name!r}")
        if isinstance(inner := known[name], Record) and isinstance(value, Mapping):
            _refuse_unknown(inner.kind, value)


# What makes the final fit: our minimisation, all starts in lanes, or that of optimistix through JAX.
Engine = Literal["lanes", "optimistix"]

# Values of parameters by name.
Start = Mapping[str, float]

# Power of the root mean square, that of least squares.
ROOT_MEAN_SQUARE = 2.0
# Exponent with which every test has the same weight: errors that grow in proportion to the force.
EQUAL_SHARES = 1.0

# With a higher power the better tests are lost in rounding errors, and local minimisations no longer converge.
LARGEST_POWER = 16.0


@dataclass(frozen=True, slots=True, kw_only=True)
class NumberOption:
    """Option of the command line for a numeric setting: help, placeholder, default, range, and words of its refusal."""

    says: str
    metavar: str
    default: float
    within: Within
    noun: str
    remedy: str

    @property
    def setting(self) -> Any:
        """The field of a dataclass that is an option of `mrwork identify` of its name."""
        return field(default=self.default, metadata={"option": self})


@checked
class FitSettings:
    """Settings of `identify`, where each is described. The fields are recorded with a fit and in its journal.

    A number whose field is that of a `NumberOption` is also an option of `mrwork identify`. `search` is `None` for the
    default search of the model; a name is replaced by the registered search of that name.

    Raises
    ------
    SettingError
        Where the power, the exponent of the force, the engine, a nuisance parameter or an observation is impossible.
    UnknownNameError
        Where no search has the name.
    """

    search: Search | str | None = None
    bounds: Mapping[str, tuple[_Bound, _Bound]] = field(default_factory=dict)
    starts: tuple[Start, ...] = ()
    ties: Mapping[str, str] = field(default_factory=dict)
    power: float = NumberOption(
        says="minimise (mean NRMSE^P)^(1/P) over the files: 2, the default, is the root mean square; a higher power "
        "gives more weight to the worst file",
        metavar="P",
        default=ROOT_MEAN_SQUARE,
        within=Within(least=ROOT_MEAN_SQUARE, most=LARGEST_POWER),
        noun="the power of the mean over tests",
        remedy=f"give 2, where all weigh the same, up to {LARGEST_POWER:g}, where hardly any but the worst counts",
    ).setting
    force_exponent: float = NumberOption(
        says="assume that errors grow between files with their force to this power: 1, the default, gives all files "
        "the same weight, 0 compares errors in newtons",
        metavar="E",
        default=EQUAL_SHARES,
        within=Within(least=0.0, most=EQUAL_SHARES),
        noun="the exponent of the force",
        remedy="give 1, where all tests weigh the same, down to 0, where errors in newtons do",
    ).setting
    engine: Engine = "lanes"
    nuisances: tuple[NuisanceName, ...] = ()
    observe: tuple[str, ...] = (DETECT,)
    rng: Seed = 0

    def __post_init__(self) -> None:
        if isinstance(self.search, str):
            object.__setattr__(self, "search", search_named(self.search))
        object.__setattr__(self, "observe", as_words(self.observe))
        for name, option in self.number_options().items():
            if option.within.excludes(value := getattr(self, name)):
                raise SettingError(f"{option.noun} is {value:g}; {option.remedy}")

    @property
    def again(self) -> FitSettings:
        """Those for a fit to other tests that does not know of this one: without starts, in lanes."""
        return replace(self, starts=(), engine="lanes")

    def as_record(self) -> dict[str, Any]:
        """Plain values of all fields, for JSON; a search is a record with its name as `kind`."""
        search = self.search
        assert not isinstance(search, str)
        record = {
            each.name: _plain(getattr(self, each.name)) for each in fields(self) if each.name != "search"
        }
        # Records and journals of fits without ties are as they were before there were any.
        if not self.ties:
            del record["ties"]
        return {"search": None if search is None else _plain(_record_of_search(search))} | record

    @classmethod
    def number_options(cls) -> dict[str, NumberOption]:
        """The numbers that are options of the command line, by name."""
        return {each.name: each.metadata["option"] for each in fields(cls) if "option" in each.metadata}

    @classmethod
    @checked
    def of_record(cls, record: Mapping[str, Any]) -> FitSettings:
        """Undo `as_record`. Missing fields have their defaults, unknown keys are ignored."""
        try:
            search = record.get("search")
            known = {
                name: built(kind, record[name])
                for name, kind in get_type_hints(cls, include_extras=True).items()
                if name in record and name != "search"
            }
            return cls(search=None if search is None else _search_of_record(search), **known)
        except (TypeError, ValueError, KeyError, AttributeError) as reason:
            raise RecordError(
                f"the settings of this fit cannot be read ({reason}); run `mrwork identify` again"
            ) from None


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return value
