"""Shared by the formulas of damper design: ranges without overflow, common shapes, roots of monotonic functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from mrwork.errors import SettingError
from mrwork.hints import Within
from mrwork.values import Floats

# From a micrometre to a hundred metres.
Length = Annotated[float, Within(least=1e-6, most=100.0)]
Viscosity = Annotated[float, Within(least=1e-6, most=1e6)]
FlowIndex = Annotated[float, Within(least=0.1, most=3.0)]
Speed = Annotated[float, Within(least=1e-9, most=1e3)]
Turns = Annotated[int, Within(least=1, most=1_000_000)]
Current = Annotated[float, Within(least=1e-6, most=1e4)]
Voltage = Annotated[float, Within(least=1e-3, most=1e6)]
# Arrays of numbers that are not negative, and what a current or a velocity may be.
Stresses = Annotated[ArrayLike, Within(least=0.0, most=1e9)]
Flows = Annotated[ArrayLike, Within(least=0.0, most=1e3)]
Fields = Annotated[ArrayLike, Within(least=0.0, most=1e9)]
Currents = Annotated[ArrayLike, Within(least=0.0, most=1e4)]
Velocities = Annotated[ArrayLike, Within(least=-1e3, most=1e3)]


def broadcast(function: str, **values: ArrayLike) -> tuple[Floats, ...]:
    """Arguments of a function as arrays of the shape to which they broadcast."""
    arrays = [np.asarray(value, dtype=np.float64) for value in values.values()]
    try:
        return tuple(np.broadcast_arrays(*arrays))
    except ValueError:
        shapes = ", ".join(f"`{name}` {array.shape}" for name, array in zip(values, arrays, strict=True))
        raise SettingError(
            f"arguments of {function} have the shapes {shapes}; give shapes that broadcast against each other"
        ) from None


_MOST_STEPS = 200
_TOLERANCE = 4.0 * np.finfo(np.float64).eps


def roots_between(function: Callable[[Floats], Floats], low: Floats, high: Floats) -> Floats:
    """Where a function is zero, element by element, between `low` and `high`; an end where it does not change sign.

    Chandrupatla's method: inverse quadratic interpolation where the function is smooth enough, bisection otherwise
    (Chandrupatla, Adv. Eng. Softw. 28(3), 1997, 145-149).
    """
    b, a = np.array(low, dtype=np.float64), np.array(high, dtype=np.float64)
    f_b, f_a = function(b), function(a)
    c, f_c = a.copy(), f_a.copy()
    share = np.full(a.shape, 0.5)
    one_signed = np.sign(f_a) == np.sign(f_b)
    best = np.where(np.abs(f_a) < np.abs(f_b), a, b)
    for _ in range(_MOST_STEPS):
        x = a + share * (b - a)
        f_x = function(x)
        same = np.sign(f_x) == np.sign(f_a)
        c, f_c = np.where(same, a, b), np.where(same, f_a, f_b)
        b, f_b = np.where(same, b, a), np.where(same, f_b, f_a)
        a, f_a = x, f_x
        best = np.where(one_signed, best, np.where(np.abs(f_a) < np.abs(f_b), a, b))
        width = np.abs(b - a)
        nearest = _TOLERANCE * np.abs(best)
        done = one_signed | (width <= 2.0 * nearest) | (f_a == 0.0) | ~np.isfinite(f_a)
        if done.all():
            break
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            xi, phi = (a - b) / (c - b), (f_a - f_b) / (f_c - f_b)
            smooth = (phi**2 < xi) & ((1.0 - phi) ** 2 < 1.0 - xi)
            quadratic = f_a / (f_b - f_a) * f_c / (f_b - f_c) + (c - a) / (b - a) * f_a / (
                f_c - f_a
            ) * f_b / (f_c - f_b)
            least = np.where(width > 0.0, nearest / width, 0.5)
        share = np.where(smooth & np.isfinite(quadratic), quadratic, 0.5)
        share = np.clip(share, np.minimum(least, 0.5), np.maximum(1.0 - least, 0.5))
    return best
