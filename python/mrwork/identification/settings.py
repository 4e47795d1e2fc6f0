"""Settings of an identification, and settings with which its tests were read from files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, get_args, get_type_hints

from mrwork.errors import RecordError, SettingError, UnknownNameError
from mrwork.identification.multistart import Multistart
from mrwork.identification.nuisance import NuisanceName
from mrwork.identification.objective import ROOT_MEAN_SQUARE
from mrwork.records import DamperTest, read_damper_test, repair
from mrwork.records.repairs import RepairKind
from mrwork.records.window import counted_from, cut
from mrwork.synthetic import synthetic_test

if TYPE_CHECKING:
    from mrwork.search.loop import Optimiser

# Any: each optimiser has its own type of state.
Search: TypeAlias = "Multistart | Optimiser[Any]"

# Where the final fit runs: in lanes, with derivatives by dual numbers, or on the JAX twin.
Engine = Literal["lanes", "twin"]

# Values of parameters by name.
Start = Mapping[str, float]

_SYNTHETIC = "synthetic:"
_MULTISTART = "multistart"

# With a higher power the better tests are lost in rounding errors, and local minimisations no longer converge.
_LARGEST_POWER = 16.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Files of one run and how each was processed: window, repairs, start of the samples that count.

    `columns` and `repairs` are as in `read_damper_test` and `repair`, with `None` for a repair that takes no amount;
    `start`, `end` and `settle` in seconds. Relative `files` are relative to `folder`, or to the current folder.
    """

    files: tuple[str, ...]
    folder: str = ""
    columns: Mapping[str, str] = field(default_factory=dict)
    start: float | None = None
    end: float | None = None
    every: int = 1
    repairs: Mapping[RepairKind, float | None] = field(default_factory=dict)
    settle: float | None = None

    def as_record(self) -> dict[str, Any]:
        """Plain values, for `fit.json`."""
        return asdict(self)

    @classmethod
    def of_record(cls, record: object, *, origin: str) -> Reading:
        """Undo `as_record`; `origin` names the record in messages.

        Raises
        ------
        RecordError
            Where the record cannot be read as a `Reading`.
        """
        try:
            fields = dict(record)  # type: ignore[call-overload] # any value; one that is no mapping is refused below
            return cls(**(fields | {"files": tuple(fields["files"])}))
        except (TypeError, ValueError, KeyError):
            raise RecordError(
                f"{origin} does not say how its tests were read; run `mrwork identify` again"
            ) from None

    def tests(self) -> tuple[DamperTest, ...]:
        """Read the files as tests.

        Raises
        ------
        RecordError
            Where a file cannot be read as a test.
        SettingError
            Where a window or a repair leaves too little of it.
        """
        return tuple(self._read(file) for file in self.files)

    def _read(self, file: str) -> DamperTest:
        if file.startswith(_SYNTHETIC):
            test = synthetic_test(file.removeprefix(_SYNTHETIC))
        else:
            test = read_damper_test(self._path(file), columns=self.columns or None)
        if (self.start, self.end, self.every) != (None, None, 1):
            test = cut(test, start=self.start, end=self.end, every=self.every)
        amounts = {kind: amount for kind, amount in self.repairs.items() if amount is not None}
        test, _ = repair(test, self.repairs, amounts=amounts)
        return test if self.settle is None else counted_from(test, self.settle)

    def _path(self, file: str) -> str:
        """Path of a file from the current folder, or else from the folder where it was read."""
        return file if Path(file).exists() or not self.folder else str(Path(self.folder) / file)


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """Settings of `identify`, where each is described. The fields are recorded with a fit and in its journal.

    `search` is `None` for the default search of the model.

    Raises
    ------
    SettingError
        Where the power, the engine or a nuisance parameter is impossible.
    """

    search: Search | None = None
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    starts: tuple[Start, ...] = ()
    power: float = ROOT_MEAN_SQUARE
    engine: Engine = "lanes"
    nuisances: tuple[NuisanceName, ...] = ()
    rng: int = 0

    def __post_init__(self) -> None:
        if self.engine not in get_args(Engine):
            raise SettingError(f"`engine` is {self.engine!r}; choose one of {', '.join(get_args(Engine))}")
        if not ROOT_MEAN_SQUARE <= self.power <= _LARGEST_POWER:
            raise SettingError(
                f"the power of the mean over tests is {self.power:g}; give 2, where all weigh the same, "
                f"up to {_LARGEST_POWER:g}, where hardly any but the worst counts"
            )
        unknown = [name for name in self.nuisances if name not in get_args(NuisanceName)]
        if unknown:
            raise SettingError(
                f"`nuisances` names {unknown[0]!r}; choose from {', '.join(get_args(NuisanceName))}"
            )

    def as_record(self) -> dict[str, Any]:
        """Plain values of all fields, for JSON; a search is a record with its name as `kind`."""
        return {each.name: _plain(getattr(self, each.name)) for each in fields(self)}

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> FitSettings:
        """Undo `as_record`. Missing fields have their defaults; unknown keys are ignored.

        Raises
        ------
        RecordError
            Where the record cannot be read as settings.
        """
        try:
            known = {each.name: record[each.name] for each in fields(cls) if each.name in record}
            search = known.pop("search", None)
            return cls(
                search=None if search is None else _search_of(search),
                **{name: _restored(value) for name, value in known.items()},
            )
        except (TypeError, ValueError, KeyError, AttributeError) as reason:
            raise RecordError(
                f"the settings of this fit cannot be read ({reason}); run `mrwork identify` again"
            ) from None


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if is_dataclass(value):
        return {"kind": _kind_of(value)} | asdict(value)  # type: ignore[arg-type] # an instance, no class
    return value


def _restored(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _restored(entry) for name, entry in value.items()}
    return tuple(_restored(entry) for entry in value) if isinstance(value, list | tuple) else value


def _search_of(record: Mapping[str, Any]) -> Search:
    kind = record.get("kind")
    if kind is None:
        # Records of version 0.1 have no kind; there were two searches then, without a common field.
        kind = "genetic" if "population" in record else "multistart"
    search: Search = _built(Multistart if kind == _MULTISTART else type(searches()[kind]), record)
    return search


def _built(kind: type, record: Mapping[str, Any]) -> Any:
    hints = get_type_hints(kind)
    values = {each.name: record[each.name] for each in fields(kind) if each.name in record}
    return kind(
        **{
            name: _built(hints[name], value) if isinstance(value, Mapping) else _restored(value)
            for name, value in values.items()
        }
    )


def _kind_of(search: Any) -> str:
    if isinstance(search, Multistart):
        return _MULTISTART
    names = (name for name, each in searches().items() if type(search) is type(each))
    return next(names, type(search).__name__)


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
