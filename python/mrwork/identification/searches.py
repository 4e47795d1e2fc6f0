"""Searches of an identification: their registry by name, their records, and how each kind is used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, is_dataclass, replace
from functools import cache
from typing import Any, Protocol, TypeAlias, get_type_hints

from mrwork.arguments import Count, Level, checked
from mrwork.errors import SettingError, UnknownNameError
from mrwork.search.loop import Optimiser
from mrwork.store.record import built

_MULTISTART = "multistart"


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
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
    """Record of a search that is not registered, read from a file: its class name and its settings.

    It cannot run, because a file does not contain the code of the search.
    """

    kind: str
    settings: Mapping[str, Any]


# Any: each optimiser has its own type of state.
Search: TypeAlias = Multistart | UnregisteredSearch | Optimiser[Any]


class SearchMethod(Protocol):
    """How an identification uses one kind of search."""

    @property
    def has_generations(self) -> bool:
        """Whether the settings include the size of a population and a largest number of generations."""

    def resized(self, *, population: int | None = None, generations: int | None = None) -> Search:
        """The search with another population or largest number of generations; `None` keeps the present one."""

    def check_runs(self) -> None:
        """Refuse a search that cannot run.

        Raises
        ------
        SettingError
            Where that is so; the message says what to do.
        """


@dataclass(frozen=True, slots=True)
class _MultistartMethod:
    search: Multistart
    has_generations: bool = False

    def resized(self, *, population: int | None = None, generations: int | None = None) -> Search:
        if population is not None or generations is not None:
            raise SettingError("Multistart has no population and no generations; leave them out")
        return self.search

    def check_runs(self) -> None:
        pass


@dataclass(frozen=True, slots=True)
class _OptimiserMethod:
    # Any, because the protocol does not declare that the settings are a dataclass.
    search: Any
    has_generations: bool = True

    def resized(self, *, population: int | None = None, generations: int | None = None) -> Search:
        settings = self.search
        if population is not None:
            settings = replace(settings, population=population)
        if generations is not None:
            settings = replace(settings, stop=replace(settings.stop, max_generations=generations))
        found: Search = settings
        return found

    def check_runs(self) -> None:
        pass


@dataclass(frozen=True, slots=True)
class _UnregisteredMethod:
    search: UnregisteredSearch
    has_generations: bool = False

    def resized(self, *, population: int | None = None, generations: int | None = None) -> Search:
        raise self._refusal()

    def check_runs(self) -> None:
        raise self._refusal()

    def _refusal(self) -> SettingError:
        return SettingError(
            f"the search {self.search.kind} of this fit is not registered, so it cannot run again from a file; "
            f"identify again with an instance of {self.search.kind} or the name of a registered search as `search`"
        )


def method_of(search: Search) -> SearchMethod:
    """How an identification uses this search."""
    if isinstance(search, Multistart):
        return _MultistartMethod(search)
    if isinstance(search, UnregisteredSearch):
        return _UnregisteredMethod(search)
    return _OptimiserMethod(search)


@cache
def searches() -> Mapping[str, Search]:
    """Every search with its default settings, by the name that users and records use.

    The first call imports the optimisers, which takes a tenth of the time of a small fit; the default search of a plain
    model does not need them.
    """
    from mrwork.search.registry import OPTIMISERS, PEERS

    return {_MULTISTART: Multistart(), **OPTIMISERS, **PEERS}


def search_named(name: str) -> Search:
    """The search called `name`, with its default settings.

    Raises
    ------
    UnknownNameError
        Where there is none; the message lists the names.
    """
    if name not in searches():
        raise UnknownNameError(f"there is no search called {name!r}; choose one of {', '.join(searches())}")
    return searches()[name]


def record_of_search(search: Search) -> dict[str, Any]:
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

    def equal_settings(name: str) -> int:
        registered = _settings_of(searches()[name])
        return sum(own[setting] == value for setting, value in registered.items())

    names = [name for name, each in searches().items() if type(search) is type(each)]
    return max(names, key=equal_settings, default=type(search).__name__)


def search_of_record(record: Mapping[str, Any]) -> Search:
    """Undo `record_of_search`; a search that is not registered becomes an `UnregisteredSearch`.

    Raises
    ------
    TypeError, ValueError, AttributeError
        Where the record is damaged.
    """
    kind = record.get("kind")
    if not isinstance(kind, str):
        raise ValueError(f"the kind of search {kind!r} is no name")
    if kind == _MULTISTART:
        return _built(Multistart, record)  # type: ignore[no-any-return] # the type is the one given
    if kind not in searches():
        settings = {name: value for name, value in record.items() if name != "kind"}
        return UnregisteredSearch(kind=kind, settings=settings)
    return _built(type(searches()[kind]), record)  # type: ignore[no-any-return] # as above


def _built(kind: type, record: Mapping[str, Any]) -> Any:
    """The settings of a search of this class, checked as those of a caller; those that are missing have defaults."""
    settings = {name: value for name, value in record.items() if name != "kind"}
    _refuse_unknown(kind, settings)
    return built(kind, settings, "search")


def _refuse_unknown(kind: type, settings: Mapping[str, Any]) -> None:
    hints = get_type_hints(kind)
    for name, value in settings.items():
        if name not in hints:
            raise ValueError(f"{kind.__name__} has no setting {name!r}")
        if is_dataclass(hints[name]) and isinstance(value, Mapping):
            _refuse_unknown(hints[name], value)
