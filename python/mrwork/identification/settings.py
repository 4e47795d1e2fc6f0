"""Settings of an identification, and settings with which its tests were read from files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal, get_args, get_type_hints

from mrwork.arguments import Count, Seed, checked
from mrwork.errors import RecordError, SettingError
from mrwork.identification.nuisance import NuisanceName
from mrwork.identification.searches import Search, record_of_search, search_named, search_of_record
from mrwork.records import DamperTest, read_damper_test, repair
from mrwork.records.observing import DETECT, NONE, as_words
from mrwork.records.repairs import RepairKind
from mrwork.records.window import counted_from, cut
from mrwork.store.input_file import exists
from mrwork.store.record import LowerBound, UpperBound, built, record_of
from mrwork.synthetic import synthetic_test

# Where the final fit runs: in lanes, with derivatives by dual numbers, or on the JAX twin.
Engine = Literal["lanes", "twin"]

# Values of parameters by name.
Start = Mapping[str, float]

# Called with the number of tests that have been read, and of all.
OnRead = Callable[[int, int], None]

_SYNTHETIC = "synthetic:"
# Power of the root mean square, that of least squares.
ROOT_MEAN_SQUARE = 2.0
# Exponent with which every test has the same weight: errors that grow in proportion to the force.
EQUAL_SHARES = 1.0

# With a higher power the better tests are lost in rounding errors, and local minimisations no longer converge.
LARGEST_POWER = 16.0


def is_synthetic(file: str) -> bool:
    """Whether a test is one of the embedded ones, and no file."""
    return file.startswith(_SYNTHETIC)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Files of one run and how each was processed: window, repairs, start of the samples that count.

    `columns` and `repairs` are as in `read_damper_test` and `repair`, with `None` for a repair that takes no amount;
    `columns_of` are those of single files, as a table of tests gives them, and go before `columns`; `start`, `end` and
    `settle` in seconds. Relative `files` are relative to `folder`, or to the current folder.
    """

    files: tuple[str, ...]
    folder: str = ""
    columns: Mapping[str, str] = field(default_factory=dict)
    start: float | None = None
    end: float | None = None
    every: Count = 1
    repairs: Mapping[RepairKind, float | None] = field(default_factory=dict)
    settle: float | None = None
    columns_of: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

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
        if record is None:
            raise RecordError(f"{origin} does not say how its tests were read; run `mrwork identify` again")
        found: Reading = record_of(cls, record, origin=origin, name="reading of tests", verb="identify")
        return found

    def tests(self, *, on_read: OnRead | None = None) -> tuple[DamperTest, ...]:
        """Read the files as tests; `on_read` is called before each.

        Raises
        ------
        RecordError
            Where a file cannot be read as a test.
        SettingError
            Where a window or a repair leaves too little of it.
        """
        tests = []
        for done, file in enumerate(self.files):
            if on_read is not None:
                on_read(done, len(self.files))
            tests.append(self._read(file))
        return tuple(tests)

    def _read(self, file: str) -> DamperTest:
        if is_synthetic(file):
            test = synthetic_test(file.removeprefix(_SYNTHETIC))
        else:
            columns = {**self.columns, **self.columns_of.get(file, {})}
            test = read_damper_test(self._path(file), columns=columns)
        if (self.start, self.end, self.every) != (None, None, 1):
            test = cut(test, start=self.start, end=self.end, every=self.every)
        amounts = {kind: amount for kind, amount in self.repairs.items() if amount is not None}
        test, _ = repair(test, self.repairs, amounts=amounts)
        return test if self.settle is None else counted_from(test, self.settle)

    def _path(self, file: str) -> str:
        """Path of a file from the current folder, or else from the folder where it was read."""
        return file if exists(file) or not self.folder else str(Path(self.folder) / file)


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """Settings of `identify`, where each is described. The fields are recorded with a fit and in its journal.

    `search` is `None` for the default search of the model; a name is replaced by the registered search of that name.

    Raises
    ------
    SettingError
        Where the power, the exponent of the force, the engine, a nuisance parameter or an observation is impossible.
    UnknownNameError
        Where no search has the name.
    """

    search: Search | str | None = None
    bounds: Mapping[str, tuple[LowerBound, UpperBound]] = field(default_factory=dict)
    starts: tuple[Start, ...] = ()
    power: float = ROOT_MEAN_SQUARE
    force_exponent: float = EQUAL_SHARES
    engine: Engine = "lanes"
    nuisances: tuple[NuisanceName, ...] = ()
    observe: tuple[str, ...] = (DETECT,)
    rng: Seed = 0

    def __post_init__(self) -> None:
        if isinstance(self.search, str):
            object.__setattr__(self, "search", search_named(self.search))
        object.__setattr__(self, "observe", as_words(self.observe))
        if self.engine not in get_args(Engine):
            raise SettingError(f"`engine` is {self.engine!r}; choose one of {', '.join(get_args(Engine))}")
        if not ROOT_MEAN_SQUARE <= self.power <= LARGEST_POWER:
            raise SettingError(
                f"the power of the mean over tests is {self.power:g}; give 2, where all weigh the same, "
                f"up to {LARGEST_POWER:g}, where hardly any but the worst counts"
            )
        if not 0.0 <= self.force_exponent <= EQUAL_SHARES:
            raise SettingError(
                f"the exponent of the force is {self.force_exponent:g}; give 1, where all tests weigh the same, down "
                "to 0, where errors in newtons do"
            )
        unknown = [name for name in self.nuisances if name not in get_args(NuisanceName)]
        if unknown:
            raise SettingError(
                f"`nuisances` names {unknown[0]!r}; choose from {', '.join(get_args(NuisanceName))}"
            )

    def as_record(self) -> dict[str, Any]:
        """Plain values of all fields, for JSON; a search is a record with its name as `kind`."""
        search = self.search
        assert not isinstance(search, str)
        record = {
            each.name: _plain(getattr(self, each.name)) for each in fields(self) if each.name != "search"
        }
        return {"search": None if search is None else _plain(record_of_search(search))} | record

    @classmethod
    @checked
    def of_record(cls, record: Mapping[str, Any]) -> FitSettings:
        """Undo `as_record`. Missing fields have their defaults, unknown keys are ignored.

        Raises
        ------
        RecordError
            Where the record cannot be read as settings.
        """
        try:
            search = record.get("search")
            known = {
                name: built(kind, record[name], name)
                for name, kind in _recorded_kinds().items()
                if name in record
            }
            # Before there was this setting, observation models were those of the tests.
            known.setdefault("observe", (NONE,))
            return cls(
                search=None if search is None else search_of_record(search),
                **known,
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
    return value


def _recorded_kinds() -> dict[str, Any]:
    """Annotations of the fields that records have as they are: all but the search."""
    own = {name: kind for name, kind in FitSettings.__annotations__.items() if name != "search"}
    return get_type_hints(SimpleNamespace(__annotations__=own), globals(), include_extras=True)
