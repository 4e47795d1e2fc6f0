"""Assignment of file columns to quantities: by column names with units, or by an explicit mapping."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

from mrwork.arguments import checked
from mrwork.errors import MrworkError, RecordError, SettingError, UnitError
from mrwork.records.column_names import QUANTITIES, TestQuantity, is_plain, unit_at_end, unit_in_name
from mrwork.units import FACTORS, factor_of, factor_to_si, known_units, quantity_of

REQUIRED: Final[tuple[TestQuantity, ...]] = ("time", "displacement", "force")

_EXAMPLE: Final[Mapping[TestQuantity, str]] = {
    "time": "t_s",
    "displacement": "displacement_mm",
    "velocity": "velocity_mps",
    "force": "force_N",
    "current": "current_A",
    "voltage": "voltage_V",
}


COMMAND: Final = "command"
"""Key of a mapping of columns for the command: a column of current or voltage, or a number with its unit."""

COMMANDS: Final[tuple[Literal["current"], Literal["voltage"]]] = ("current", "voltage")
_STARTS_AS_NUMBER: Final = re.compile(r"[+-]?[.,]?\d|[+-]?(nan|inf)\b", re.IGNORECASE)
_NUMBER_AND_UNIT: Final = re.compile(r"([+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?)\s*([^\W\d_]+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnChoice:
    """Column of a quantity, its unit, and the factor from that to SI."""

    column: str
    unit: str
    factor: float

    @property
    def specification(self) -> str:
        """The choice as an entry of a mapping of columns."""
        return f"{self.column}:{self.unit}"


def numbered_names(count: int) -> tuple[str, ...]:
    """Names of columns that have none: their numbers from 1."""
    return tuple(str(number + 1) for number in range(count))


@checked
def parse_column_option(option: str) -> tuple[str, str]:
    """Split ``"force=F:kN"`` into ``("force", "F:kN")``, checking quantity and unit.

    The quantity may also be the command, a column or a number with its unit, as in ``"command=0.5 A"``.

    Raises
    ------
    SettingError
        The text has another form, or does not name a quantity of a damper test.
    UnitError
        The unit is unknown or measures another quantity.

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
    """Check an entry of a mapping of columns without a file.

    Raises
    ------
    SettingError
        It has another form, or `name` is neither a quantity of a damper test nor the command.
    UnitError
        The unit is unknown or measures another quantity.
    """
    if name == COMMAND:
        StatedCommand.of(specification)
    else:
        _parse_specification(_quantity(name), specification)


LARGEST_COMMAND = 1000.0
"""Largest command [A or V] that a test may have."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedCommand:
    """The command as it is stated for a test: a number in SI, or a column, with its unit or the file's.

    The `quantity` is `None` where the unit is that of the file.
    """

    quantity: TestQuantity | None
    value: float | None = None
    column: str = ""

    def in_file(
        self, names: Sequence[str], units: Mapping[str, str], source: str
    ) -> tuple[TestQuantity, str]:
        """The quantity of a command that is a column, and its ``"COLUMN:UNIT"``.

        Raises
        ------
        RecordError
            There is no such column.
        UnitError
            Neither its name nor the file gives it a unit of a current or a voltage.
        """
        if self.quantity is not None:
            return self.quantity, self.column
        name = _find(self.column, names, source)
        for unit in (units.get(name, ""), unit_at_end(name)):
            for quantity in COMMANDS:
                if quantity_of(unit) == quantity:
                    return quantity, f"{name}:{unit}"
        raise UnitError(
            f"{source}: the column '{name}' of the command does not say whether it is a current or a voltage; give its "
            f"unit, as in --column {COMMAND}={name}:A"
        )

    @classmethod
    def of(cls, text: str) -> StatedCommand:
        """Read ``"0.5 A"``, ``"COLUMN:UNIT"`` or ``"COLUMN"``.

        Raises
        ------
        SettingError
            The text has another form.
        UnitError
            The unit is none of a current or a voltage.
        """
        number = _NUMBER_AND_UNIT.fullmatch(text.strip())
        unit = number[2] if number else text.rpartition(":")[2].strip()
        quantity = next((each for each in COMMANDS if quantity_of(unit) == each), None)
        if quantity is None:
            if not text.strip() or (
                _STARTS_AS_NUMBER.match(text.strip()) and number is None and ":" not in text
            ):
                raise SettingError(
                    f"the command is '{text.strip()}'; expected a number with its unit, such as 0.5 A, or COLUMN:UNIT"
                )
            if number is None and ":" not in text:
                return cls(quantity=None, column=text.strip())
            raise UnitError(
                f"the command is '{text.strip()}': '{unit}' is no unit of a current or a voltage; give one of "
                f"{', '.join(known_units(each) for each in COMMANDS)}"
            )
        if number is None:
            _parse_specification(quantity, text)
            return cls(quantity=quantity, column=text.strip())
        factor = factor_to_si(unit, quantity, context=f"the command '{text.strip()}'")
        value = factor * float(number[1].replace(",", "."))
        if not 0.0 <= value <= LARGEST_COMMAND:
            raise SettingError(
                f"the command is '{text.strip()}'; give one from 0 to {LARGEST_COMMAND:g} A or V: the force does not "
                "depend on its direction"
            )
        return cls(quantity=quantity, value=value)


def choose_columns(
    names: Sequence[str],
    columns: Mapping[str, str] | None,
    *,
    source: str,
    units: Mapping[str, str] | None = None,
    required: Sequence[TestQuantity] = REQUIRED,
) -> dict[TestQuantity, ColumnChoice]:
    """Find the column of every quantity that a file contains.

    Parameters
    ----------
    names
        Column names in file order.
    columns
        Quantity to ``"COLUMN:UNIT"``, with precedence over the column names. Other quantities are still found by name.
    source
        The file, for messages.
    units
        Units that the file states apart from the names, by name.
    required
        Quantities that must have a column.

    Raises
    ------
    RecordError
        A required quantity has no column, a mapped column does not exist, or two columns match one quantity.
    UnitError
        A required column has no unit, a unit of another quantity, or two different units.
    SettingError
        The mapping is malformed.
    """
    chosen: dict[TestQuantity, ColumnChoice] = {}
    for name, specification in (columns or {}).items():
        quantity = _quantity(name)
        column, unit, factor = _parse_specification(quantity, specification)
        chosen[quantity] = ColumnChoice(column=_find(column, names, source), unit=unit, factor=factor)
    taken = {choice.column for choice in chosen.values()}
    named = _Names(
        names=names,
        free=tuple(name for name in names if name not in taken),
        units=units or {},
        source=source,
        required=required,
    )
    for quantity in QUANTITIES:
        if quantity not in chosen:
            choice = named.recognise(quantity)
            if choice is not None:
                chosen[quantity] = choice
    return chosen


@dataclass(frozen=True, slots=True, kw_only=True)
class _Names:
    """Names of the columns of a file, those that are not assigned yet, and units that stand apart from the names."""

    names: Sequence[str]
    free: Sequence[str]
    units: Mapping[str, str]
    source: str
    required: Sequence[TestQuantity]

    def recognise(self, quantity: TestQuantity) -> ColumnChoice | None:
        claims = [
            (name, unit) for name in self.free for unit in [self._unit(quantity, name)] if unit is not None
        ]
        fitting = [(name, unit) for name, unit in claims if quantity_of(unit) == quantity]
        # A column that is called just Force is the force, whatever Force of cell 2 is.
        fitting = [each for each in fitting if is_plain(quantity, each[0])] or fitting
        if len(fitting) > 1:
            first, second = fitting[0][0], fitting[1][0]
            raise RecordError(
                f"{self.source}: columns '{first}' and '{second}' both look like the {quantity}; "
                f"say which one to use with --column {quantity}=COLUMN:UNIT"
            )
        if fitting:
            name, unit = fitting[0]
            return ColumnChoice(column=name, unit=unit, factor=factor_to_si(unit, quantity, context=name))
        for name, unit in claims:
            if self._is_weak(quantity, name) or self._claimed_by_another(quantity, name):
                continue
            if quantity_of(unit) is None:
                problem = f"has the unknown unit '{unit}'" if unit else "does not say its unit"
                raise UnitError(
                    f"{self.source}: column '{name}' {problem} ({known_units(quantity)} are known); rename it, "
                    f"for example to '{_EXAMPLE[quantity]}', or give the unit with --column "
                    f"{quantity}={name}:{next(iter(FACTORS[quantity]))}"
                )
            factor_to_si(unit, quantity, context=f"{self.source}: column '{name}'")
        if quantity in self.required:
            raise RecordError(f"{self.source}: {self._without(quantity)}")
        return None

    def _without(self, quantity: TestQuantity) -> str:
        unit = next(iter(FACTORS[quantity]))
        if tuple(self.names) == numbered_names(len(self.names)):
            return (
                "the columns have no names; add a header line such as t_s,displacement_m,force_n, or say by its "
                f"number which column is the {quantity}, as in --column {quantity}=1:{unit}"
            )
        listed = ", ".join(f"'{name}'" for name in self.names)
        return (
            f"no column for the {quantity} among {listed}; rename one, for example to '{_EXAMPLE[quantity]}', or say "
            f"which it is with --column {quantity}=COLUMN:{unit}"
        )

    def _is_weak(self, quantity: TestQuantity, name: str) -> bool:
        """Whether a name is no sufficient evidence for an error: one letter or several words, of an optional one."""
        return quantity not in self.required and (len(name.strip()) == 1 or not is_plain(quantity, name))

    def _claimed_by_another(self, quantity: TestQuantity, name: str) -> bool:
        return any(
            quantity_of(unit) == other
            for other in QUANTITIES
            for unit in [self._unit(other, name)]
            if other != quantity and unit is not None
        )

    def _unit(self, quantity: TestQuantity, name: str) -> str | None:
        """Unit of a column that means the quantity, of its name or stated apart; `None` if it means another one."""
        own, apart = unit_in_name(quantity, name), self.units.get(name, "")
        if own is None or not apart:
            return own
        known = [
            factor for factor in (factor_of(own, quantity), factor_of(apart, quantity)) if factor is not None
        ]
        if len(known) == 2 and known[0] != known[1]:
            raise UnitError(
                f"{self.source}: column '{name}' says '{own}' in its name and '{apart}' below it; give the unit "
                f"with --column {quantity}={name}:UNIT"
            )
        return own if quantity_of(own) is not None else apart


def guess_columns(
    names: Sequence[str], *, units: Mapping[str, str], source: str
) -> tuple[dict[TestQuantity, ColumnChoice], dict[TestQuantity, str]]:
    """The columns that can be told by name, with common symbols of units, and why others cannot be told."""
    named = _Names(names=names, free=names, units=units, source=source, required=REQUIRED)
    chosen: dict[TestQuantity, ColumnChoice] = {}
    doubts: dict[TestQuantity, str] = {}
    for quantity in QUANTITIES:
        try:
            choice = named.recognise(quantity)
        except MrworkError as error:
            doubts[quantity] = str(error).removeprefix(f"{source}: ")
        else:
            if choice is not None:
                symbols = FACTORS[quantity].items()
                unit = next(symbol for symbol, factor in symbols if factor == choice.factor)
                chosen[quantity] = replace(choice, unit=unit)
    return chosen, doubts


def _quantity(name: str) -> TestQuantity:
    for quantity in QUANTITIES:
        if quantity == name:
            return quantity
    raise SettingError(
        f"'{name}' is not a quantity of a damper test; use one of {', '.join((*QUANTITIES, COMMAND))}"
    )


def _parse_specification(quantity: TestQuantity, specification: str) -> tuple[str, str, float]:
    column, colon, unit = specification.rpartition(":")
    if not colon or not column.strip() or not unit.strip():
        raise SettingError(
            f"column for the {quantity} is '{specification}'; expected COLUMN:UNIT, "
            f"such as {_EXAMPLE[quantity].partition('_')[0]}:{next(iter(FACTORS[quantity]))}"
        )
    factor = factor_to_si(unit, quantity, context=f"column option {quantity}={specification}")
    return column.strip(), unit.strip(), factor


def _find(column: str, names: Sequence[str], source: str) -> str:
    """Return the one name equal to `column`, or else the one equal except for case."""
    equal = [name for name in names if name == column]
    alike = equal or [name for name in names if name.casefold() == column.casefold()]
    if len(alike) == 1:
        return alike[0]
    listed = ", ".join(f"'{name}'" for name in names)
    if alike:
        raise RecordError(f"{source}: the column name '{column}' occurs {len(alike)} times; make it unique")
    raise RecordError(f"{source}: there is no column '{column}'; the columns are {listed}")
