"""Which column of a table is time and which the acceleration of the ground: by name with unit, or as stated."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from mrwork.errors import RecordError, SettingError, UnitError
from mrwork.motions.formats.format import Stated
from mrwork.units import factor_of, factor_to_si, known_units

# "ground_accel_mps2", "Acc (g)", "a_mps2", "xg_ddot"; "t_s", "Time [ms]", "time".
_ACCELERATION: Final = re.compile(r"(ground[\s_-]*)?(a|acc|accel|acceleration|ag|a_g|xg_ddot)", re.IGNORECASE)
_TIME: Final = re.compile(r"\s*(?:t|time)(?:[\s_,:/(\[]+([a-z]+)[)\]]?)?\s*", re.IGNORECASE)
_SECONDS: Final = ("sec", "secs", "second", "seconds")


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column, and the factor from its unit to SI."""

    name: str
    factor: float


def acceleration_column(names: Sequence[str], stated: Stated, *, source: str) -> Column:
    """Column of the acceleration.

    Raises
    ------
    RecordError
        No column is it, or several may be.
    UnitError
        Neither its name nor the caller says the unit.
    SettingError
        The unit stated is another than that of the name.
    """
    listed = ", ".join(f"'{name}'" for name in names)
    if stated.column is None:
        found = [name for name in names if _is_acceleration(name)]
    else:
        found = [name for name in names if name.strip().casefold() == stated.column.strip().casefold()]
    if len(found) != 1:
        how_many = f"{len(found)} columns are" if found else "no column is"
        what = "the acceleration" if stated.column is None else f"'{stated.column}'"
        raise RecordError(
            f"{source}: {how_many} {what} among {listed}; name one with `column`, or call it a_mps2 in the file"
        )
    (name,) = found
    unit = _unit_in(name)
    if unit is None and stated.unit is None:
        raise UnitError(
            f"{source}: column '{name}' does not say its unit; state it as `unit`, one of {known_units('acceleration')}"
        )
    factor = factor_to_si(stated.unit or unit or "", "acceleration", context=f"{source}: `unit`")
    if unit is not None and factor != factor_of(unit, "acceleration"):
        raise SettingError(
            f"{source}: `unit` is '{stated.unit}' where column '{name}' says {unit}; leave it out"
        )
    return Column(name=name, factor=factor)


def time_column(names: Sequence[str], *, source: str) -> Column | None:
    """Column of time, `None` where there is none; one without a unit is in seconds.

    Raises
    ------
    RecordError
        Several columns may be it.
    """
    found = [(name, match[1] or "s") for name in names for match in [_TIME.fullmatch(name)] if match]
    if len(found) > 1:
        raise RecordError(
            f"{source}: columns '{found[0][0]}' and '{found[1][0]}' both look like time; rename one"
        )
    if not found:
        return None
    name, unit = found[0]
    unit = "s" if unit.casefold() in _SECONDS else unit
    context = f"{source}: column '{name}'"
    return Column(name=name, factor=factor_to_si(unit, "time", context=context))


def are_named(names: Sequence[str]) -> bool:
    """Tell whether words are names of the columns that a table of a ground motion has."""
    return any(_is_acceleration(name) for name in names) and all(
        _is_acceleration(name) or _TIME.fullmatch(name) for name in names
    )


def _is_acceleration(name: str) -> bool:
    unit = _unit_in(name)
    stem = (
        name.strip() if unit is None else name.strip().removesuffix(")").removesuffix("]").removesuffix(unit)
    )
    return _ACCELERATION.fullmatch(stem.rstrip(" _-,:([")) is not None


def _unit_in(name: str) -> str | None:
    """Unit of acceleration that ends a column's name, such as ``a_mps2``, ``Acc (cm/s^2)`` or ``EW [g]``.

    ``a_g`` does not count as an acceleration in g: it is as often the acceleration of the ground in another unit.
    """
    text = name.strip()
    if text.casefold() in ("a_g", "ag"):
        return None
    bracketed = re.search(r"[(\[]([^)\]]*)[)\]]$", text)
    if bracketed:
        return bracketed[1].strip() if factor_of(bracketed[1], "acceleration") is not None else None
    for separator in re.finditer(r"[\s_\-,:]+", text):
        rest = text[separator.end() :]
        if factor_of(rest, "acceleration") is not None:
            return rest
    return None
