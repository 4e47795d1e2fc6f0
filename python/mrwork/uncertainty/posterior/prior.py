"""Prior densities of single parameters.

The default prior is uniform over the bounds, on the parameter's own scale: in the logarithm where the model declares
it. Densities are of the physical value, written on the array API for NumPy and JAX.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, log, pi
from typing import Any, Protocol

from mrwork.arguments import checked
from mrwork.errors import SettingError

# NumPy or JAX, as in `coordinates`.
Array = Any

_HALF_LOG_2_PI = 0.5 * log(2.0 * pi)


class Prior(Protocol):
    """A prior density of one parameter."""

    def log_density(self, value: Array) -> Array:
        """Log density of each value, of the same shape; -inf outside the support."""


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Normal:
    """Normal about `mean` with standard `deviation`."""

    mean: float
    deviation: float

    def __post_init__(self) -> None:
        """Refuse a deviation that is not positive."""
        _check(self.deviation > 0.0, "normal", "MEAN:DEVIATION with a positive deviation")

    def log_density(self, value: Array) -> Array:
        """Log density of each value."""
        return -0.5 * ((value - self.mean) / self.deviation) ** 2 - log(self.deviation) - _HALF_LOG_2_PI


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Lognormal:
    """Lognormal about `median`, with the standard `deviation` of the natural logarithm."""

    median: float
    deviation: float

    def __post_init__(self) -> None:
        """Refuse a median or deviation that is not positive."""
        _check(
            self.median > 0.0 and self.deviation > 0.0, "lognormal", "MEDIAN:DEVIATION_OF_LOG, both positive"
        )

    def log_density(self, value: Array) -> Array:
        """Log density of each value."""
        xp = value.__array_namespace__()
        positive = value > 0.0
        logarithm = xp.log(xp.where(positive, value, 1.0))
        deviations = (logarithm - log(self.median)) / self.deviation
        density = -0.5 * deviations**2 - log(self.deviation) - _HALF_LOG_2_PI - logarithm
        return xp.where(positive, density, -xp.inf)


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Uniform:
    """Uniform in the value between two limits, regardless of the scale of the parameter."""

    lower: float
    upper: float

    def __post_init__(self) -> None:
        """Refuse limits that are reversed."""
        _check(self.lower < self.upper, "uniform", "LOWER:UPPER with the lower limit first")

    def log_density(self, value: Array) -> Array:
        """Log density of each value."""
        xp = value.__array_namespace__()
        inside = (value >= self.lower) & (value <= self.upper)
        return xp.where(inside, -log(self.upper - self.lower), -xp.inf)


_KINDS: dict[str, Callable[[float, float], Prior]] = {
    "normal": lambda mean, deviation: Normal(mean=mean, deviation=deviation),
    "lognormal": lambda median, deviation: Lognormal(median=median, deviation=deviation),
    "uniform": lambda lower, upper: Uniform(lower=lower, upper=upper),
}


def parse_prior(text: str) -> tuple[str, Prior]:
    """Parse `NAME=KIND:NUMBER:NUMBER`, such as `k_w=normal:650:50`, into name and prior.

    Raises
    ------
    SettingError
        Where the text has another form, or its numbers define no density.

    Examples
    --------
    >>> parse_prior("k_w=normal:650:50")
    ('k_w', Normal(mean=650.0, deviation=50.0))
    """
    name, equals, rest = text.partition("=")
    kind, *numbers = rest.split(":")
    try:
        first, second = (float(number) for number in numbers)
    except ValueError:
        first = second = float("nan")
    if not (name and equals) or kind not in _KINDS or not (isfinite(first) and isfinite(second)):
        raise SettingError(
            f"a prior is {text!r}; give NAME=normal:MEAN:DEVIATION, NAME=lognormal:MEDIAN:DEVIATION_OF_LOG or "
            "NAME=uniform:LOWER:UPPER"
        )
    return name, _KINDS[kind](first, second)


def _check(fine: bool, kind: str, expected: str) -> None:
    if not fine:
        raise SettingError(f"a {kind} prior was given numbers that make no density; give {expected}")
