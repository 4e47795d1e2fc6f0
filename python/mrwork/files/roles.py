"""Columns of a file by role: which are its samples, in which unit, and along which times or distances.

A reader states the roles of its columns; what the file leaves open is asked at once, with what to type.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NoReturn

import numpy as np

from mrwork.base.hints import SMALLEST
from mrwork.base.numbers import counted
from mrwork.base.summary import list_names
from mrwork.base.units import FACTORS, MeasuredQuantity, factor_of, factor_to_si, quantity_of
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import RecordError, SettingError, UnitError
from mrwork.files.grid import grid
from mrwork.files.layout import numbered_names
from mrwork.files.named_columns import (
    ColumnTable,
    find_column,
    is_of_another,
    unit_in_name,
    words_and_unit,
)

# Candidates that a question lists.
_MOST_LISTED: Final = 12
# Relative difference between a step that is stated and that of the times; more is a contradiction.
_STEPS_DIFFER: Final = 0.05
_SECONDS: Final = ("", "sec", "secs", "second", "seconds")


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """Options for what a file does not state: a unit, a step [s], a column or variable, a channel counted from 1."""

    unit: str | None = None
    dt: float | None = None
    column: str | None = None
    channel: int | None = None


def _last_unit(name: str) -> str:
    return words_and_unit(name)[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class Role:
    """What a column may be: a `noun` for sentences, its quantity, the names that mean it, and the unit in a name.

    `example` is a unit that a question shows. `elsewhere` says where columns of another quantity belong, as the end of
    a sentence, with `{file}` for the name of the file. A role is of `many` columns, or of one, which `any_name` may
    have where no other could be meant. Without `takes_options` the file alone can state unit and step.
    """

    noun: str
    quantity: MeasuredQuantity
    is_called: Callable[[str], bool]
    example: str
    unit_in: Callable[[str], str] = _last_unit
    elsewhere: Mapping[MeasuredQuantity, str] = field(default_factory=dict)
    many: bool = False
    any_name: bool = False
    takes_options: bool = True

    def unit_of(self, table: ColumnTable, name: str) -> str:
        """The unit that the name or the file states, empty where none."""
        return self.unit_in(name) or table.units.get(name, "")

    def other_quantity(self, table: ColumnTable, name: str) -> MeasuredQuantity | None:
        """The quantity of a column whose unit is of another than the role's; a bare N may be the north."""
        unit = self.unit_of(table, name) or words_and_unit(name)[1]
        other = quantity_of(unit)
        is_other = other not in (None, self.quantity) and (unit.upper() != "N" or bool(table.units))
        return other if is_other and factor_of(unit, self.quantity) is None else None

    def may_be(self, table: ColumnTable, name: str) -> bool:
        """Whether neither the unit nor a word of a name contradicts the role."""
        is_other = self.other_quantity(table, name) is not None or is_of_another(name, self.quantity)
        return self.is_called(name) or not is_other


TIME: Final = Role(
    noun="time",
    quantity="time",
    is_called=lambda name: unit_in_name("time", name) is not None,
    unit_in=lambda name: unit_in_name("time", name) or "",
    example="s",
)


@array_dataclass()
class Series:
    """Samples of columns, shape (n_columns, n_rows), in SI, `along` an axis, or at a step `dt` [s] without one.

    `where` names a row in a message, `unused` the columns that are not read.
    """

    samples: Floats
    where: Callable[[int], str]
    along: Floats | None = None
    dt: float | None = None
    names: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()


def series_of(
    table: ColumnTable,
    role: Role,
    stated: Stated,
    *,
    source: str,
    facts: Stated | None = None,
    axis: Role = TIME,
    choose: Callable[[Sequence[str]], Sequence[str]] = tuple,
) -> Series:
    """Read the columns of a role along an axis, as the file, the `facts` of its header or the options state them.

    `choose` leaves the candidates that are meant. What is open is asked at once; an option that contradicts the file is
    refused, and so are rows that do not rise.
    """
    facts, names = facts or Stated(), table.names
    is_nameless = names == numbered_names(len(names))
    along = [name for name in names if axis.is_called(name)]
    if not along and len(names) > 1:
        along = _implied_axis(table, axis, stated.dt, is_nameless=is_nameless)
    sizes = {name: table.size_of(name) for name in names}
    # A number beside vectors is no column.
    free = [name for name in names if name not in along and (sizes[name] > 1 or max(sizes.values()) == 1)]
    if stated.column is not None:
        candidates: Sequence[str] = [find_column(stated.column, names, source)]
    else:
        candidates = _candidates(table, role, free, is_nameless=is_nameless)
        candidates = choose(candidates)
    is_told = len(candidates) == 1 or (role.many and bool(candidates))
    if is_told:
        # T may be a transverse component.
        along = [name for name in along if name not in candidates] or along
        along = _one_axis(table, axis, along, candidates[0], stated.dt, source)
    if is_told and candidates[0] in along:
        raise SettingError(
            f"{source}: column '{candidates[0]}' holds the times; give `column` another of {_listed(names)}"
        )
    _refuse_others(table, role, candidates if is_told else [] if candidates else free, source)
    shown = candidates or free
    own = {name: role.unit_of(table, name) for name in (candidates if is_told else shown[:1])}
    unit, dt = stated.unit or facts.unit, stated.dt or facts.dt
    asks_unit = unit is None and not all(own.values())
    if not is_told or asks_unit or (not along and dt is None):
        number = 1 + names.index(shown[0]) if shown else 1
        heading = next((name for name, each in own.items() if not each), "")
        _ask(
            role,
            source,
            columns="" if is_told else _listed(names),
            number=number,
            heading=heading if is_told and not is_nameless else "",
            unit=asks_unit,
            step=not along and dt is None,
        )
    factors = _factors(role, own, stated.unit, facts.unit, source)
    columns = table.read([*along, *candidates])
    samples = np.array([factor * columns[name] for name, factor in zip(candidates, factors, strict=True)])
    place = {name: columns[name] * _of_axis(table, axis, name, source) for name in along}
    series = Series(
        names=tuple(candidates),
        samples=samples,
        along=next(iter(place.values()), None),
        dt=dt,
        where=lambda row: f"{source}: {table.locate(row)}",
        unused=tuple(name for name in names if name and name not in (*along, *candidates)),
    )
    check_rows(series, axis, role)
    return _with_step(series, along, stated.dt, facts.dt, source) if axis is TIME else series


def column_of(table: ColumnTable, role: Role, source: str, *, needed: bool) -> Floats | None:
    """The one column of a role without an axis, in SI; `None` where there is none and it is not `needed`."""
    names = [name for name in table.names if role.is_called(name)]
    if len(names) > 1:
        raise RecordError(
            f"{source}: columns '{names[0]}' and '{names[1]}' both look like the {role.noun}; keep one"
        )
    if not names:
        if needed:
            raise RecordError(
                f"{source}: no column is the {role.noun} among {_listed(table.names)}; call it "
                f"'{role.noun} ({role.example})'"
            )
        return None
    unit = role.unit_of(table, names[0])
    if not unit:
        raise UnitError(
            f"{source}: column '{names[0]}' does not state its unit; write it in the heading, as '{names[0]} "
            f"({role.example})'"
        )
    context = f"{source}: column '{names[0]}'"
    return factor_to_si(unit, role.quantity, context=context) * table.read(names)[names[0]]


def described(words: str, table: ColumnTable, series: Series) -> str:
    """The source of samples: what was read of a file, and what was not."""
    columns = [f"'{name}'" for name in series.unused]
    return "; not used: ".join(
        [words, *([list_names(columns, _MOST_LISTED)] if columns else []), *table.unused]
    )


def _candidates(table: ColumnTable, role: Role, free: Sequence[str], *, is_nameless: bool) -> Sequence[str]:
    if is_nameless:
        return free
    fitting = [name for name in free if role.may_be(table, name)]
    if role.many:
        return fitting
    called = [name for name in fitting if role.is_called(name)]
    of_unit = [name for name in fitting if quantity_of(role.unit_of(table, name)) == role.quantity]
    return called or of_unit or (fitting if role.any_name else [])


def _implied_axis(table: ColumnTable, axis: Role, dt: float | None, *, is_nameless: bool) -> list[str]:
    """The first column where it is the axis of the others though no name says so."""
    first = table.names[0]
    if axis is not TIME:
        return [first] if is_nameless else []
    numbers = table.numbers(first)
    # A column of sample numbers is no time.
    if numbers is None or (np.diff(numbers) == 1.0).all() or axis.other_quantity(table, first) is not None:
        return []
    is_pair = is_nameless and len(table.names) == 2 and dt is None
    return [first] if is_pair or grid(numbers).runs else []


def _one_axis(
    table: ColumnTable, axis: Role, along: Sequence[str], name: str, dt: float | None, source: str
) -> list[str]:
    """The axis of a column among those that look like it: as long, and with a step that is stated."""
    sizes = {each: table.size_of(each) for each in (name, *along)}
    along = [each for each in along if sizes[each] == sizes[name]]
    if len(along) > 1 and dt is None:
        raise RecordError(
            f"{source}: columns '{along[0]}' and '{along[1]}' both look like {axis.noun}; give the step as `dt`, or "
            "rename one"
        )
    if dt is not None and len(along) > 1:
        steps = {
            each: float(np.diff(table.read([each])[each] * _of_axis(table, axis, each, source)).mean())
            for each in along
        }
        return [min(steps, key=lambda each: abs(steps[each] - dt))]
    return [*along]


def _of_axis(table: ColumnTable, axis: Role, name: str, source: str) -> float:
    """Factor to SI of an axis; one without a unit has that of SI."""
    unit = axis.unit_of(table, name)
    unit = axis.example if unit.casefold() in _SECONDS else unit
    return factor_to_si(unit, axis.quantity, context=f"{source}: column '{name}'")


def _refuse_others(table: ColumnTable, role: Role, names: Sequence[str], source: str) -> None:
    """Refuse a table whose columns are of another quantity, and say where these belong."""
    for name in names:
        other = role.other_quantity(table, name)
        if other is not None and other in role.elsewhere:
            unit = words_and_unit(name)[1] or table.units.get(name, "")
            article = "an" if other == "acceleration" else "a"
            raise RecordError(
                f"{source}: column '{name}' is {article} {other} [{unit}], and "
                f"{role.elsewhere[other].format(file=Path(source).name)}"
            )


def _factors(
    role: Role, own: Mapping[str, str], stated: str | None, of_header: str | None, source: str
) -> list[float]:
    """Factors to SI of columns with their own units, or else with the stated one or the header's."""
    for name, unit in own.items():
        if unit:
            factor_to_si(unit, role.quantity, context=f"{source}: column '{name}'")
    if stated is not None:
        factor = factor_to_si(stated, role.quantity, context=f"{source}: `unit`")
        for name, unit in own.items():
            where = f"column '{name}'" if unit else "the header"
            symbol = unit or of_header
            is_needless = all(own.values()) or not unit
            if symbol and is_needless and factor != factor_of(symbol, role.quantity):
                raise SettingError(
                    f"{source}: `unit` is '{stated}' where {where} states {symbol}; leave it out"
                )
    return [
        factor_to_si(unit or stated or of_header or "", role.quantity, context=f"{source}: column '{name}'")
        for name, unit in own.items()
    ]


def check_rows(series: Series, axis: Role, role: Role) -> None:
    """Refuse rows that have no finite number, and rows out of order."""
    what = [(series.along, axis.noun)] if series.along is not None else []
    columns = [f" in column '{name}'" for name in series.names] if len(series.names) > 1 else [""]
    nouns = (f"{role.noun}{column}" for column in columns)
    for values, noun in (*what, *zip(series.samples, nouns, strict=True)):
        wrong = np.flatnonzero(~np.isfinite(values))
        if wrong.size:
            where = series.where(int(wrong[0]))
            raise RecordError(f"{where}: the {noun} is no finite number; correct the value or delete the row")
    n_rows = series.samples.shape[1]
    if n_rows < 2:
        raise RecordError(f"{series.where(0)}: the record has {counted(n_rows, 'row')}; give two or more")
    if series.along is None:
        return
    falls = grid(series.along).falls
    if falls.size:
        row, unit = int(falls[0]), axis.example
        raise RecordError(
            f"{series.where(row)}: {axis.noun} goes from {series.along[row - 1]:g} to {series.along[row]:g} {unit}; "
            f"sort the rows, and write the {axis.noun} with digits enough to differ"
        )


def _with_step(
    series: Series, along: Sequence[str], stated: float | None, of_header: float | None, source: str
) -> Series:
    """The series, whose step is refused where it contradicts its times, the options or the header."""
    if stated is not None and of_header is not None and not np.isclose(stated, of_header, rtol=1e-3):
        raise SettingError(
            f"{source}: `dt` is {stated:g} s where the header states {of_header:g} s; leave it out"
        )
    if stated is not None and not SMALLEST <= stated < np.inf:
        raise SettingError(f"{source}: `dt` is {stated} s; give a positive step")
    if series.along is None:
        return series
    step = grid(series.along).median
    if stated is not None and abs(step / stated - 1.0) > _STEPS_DIFFER:
        raise SettingError(
            f"{source}: column '{along[0]}' holds the times, with a step of {step:.6g} s where `dt` is {stated:g} s; "
            "leave out `dt`, or correct the one that is wrong"
        )
    if of_header is not None and abs(step / of_header - 1.0) > _STEPS_DIFFER:
        raise RecordError(
            f"{source}: the header states a step of {of_header:.6g} s, and column '{along[0]}' has {step:.6g} s; "
            "correct the one that is wrong"
        )
    return series


def _listed(names: Sequence[str]) -> str:
    numbered = names == numbered_names(len(names))
    columns = [name if numbered else f"{number} '{name}'" for number, name in enumerate(names, start=1)]
    return list_names(columns, _MOST_LISTED)


def _ask(
    role: Role, source: str, *, columns: str, number: int, heading: str, unit: bool, step: bool
) -> NoReturn:
    """Refuse a table with all open questions at once: which column, which unit, which step."""
    units = ", ".join(FACTORS[role.quantity])
    in_heading = f"in the heading, as '{heading} ({role.example})'"
    # What is open, what is typed, and how the file itself may state it.
    asked = (
        (columns, f"which column is the {role.noun} ({columns})", f'column="{number}"', ""),
        (unit, f"the unit of the {role.noun} (one of {units})", f'unit="{role.example}"', in_heading),
        (step, "the step, for no column is time", "dt=0.01", "by a column of times, as time_s"),
    )
    is_open, words, typed, in_file = zip(*(each for each in asked if each[0]), strict=True)
    error = UnitError if unit and len(is_open) == 1 else RecordError
    how = f"as here: {', '.join(typed)}" if role.takes_options else " and ".join(in_file)
    how += f"; the unit may stand {in_heading}, too" if heading and unit and role.takes_options else ""
    raise error(f"{source}: the file does not state {' and '.join(words)}; give it {how}")
