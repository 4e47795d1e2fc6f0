"""Sine, cosine and angle of numbers that may be cells, as operations of the core.

An angle is taken off whole quarters of a turn, in three parts that are rounded once each, and the rest, at most an
eighth of a turn, goes into a polynomial; for the angle of a point a quotient of at most 7/16 does. Coefficients are
those of fdlibm (Sun Microsystems, 1993). In the core the error is about a unit in the last place, of an angle beyond a
million radians 4e-16 (to 1e10 rad); beyond 1e15 rad there is no sine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from mrwork.base import recording as rec
from mrwork.base.recording import Cell, put

# pi/2 as the sum of parts, of which the first two have 33 bits, so that their products with whole numbers up to 2^20
# are exact.
_QUARTER: Final = 1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21
_SINE: Final = (
    -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04,
    2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10,
)  # fmt: skip
_COSINE: Final = (
    4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05,
    -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11,
)  # fmt: skip
_ANGLE: Final = (
    3.33333333333329318027e-01, -1.99999999998764832476e-01, 1.42857142725034663711e-01,
    -1.11111104054623557880e-01, 9.09088713343650656196e-02, -7.69187620504482999495e-02,
    6.66107313738753120669e-02, -5.83357013379057348645e-02, 4.97687799461593236017e-02,
    -3.65315727442169155270e-02, 1.62858201153657823623e-02,
)  # fmt: skip
# Beyond, neighbouring numbers are an eighth of a radian apart.
_LARGEST: Final = 1e15
# Quotients from which the angle is counted from arctan(1/2) and from pi/4, and these with what they lack to be exact.
_MIDDLE, _HIGH = 7.0 / 16.0, 11.0 / 16.0
_OF_HALF: Final = (4.63647609000806093515e-01, 2.26987774529616870924e-17)
_OF_ONE: Final = (7.85398163397448278999e-01, 3.06161699786838301793e-17)
_HALF_TURN: Final = (math.pi, 1.22464679914735317720e-16)


def _series(z: Any, coefficients: Sequence[float]) -> Any:
    found: Any = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        found = put("multiply_add", found, z, coefficient)
    return found


def _reduced(a: Any) -> tuple[Any, Any, Any]:
    """Number of whole quarters of a turn, what is left, and what that lacks to be exact."""
    quarters = put("rint", put("multiply", a, 2.0 / math.pi))
    first, second, third = _QUARTER
    exact = put("multiply_add", quarters, -first, a)
    near = put("multiply_add", quarters, -second, exact)
    beside = put("multiply_add", quarters, -second, put("subtract", exact, near))
    beside = put("multiply_add", quarters, -third, beside)
    left = put("add", near, beside)
    return quarters, left, put("add", put("subtract", near, left), beside)


def _of_quarters(quarters: Any, left: Any, lacking: Any) -> Any:
    """Sine of quarters of a turn and what is left of an angle."""
    z = put("multiply", left, left)
    odd = put("add", left, put("multiply_add", put("multiply", z, left), _series(z, _SINE), lacking))
    # 1 - z/2 is rounded, and what that leaves out is added with the series.
    half = put("multiply", 0.5, z)
    near = put("subtract", 1.0, half)
    rest = put("subtract", put("subtract", 1.0, near), half)
    rest = put("subtract", rest, put("multiply", left, lacking))
    even = put("add", near, put("multiply_add", put("multiply", z, z), _series(z, _COSINE), rest))
    # Of 4 quarters: 1 and 3 take the cosine, 2 and 3 the other sign.
    turn = put("subtract", quarters, put("multiply", 4.0, rec.floor(put("multiply", 0.25, quarters))))
    is_odd = put("equal", put("absolute", put("subtract", turn, 2.0)), 1.0)
    found = rec.choose(is_odd, even, odd)
    return rec.choose(rec.less(turn, 1.5), found, put("negative", found))


def sine(a: Any) -> Any:
    """Sine of an angle [rad]."""
    if not isinstance(a, Cell):
        return math.sin(a) if math.isfinite(a) else math.nan
    found = rec.choose(rec.less(put("absolute", a), _LARGEST), _of_quarters(*_reduced(a)), math.nan)
    # A zero keeps its sign.
    return rec.choose(put("equal", a, 0.0), a, found)


def cosine(a: Any) -> Any:
    """Cosine of an angle [rad]."""
    if not isinstance(a, Cell):
        return math.cos(a) if math.isfinite(a) else math.nan
    quarters, left, lacking = _reduced(a)
    found = _of_quarters(put("add", quarters, 1.0), left, lacking)
    return rec.choose(rec.less(put("absolute", a), _LARGEST), found, math.nan)


def angle(y: Any, x: Any) -> Any:
    """Angle of a point [rad], from -pi to pi."""
    if not isinstance(y, Cell) and not isinstance(x, Cell):
        return math.atan2(y, x)
    high, wide = put("absolute", y), put("absolute", x)
    is_steep = rec.less(wide, high)
    small, large = rec.choose(is_steep, wide, high), rec.choose(is_steep, high, wide)
    infinite = put("equal", large, math.inf)
    small = rec.choose(infinite, put("equal", small, math.inf), small)
    large = rec.choose(rec.either(infinite, put("equal", large, 0.0)), 1.0, large)
    is_middle, is_high = (rec.at_most(put("multiply", bound, large), small) for bound in (_MIDDLE, _HIGH))
    above = rec.choose(
        is_high,
        put("subtract", small, large),
        rec.choose(is_middle, put("subtract", put("multiply", 2.0, small), large), small),
    )
    below = rec.choose(
        is_high,
        put("add", large, small),
        rec.choose(is_middle, put("add", put("multiply", 2.0, large), small), large),
    )
    t = put("divide", above, below)
    base, lacking = (
        rec.choose(is_high, one, rec.choose(is_middle, half, 0.0))
        for one, half in zip(_OF_ONE, _OF_HALF, strict=True)
    )
    z = put("multiply", t, t)
    bent = put("multiply", put("multiply", t, z), _series(z, _ANGLE))
    found = put("subtract", base, put("subtract", put("subtract", bent, lacking), t))
    is_behind = rec.less(put("copysign", 1.0, x), 0.0)
    turned, rest = (rec.choose(is_steep, 0.5 * part, rec.choose(is_behind, part, 0.0)) for part in _HALF_TURN)
    is_same = put("equal", is_steep, is_behind)
    found = put("add", turned, put("add", rec.choose(is_same, found, put("negative", found)), rest))
    return rec.where_number(x, rec.where_number(y, put("copysign", found, y)))
