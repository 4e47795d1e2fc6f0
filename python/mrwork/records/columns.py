"""Assignment of file columns to quantities: by column names with units, or by an explicit mapping."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Final, Literal

import numpy as np

from mrwork.base.keys import suggestion
from mrwork.base.summary import list_names
from mrwork.base.units import (
    FACTORS,
    OTHER_COMMAND_UNITS,
    CommandUnit,
    factor_of,
    factor_of_product,
    factor_to_si,
    quantity_of,
    rotary_factor,
    spelt_command_unit,
)
from mrwork.base.values import Floats
from mrwork.dampers.command import LARGEST_COMMAND, Command
from mrwork.errors import MrworkError, RecordError, Restorable, SettingError, UnitError
from mrwork.files.layout import numbered_names
from mrwork.files.named_columns import (
    NO_COLUMN,
    QUANTITIES,
    TEST_ROLES,
    ColumnTable,
    Missing,
    ReadColumn,
    TestQuantity,
    column_option,
    find_column,
    is_plain,
    is_second_choice,
    is_set_point,
    may_be_a_command,
    scalar_unit_in_name,
    suggested_options,
    unit_in_name,
    words_and_bracket,
    words_and_unit,
)

REQUIRED: Final = tuple(quantity for quantity, role in TEST_ROLES.items() if role.is_required)
MARKERS: Final = "markers"
"""Key of a mapping of columns for lines among the rows that are none, which `SKIP` leaves out."""
SKIP: Final = "skip"
LEFT_OUT: Final = "none"
"""Entry of a mapping of columns, by quantity or heading, for what is not read."""

COMMAND: Final = "command"
"""Key of a mapping of columns for the command: a column of current or voltage, or a number with its unit."""

COMMANDS: Final[tuple[Literal["current"], Literal["voltage"]]] = ("current", "voltage")
# Names that a message lists.
_MOST_SHOWN: Final = 20
# In the names of columns, and in no unit.
_OF_A_NAME: Final = re.compile(r"[\s()\[\]{}]")
# What one of the column's numbers stands for, after their own unit: V*200N, counts*0.1N-5N; or that unit times or over
# another: bar*12.5cm2, deg*0.05m, Nm/0.05m.
_NUMBER: Final = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_SCALE: Final = re.compile(
    rf"(?P<own>[^*]*?)(?P<by>[*/])(?P<scale>[+-]?{_NUMBER})(?P<unit>[^\W\d][^+*-]*)"
    rf"(?:(?P<offset>[+-]{_NUMBER})(?P<of_offset>[^\W\d][^+*-]*))?"
)
# Forces of a table of peak velocities, in either direction.
_OF_DYNAMOMETER: Final = re.compile(
    r"compression|rebound|\bbump\b|jounce|druckstufe|zugstufe|compresi[oó]n|rebote|détente", re.IGNORECASE
)
# A scale without its unit.
_NO_UNIT: Final = re.compile(rf":[^:*]*\*({_NUMBER})\s*(?:[-+]|$)")
# The force of two pressures: P1:bar*12.5cm2-P2:bar*8cm2.
_DIFFERENCE: Final = re.compile(rf"(?P<first>.+:[^:]*\*{_NUMBER}[^\W\d_]+\d?)\s*-\s*(?P<second>.+:[^:]+)")
_STARTS_AS_NUMBER: Final = re.compile(r"[+-]?[.,]?\d|[+-]?(nan|inf)\b", re.IGNORECASE)
_NUMBER_AND_UNIT: Final = re.compile(
    r"([+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?)\s*([^\W\d_]+|%|deg [CF]|\N{DEGREE SIGN}[CF]?)",
    re.IGNORECASE,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnChoice:
    """Column of a quantity, its unit, with a scale where one is stated, and factor and offset from that to SI.

    `less` is what is subtracted, as of the pressure on the other side of a piston. A `rotary` one is an angle, its rate
    or a torque, with its factor to rad, rad/s or N m.
    """

    column: str
    unit: str
    factor: float
    offset: float = 0.0
    less: ColumnChoice | None = None
    rotary: bool = False

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns that are read."""
        return (self.column, *(() if self.less is None else self.less.columns))

    def in_si(self, numbers: Mapping[str, Floats]) -> Floats:
        """The quantity in SI, by the numbers of columns."""
        own = self.factor * numbers[self.column]
        own = own + self.offset if self.offset else own
        return own if self.less is None else np.asarray(own - self.less.in_si(numbers))

    @property
    def specification(self) -> str:
        """The choice as an entry of a mapping of columns."""
        less = "" if self.less is None else f"-{self.less.specification}"
        return f"{self.column}:{self.unit}{less}"


def parse_column_option(option: str) -> tuple[str, str]:
    """Split ``"force=F:kN"`` into ``("force", "F:kN")``, checking quantity and unit.

    The quantity may also be the command, a column or a number with its unit, as in ``"command=0.5 A"``.

    Examples
    --------
    >>> parse_column_option("force=F:kN")
    ('force', 'F:kN')
    """
    name, equals, specification = option.partition("=")
    if not equals:
        raise SettingError(
            f"column option '{option}' has no '='; expected QUANTITY=COLUMN:UNIT, such as force=F:kN"
        )
    check_specification(name.strip(), specification)
    return name.strip(), specification.strip()


def check_specification(name: str, specification: str) -> None:
    """Check an entry of a mapping of columns without a file."""
    if specification.strip() == LEFT_OUT:
        if name in REQUIRED:
            raise SettingError(f"the {name} cannot be left out; give its column, as in {name}=COLUMN:UNIT")
    elif name == MARKERS:
        if specification.strip() != SKIP:
            raise SettingError(f"the markers are '{specification}'; give {SKIP}, or correct these lines")
    elif name == COMMAND:
        StatedCommand.of(specification)
    else:
        two = _DIFFERENCE.fullmatch(specification.strip())
        for text in (specification,) if two is None else two.group("first", "second"):
            _parse_specification(_quantity(name), text)


def stated_step(specification: str) -> float | None:
    """The step [s] of a record without a column of times, from "0.005 s" or a rate, "200 Hz"; `None` of a column."""
    number = _NUMBER_AND_UNIT.fullmatch(specification.strip())
    scales = [number and factor_of(number[2], quantity) for quantity in ("time", "frequency")]
    if number is None or scales == [None, None]:
        return None
    value = float(number[1].replace(",", "."))
    if value <= 0.0:
        raise SettingError(f"the time is '{specification}'; give a step or a sampling rate above zero")
    return value * scales[0] if scales[0] else 1.0 / (value * float(scales[1] or 1.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedCommand:
    """The command as it is stated for a test: a number, or a column, with its unit or the file's.

    A column of current or voltage has its `quantity`, and the unit of the file in its name; a number, and a column of
    another command, have their `unit`.
    """

    value: float | None = None
    column: str = ""
    unit: CommandUnit | None = None
    quantity: Literal["current", "voltage"] | None = None

    def in_file(self, headings: Headings) -> StatedCommand:
        """The command as a file has it: its column by exact name, its unit as stated, or by the name or the file."""
        if self.quantity is not None or self.value is not None:
            return self
        name = find_column(self.column, headings.names, headings.source)
        if self.unit is not None:
            return replace(self, column=name)
        for unit in (headings.units.get(name, ""), words_and_unit(name)[1]):
            for quantity in COMMANDS:
                if quantity_of(unit) == quantity:
                    return StatedCommand(quantity=quantity, column=f"{name}:{unit}")
            if (command_unit := spelt_command_unit(unit)) is not None:
                return StatedCommand(column=name, unit=command_unit)
        raise UnitError(
            f"{headings.source}: the column '{name}' of the command does not say its unit; give it, as in "
            f"{column_option(COMMAND, name, 'A')}, or one of {', '.join(OTHER_COMMAND_UNITS)}"
        )

    @classmethod
    def of(cls, text: str) -> StatedCommand:
        """Read ``"0.5 A"``, ``"COLUMN:UNIT"`` or ``"COLUMN"``."""
        stated = text.strip()
        number = _NUMBER_AND_UNIT.fullmatch(stated)
        column, colon, unit = (part.strip() for part in stated.rpartition(":"))
        unit = number[2] if number else unit
        quantity = next((each for each in COMMANDS if quantity_of(unit) == each), None)
        other = spelt_command_unit(unit)
        if quantity is None and number is None and not colon:
            if not stated or _STARTS_AS_NUMBER.match(stated):
                raise SettingError(
                    f"the command is '{stated}'; expected a number with its unit, such as 0.5 A, or COLUMN:UNIT"
                )
            return cls(column=stated)
        if quantity is None and (other is None or not (number or column)):
            raise UnitError(
                f"the command is '{stated}': '{unit}' is no unit of a command; give one of "
                f"{', '.join(unit for each in COMMANDS for unit in FACTORS[each])}, {', '.join(OTHER_COMMAND_UNITS)}"
            )
        if number is None:
            if quantity is None:
                return cls(column=column, unit=other)
            _parse_specification(quantity, text)
            return cls(quantity=quantity, column=stated)
        value = float(number[1].replace(",", "."))
        if quantity is None:
            if other and (wrong := Command(value, other).impossibility):
                raise SettingError(f"the command '{stated}' {wrong}")
            return cls(value=value, unit=other)
        value *= factor_to_si(unit, quantity, context=f"the command '{stated}'")
        if not 0.0 <= value <= LARGEST_COMMAND:
            raise SettingError(
                f"the command is '{stated}'; give one from 0 to {LARGEST_COMMAND:g} A or V: the force does not "
                "depend on its direction"
            )
        return cls(value=value, unit="A" if quantity == "current" else "V")


class _UnclearError(Restorable, Exception):
    """What cannot be told of a quantity: the problem, and what to do; the column and its unit where they are known."""

    def __init__(self, problem: str, remedy: str, missing: Missing, kind: type[MrworkError]) -> None:
        super().__init__(f"{problem}; {remedy}")
        self.problem, self.remedy, self.missing, self.kind = problem, remedy, missing, kind


@dataclass(frozen=True, slots=True, kw_only=True)
class Headings:
    """Names of the columns of a file, the `units` that stand apart from them, and the `stamps` of times of the day.

    `read` reads a column, for the unit that a message suggests; those that are `taken` are not recognised again. The
    displacement of a `rotary` damper is an angle.
    """

    names: Sequence[str]
    units: Mapping[str, str]
    stamps: Collection[str]
    source: str
    read: ReadColumn
    taken: frozenset[str] = frozenset()
    rotary: bool = False

    @classmethod
    def of(cls, table: ColumnTable, source: str = "") -> Headings:
        """Those of a table, whose columns are read without the lines that mark events among its rows."""
        rows = cache(table.without_markers)
        return cls(
            names=table.names,
            units=table.units,
            stamps=table.stamps,
            source=source,
            read=lambda name: rows()[0].numbers(name),
        )

    def assign(
        self, columns: Mapping[str, str]
    ) -> tuple[dict[TestQuantity, ColumnChoice], StatedCommand | None]:
        """The column of every quantity, and a command that is a number, or a column of another unit than A and V.

        `columns` go before the names: quantity to ``"COLUMN:UNIT"`` or ``"COLUMN"``.
        """
        absent = {name for name, specification in columns.items() if specification.strip() == LEFT_OUT}
        for name in absent:
            check_specification(name, LEFT_OUT)
        if stated_step(columns.get("time", "")) is not None:
            absent.add("time")
        specs = {name: specification for name, specification in columns.items() if name not in absent}
        left_out = {find_column(name, self.names, self.source) for name in absent - {*QUANTITIES, COMMAND}}
        absent |= {*COMMANDS} if COMMAND in absent else set()
        stated = StatedCommand.of(specs.pop(COMMAND)).in_file(self) if COMMAND in specs else None
        scalar = stated
        if stated is None:
            scalar = None if (specs.keys() | absent) & set(COMMANDS) else self.scalar_command()
        elif stated.quantity is not None:
            specs[stated.quantity], scalar = stated.column, None
        # A scalar command is no other quantity, whatever the unit in its name.
        left_out |= set() if scalar is None else {scalar.column}
        rest = replace(self, names=tuple(name for name in self.names if name not in left_out))
        chosen = rest._choose(specs, absent)
        if stated is not None and stated.quantity is None:
            chosen = {quantity: choice for quantity, choice in chosen.items() if quantity not in COMMANDS}
        return chosen, None if chosen.keys() & set(COMMANDS) else scalar

    def _choose(
        self, columns: Mapping[str, str], absent: Collection[str]
    ) -> dict[TestQuantity, ColumnChoice]:
        chosen: dict[TestQuantity, ColumnChoice] = {}
        for name, specification in columns.items():
            quantity = _quantity(name)
            chosen[quantity] = self._parse_specification(quantity, specification)
        named = replace(self, taken=_columns_of(chosen))
        unclear: list[_UnclearError] = []
        for quantity in QUANTITIES:
            if quantity in chosen or quantity in absent:
                continue
            try:
                choice = replace(named, rotary=_is_rotary(chosen))._recognise(quantity)
            except _UnclearError as error:
                unclear.append(error)
            else:
                chosen |= {} if choice is None else {quantity: choice}
        if unclear:
            raise replace(self, taken=_columns_of(chosen))._refusal(unclear)
        self._check_one_motion(chosen)
        return chosen

    def _check_one_motion(self, chosen: Mapping[TestQuantity, ColumnChoice]) -> None:
        """Refuse an angle beside a force, and a torque beside a displacement."""
        kinds = {quantity: chosen[quantity] for quantity in ("displacement", "force") if quantity in chosen}
        angles = [choice for choice in kinds.values() if choice.rotary]
        if angles and len(angles) < len(kinds):
            of = angles[0]
            quantity = next(name for name, choice in kinds.items() if choice is of)
            arm = "*0.05m" if quantity == "displacement" else "/0.05m"
            other = next(choice for choice in kinds.values() if choice is not of)
            raise RecordError(
                f"{self.source}: '{of.column}' [{of.unit}] is of a rotation, and '{other.column}' [{other.unit}] is "
                "not; give both of the rotation, or the arm in place of 0.05 m, as in "
                f"{column_option(quantity, of.column, of.unit + arm)}"
            )

    def guess(self) -> tuple[dict[TestQuantity, ColumnChoice], dict[TestQuantity, str]]:
        """The columns that can be told by name, with common symbols of units, and why others cannot be told."""
        chosen: dict[TestQuantity, ColumnChoice] = {}
        doubts: dict[TestQuantity, str] = {}
        for quantity in QUANTITIES:
            try:
                choice = replace(self, rotary=_is_rotary(chosen))._recognise(quantity)
            except (_UnclearError, MrworkError) as error:
                doubts[quantity] = str(error).removeprefix(f"{self.source}: ")
            else:
                if choice is not None:
                    symbols = FACTORS[quantity].items()
                    unit = next(
                        (symbol for symbol, factor in symbols if factor == choice.factor), choice.unit
                    )
                    unit = choice.unit if choice.rotary else unit
                    chosen[quantity] = replace(choice, unit=unit)
        return chosen, doubts

    def scalar_command(self) -> StatedCommand | None:
        """The column whose name means a command that is neither a current nor a voltage, with its unit; else `None`."""
        read = [
            (name, unit)
            for name in self.names
            if (unit := scalar_unit_in_name(name, self.units.get(name, "")))
        ]
        if len(read) > 1:
            (first, first_unit), (second, _) = read[:2]
            raise RecordError(
                f"{self.source}: columns '{first}' and '{second}' both look like the command; say which one to use, as "
                f"in {column_option(COMMAND, first, first_unit)}"
            )
        return next((StatedCommand(column=name, unit=unit) for name, unit in read), None)

    def asked_commands(self, used: Collection[str]) -> tuple[str, ...]:
        """Columns in a unit of commands, among those that are not used."""
        return tuple(
            name
            for name in self.names
            if name not in used and may_be_a_command(name, self.units.get(name, ""))
        )

    def unclear_commands(self, used: Collection[str]) -> tuple[str, ...]:
        """Columns that may be the command and do not say their unit, among those that are not used."""
        return tuple(
            name
            for name in self.names
            if name not in used and any(self._may_be_command(quantity, name) for quantity in COMMANDS)
        )

    def _may_be_command(self, quantity: Literal["current", "voltage"], name: str) -> bool:
        unit = unit_in_name(quantity, name)
        # The letters u and v also mean a motion.
        is_letter = is_plain(quantity, name) and name.strip()[1:2] in ("", *" _-/,:.([")
        has_unit = unit is not None and (quantity_of(unit) or quantity_of(self.units.get(name, "")))
        return unit is not None and not has_unit and not (is_letter and quantity == "voltage")

    @property
    def free(self) -> list[str]:
        """The names that are not taken."""
        return [name for name in self.names if name not in self.taken]

    def _parse_specification(self, quantity: TestQuantity, specification: str) -> ColumnChoice:
        """The column that a ``"COLUMN:UNIT"`` or ``"COLUMN"`` names; without a unit the file's."""
        two = _DIFFERENCE.fullmatch(specification.strip())
        if two is not None:
            first, second = (
                self._parse_specification(quantity, text) for text in two.group("first", "second")
            )
            return replace(first, less=second)
        column, unit = _parse_specification(quantity, specification)
        name = find_column(column, self.names, self.source)
        if not unit:
            stated = (self.units.get(name, ""), words_and_unit(name)[1])
            known = (
                each for each in stated if quantity_of(each) or rotary_factor(each, quantity) is not None
            )
            unit = next(known, "")
        if not unit:
            raise UnitError(
                f"{self.source}: column '{name}' does not say its unit; give it, as in "
                f"{column_option(quantity, name, next(iter(FACTORS[quantity])))}"
            )
        context = f"column option {quantity}={specification}"
        factor, offset = _scale_of(unit, quantity, context=context)
        rotary = rotary_factor(unit, quantity) is not None
        return ColumnChoice(column=name, unit=unit, factor=factor, offset=offset, rotary=rotary)

    def _recognise(self, quantity: TestQuantity) -> ColumnChoice | None:
        claims = [
            (name, unit) for name in self.free for unit in [self._unit(quantity, name)] if unit is not None
        ]
        fitting = [(name, unit) for name, unit in claims if quantity_of(unit) == quantity]
        fitting = [claim for claim in fitting if not is_second_choice(quantity, claim[0])] or fitting
        # A column that is called just Force is the force, whatever Force of cell 2 is.
        fitting = [claim for claim in fitting if is_plain(quantity, claim[0])] or fitting
        if not fitting and quantity == "time":
            fitting = [(name, "s") for name in self.free if name in self.stamps]
        if len(fitting) > 1:
            (first, unit), (second, _) = fitting[:2]
            problem = f"columns '{first}' and '{second}' both look like the {quantity}"
            missing = Missing(quantity=quantity, column=first, unit=unit)
            raise _UnclearError(problem, "say which one to use", missing, RecordError)
        if fitting:
            name, unit = fitting[0]
            return ColumnChoice(column=name, unit=unit, factor=factor_to_si(unit, quantity, context=name))
        if (turning := self._turning(quantity)) is not None:
            return turning
        for name, unit in claims:
            # The name of an optional column is too ambiguous to refuse if it is one letter, or several words.
            is_weak = quantity not in REQUIRED and (len(name.strip()) == 1 or not is_plain(quantity, name))
            if is_weak or is_second_choice(quantity, name) or self._claimed_by_another(quantity, name):
                continue
            if quantity_of(unit) is None:
                if spelt_command_unit(unit) is not None or self.read(name) is None:
                    continue  # revolutions a minute, or a column of texts
                lacks = f"has the unknown unit '{unit}'" if unit else "does not say its unit"
                problem = f"column '{name}' {lacks} ({', '.join(FACTORS[quantity])} are known)"
                remedy = f"rename it, for example to '{TEST_ROLES[quantity].example}', or give the unit"
                raise _UnclearError(problem, remedy, Missing(quantity=quantity, column=name), UnitError)
            if quantity_of(unit) == "voltage":
                option = column_option(quantity, name, f"{unit}*1{next(iter(FACTORS[quantity]))}")
                raise UnitError(
                    f"{self.source}: column '{name}' is in {unit}; give the {quantity} that one {unit} stands for in "
                    f"place of the 1 in {option}"
                )
            factor_to_si(unit, quantity, context=f"{self.source}: column '{name}'")
        if quantity in REQUIRED:
            raise self._without(quantity)
        return None

    def _turning(self, quantity: TestQuantity) -> ColumnChoice | None:
        """The one column in a unit of an angle or a torque, or of a rate beside an angle, in place of a quantity."""
        if quantity == "velocity" and not self.rotary:
            return None
        found = [
            (name, unit, factor)
            for name in self.free
            for unit in (self._stated(name),)
            if (factor := rotary_factor(unit, quantity)) is not None and not is_set_point(name)
        ]
        if len(found) != 1:
            return None
        ((name, unit, factor),) = found
        return ColumnChoice(column=name, unit=unit, factor=factor, rotary=True)

    def _refusal(self, unclear: Sequence[_UnclearError]) -> MrworkError:
        """The first problem, with the options that solve all of them."""
        free = self.free
        peaks = [name for name in self.names if _OF_DYNAMOMETER.search(name)]
        speed = next((name for name in self.names if quantity_of(self._stated(name)) == "velocity"), "")
        if peaks and speed and any(error.missing.quantity == "time" for error in unclear):
            named = list_names([f"'{name}'" for name in (speed, *peaks)])
            return RecordError(
                f"{self.source}: has forces over peak velocities, as of a dynamometer ({named}), and no times; models "
                "are fitted to records over time, so export each run with its time, displacement and force; with this "
                "table compare the force over velocity of a fit, as mrwork export RUN --to csv writes it"
            )
        units = {name: self.units.get(name, "") or words_and_unit(name)[1] for name in free}
        options = suggested_options([error.missing for error in unclear], free, units, self.read)
        first = unclear[0]
        # A command may be a current or a voltage.
        column = first.missing.column
        others = [
            error.missing.quantity for error in unclear[1:] if not column or error.missing.column != column
        ]
        if others and not self._is_nameless:
            how = f"the {' and the '.join(others)} cannot be told either; give them, {options}"
        else:
            how = f"{first.remedy}{'' if NO_COLUMN in options else ','} {options}"
        if f"time={NO_COLUMN}" in options:
            how += "; without a column of times give the step or sampling rate, as in --column 'time=200 Hz'"
        if NO_COLUMN in options:
            how += "; or leave out what is no record"
        return first.kind(f"{self.source}: {first.problem}; {how}")

    def _without(self, quantity: TestQuantity) -> _UnclearError:
        if self._is_nameless:
            problem = "the columns have no names"
            remedy = (
                "add a header line such as t_s,displacement_m,force_n, or give the columns by their numbers"
            )
        else:
            shown = list_names([f"'{name}'" for name in self.names], _MOST_SHOWN)
            problem = f"no column for the {quantity} among {shown}"
            remedy = f"rename one, for example to '{TEST_ROLES[quantity].example}', or say which it is"
            pressures = [
                name for name in self.free if factor_of_product(self._stated(name), "*", "m2", "force")
            ]
            if quantity == "force" and pressures:
                terms = (f"{name}:{self._stated(name)}*12.5cm2" for name in pressures[:2])
                option = f"--column 'force={'-'.join(terms)}'"
                remedy = f"give the areas of pistons in place of 12.5 cm2, as in {option}, {remedy}"
        return _UnclearError(problem, remedy, Missing(quantity=quantity), RecordError)

    def _stated(self, name: str) -> str:
        return words_and_bracket(name)[1] or self.units.get(name, "")

    @property
    def _is_nameless(self) -> bool:
        return tuple(self.names) == numbered_names(len(self.names))

    def _claimed_by_another(self, quantity: TestQuantity, name: str) -> bool:
        others = (other for other in QUANTITIES if other != quantity)
        return any(quantity_of(self._unit(other, name) or "") == other for other in others)

    def _unit(self, quantity: TestQuantity, name: str) -> str | None:
        """Unit of a column that means the quantity, of its name or stated apart; `None` if it means another one."""
        unit, apart = unit_in_name(quantity, name), self.units.get(name, "")
        if unit is None or not apart:
            return unit
        if len({factor_of(unit, quantity), factor_of(apart, quantity), None}) > 2:
            raise UnitError(
                f"{self.source}: column '{name}' says '{unit}' in its name and '{apart}' below it; give the unit "
                f"with {column_option(quantity, name, unit)}"
            )
        return unit if quantity_of(unit) is not None else apart


def _columns_of(chosen: Mapping[TestQuantity, ColumnChoice]) -> frozenset[str]:
    return frozenset(column for choice in chosen.values() for column in choice.columns)


def _is_rotary(chosen: Mapping[TestQuantity, ColumnChoice]) -> bool:
    return "displacement" in chosen and chosen["displacement"].rotary


def _quantity(name: str) -> TestQuantity:
    for quantity in QUANTITIES:
        if quantity == name:
            return quantity
    near = suggestion(name, (*QUANTITIES, COMMAND), otherwise="use one of")
    raise SettingError(f"'{name}' is not a quantity of a damper test{near}")


def _parse_specification(quantity: TestQuantity, specification: str) -> tuple[str, str]:
    """Column and unit of ``"COLUMN:UNIT"``; the unit is empty where the file has to tell it."""
    if (bare := _NO_UNIT.search(specification)) is not None:
        raise SettingError(
            f"column for the {quantity} is '{specification}': the scale {bare[1]} has no unit; give it, as in "
            f"V*{bare[1]}{next(iter(FACTORS[quantity]))}, or of a pressure its area, as bar*{bare[1]}cm2"
        )
    column, colon, unit = (part.strip() for part in specification.rpartition(":"))
    if colon and ("*" in unit or _SCALE.fullmatch("".join(unit.split()))):
        unit = "".join(unit.split())
    if colon and _OF_A_NAME.search(unit) and rotary_factor(unit, quantity) is None:
        # A colon within a heading: Position(Linear:Digital Position) (mm).
        column, colon, unit = specification.strip(), "", ""
    if not colon:
        column, unit = specification.strip(), ""
    if not column or (colon and not unit):
        name = TEST_ROLES[quantity].example.partition("_")[0]
        raise SettingError(
            f"column for the {quantity} is '{specification}'; expected COLUMN:UNIT, such as "
            f"{name}:{next(iter(FACTORS[quantity]))}, or COLUMN where the file tells the unit"
        )
    if unit:
        _scale_of(unit, quantity, context=f"column option {quantity}={specification}")
    return column, unit


def _scale_of(unit: str, quantity: TestQuantity, *, context: str) -> tuple[float, float]:
    """Factor and offset to SI of a unit, or of a scale, as ``V*200N``, ``counts*0.1N-5N`` or ``bar*12.5cm2``."""
    turning, scale = rotary_factor(unit, quantity), _SCALE.fullmatch(unit)
    if turning is not None:
        return turning, 0.0
    if scale is None and "*" not in unit:
        return factor_to_si(unit, quantity, context=context), 0.0
    si = next(iter(FACTORS[quantity]))
    if scale is None:
        raise SettingError(
            f"{context}: '{unit.partition('*')[2]}' is no scale; give the {quantity} that one of the column's numbers "
            f"stands for, with its unit, and an offset where there is one, as in V*200{si} or counts*0.5{si}-20{si}"
        )
    number = float(scale["scale"])
    product = factor_of_product(scale["own"], scale["by"], scale["unit"], quantity)
    if product is not None:
        factor = product * number if scale["by"] == "*" else product / number
    else:
        factor = number * factor_to_si(scale["unit"], quantity, context=context)
    if not scale["offset"]:
        return factor, 0.0
    return factor, float(scale["offset"]) * factor_to_si(scale["of_offset"], quantity, context=context)


def tells_a_test(table: ColumnTable, names: Sequence[str] = ()) -> bool:
    """Whether the headings of a table, or some of them, tell time, displacement and force."""
    headings = Headings.of(table)
    return replace(headings, names=names or headings.names).guess()[0].keys() >= {*REQUIRED}
