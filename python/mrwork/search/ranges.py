"""Settings out of range are refused by name."""

from __future__ import annotations

from collections.abc import Mapping

from mrwork.errors import SettingError


def check_ranges(ranges: Mapping[str, tuple[float | None, float, float]]) -> None:
    """Refuse the first setting whose value is not in [lower, upper]; `None` is a rule that is off.

    Parameters
    ----------
    ranges
        Name to (value, lower, upper).

    Raises
    ------
    SettingError
        Naming the setting, its range and what came.
    """
    for name, (value, lower, upper) in ranges.items():
        # Written so that a NaN is refused.
        if value is not None and not lower <= value <= upper:
            raise SettingError(f"`{name}` lies between {lower} and {upper}, got {value}")
