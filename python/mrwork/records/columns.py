"""Assignment of file columns to quantities: by column names with units, or by an explicit mapping."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal, get_args

from mrwork.errors import RecordError, SettingError, UnitError
from mrwork.units import FACTORS, factor_to_si, known_units, quantity_of

TestQuantity = Literal["time", "displacement", "velocity", "force", "current", "voltage"]

QUANTITIES: Final[tuple[TestQuantity, ...]] = get_args(TestQuantity)
REQUIRED: Final[tuple[TestQuantity, ...]] = ("time", "displacement", "force")

# Set point of the driver, in amperes or volts: the unit decides.
_COMMAND: Final = frozenset({"command", "cmd", "setpoint"})
# `v` and `u` have different meanings on different rigs; the unit after them decides.
_STEMS: Final[Mapping[TestQuantity, frozenset[str]]] = {
    "time": frozenset({"time", "t"}),
    "displacement": frozenset({"displacement", "disp", "stroke", "position", "x", "u"}),
    "velocity": frozenset({"velocity", "vel", "v"}),
    "force": frozenset({"force", "load", "f"}),
    "current": frozenset({"current", "i", *_COMMAND}),
    "voltage": frozenset({"voltage", "volt", "v", "u", *_COMMAND}),
}
_EXAMPLE: Final[Mapping[TestQuantity, str]] = {
    "time": "t_s",
    "displacement": "displacement_mm",
    "velocity": "velocity_mps",
    "force": "force_N",
    "current": "current_A",
    "voltage": "voltage_V",
}
# A word, optionally followed by a separator and a unit: force_kN, Force (kN), "v [m/s]", disp/mm.
_NAME: Final = re.compile(r"\s*([A-Za-z]+)(?:[\s_\-/,:.(\[]+(.*?)[)\]]?)?\s*")


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnChoice:
    """Column of a quantity, and the factor from its unit to SI."""

    column: str
    factor: float


def parse_column_option(option: str) -> tuple[TestQuantity, str]:
    """Split ``"force=F:kN"`` into ``("force", "F:kN")``, checking quantity and unit.

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
    quantity = _quantity(name.strip())
    _parse_specification(quantity, specification)
    return quantity, specification.strip()


def choose_columns(
    names: Sequence[str], columns: Mapping[str, str] | None, *, source: str
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

    Raises
    ------
    RecordError
        A required quantity has no column, a mapped column does not exist, or two columns match one quantity.
    UnitError
        A required column has no unit, or a unit of another quantity.
    SettingError
        The mapping is malformed.
    """
    chosen: dict[TestQuantity, ColumnChoice] = {}
    for name, specification in (columns or {}).items():
        quantity = _quantity(name)
        column, factor = _parse_specification(quantity, specification)
        chosen[quantity] = ColumnChoice(column=_find(column, names, source), factor=factor)
    taken = {choice.column for choice in chosen.values()}
    free = [name for name in names if name not in taken]
    for quantity in QUANTITIES:
        if quantity not in chosen:
            choice = _recognise(quantity, free, names, source)
            if choice is not None:
                chosen[quantity] = choice
    return chosen


def _recognise(
    quantity: TestQuantity, free: Sequence[str], names: Sequence[str], source: str
) -> ColumnChoice | None:
    claims = [(name, unit) for name in free for unit in [_unit_of(quantity, name)] if unit is not None]
    fitting = [(name, unit) for name, unit in claims if quantity_of(unit) == quantity]
    if len(fitting) > 1:
        first, second = fitting[0][0], fitting[1][0]
        raise RecordError(
            f"{source}: columns '{first}' and '{second}' both look like the {quantity}; "
            f"say which one to use with --column {quantity}=COLUMN:UNIT"
        )
    if fitting:
        name, unit = fitting[0]
        return ColumnChoice(column=name, factor=factor_to_si(unit, quantity, context=name))
    # A single letter is not sufficient evidence for an error unless the quantity is required.
    for name, unit in claims:
        weak = quantity not in REQUIRED and len(name.strip()) == 1
        if weak or _claimed_by_another(quantity, name):
            continue
        if quantity_of(unit) is None:
            problem = f"has the unknown unit '{unit}'" if unit else "does not say its unit"
            raise UnitError(
                f"{source}: column '{name}' {problem} ({known_units(quantity)} are known); rename it, "
                f"for example to '{_EXAMPLE[quantity]}', or give the unit with --column "
                f"{quantity}={name}:{next(iter(FACTORS[quantity]))}"
            )
        factor_to_si(unit, quantity, context=f"{source}: column '{name}'")
    if quantity in REQUIRED:
        listed = ", ".join(f"'{name}'" for name in names)
        raise RecordError(
            f"{source}: no column for the {quantity} among {listed}; rename one, for example to "
            f"'{_EXAMPLE[quantity]}', or say which it is with --column "
            f"{quantity}=COLUMN:{next(iter(FACTORS[quantity]))}"
        )
    return None


def _claimed_by_another(quantity: TestQuantity, name: str) -> bool:
    return any(
        quantity_of(unit) == other
        for other in QUANTITIES
        for unit in [_unit_of(other, name)]
        if other != quantity and unit is not None
    )


def _unit_of(quantity: TestQuantity, name: str) -> str | None:
    """Return the unit text of a column whose stem matches the quantity, else `None`."""
    match = _NAME.fullmatch(name)
    if match is None or match[1].casefold() not in _STEMS[quantity]:
        return None
    return (match[2] or "").strip()


def _quantity(name: str) -> TestQuantity:
    for quantity in QUANTITIES:
        if quantity == name:
            return quantity
    raise SettingError(f"'{name}' is not a quantity of a damper test; use one of {', '.join(QUANTITIES)}")


def _parse_specification(quantity: TestQuantity, specification: str) -> tuple[str, float]:
    column, colon, unit = specification.rpartition(":")
    if not colon or not column.strip() or not unit.strip():
        raise SettingError(
            f"column for the {quantity} is '{specification}'; expected COLUMN:UNIT, "
            f"such as {_EXAMPLE[quantity].partition('_')[0]}:{next(iter(FACTORS[quantity]))}"
        )
    return column.strip(), factor_to_si(unit, quantity, context=f"column option {quantity}={specification}")


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
