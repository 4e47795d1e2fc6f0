"""exp, ln and a general power of branch-free arithmetic, so that a compiler can put candidates side by side.

Every stepper of the study draws on these, so a power costs all of them the same: some 50 operations, as in the core.
Good to 1e-12, for arguments of moderate size.
"""

from __future__ import annotations

import math

import numba
import numpy as np

_MAGIC = 6755399441055744.0  # 1.5 * 2^52: adding it rounds to a whole number, which the low bits then hold
_EXPONENT_OFFSET = 4503599627370496.0  # 2^52
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10

F2, F3, F4, F5, F6, F7, F8, F9, F10, F11, F12 = (1.0 / math.factorial(k) for k in range(2, 13))
G3, G5, G7, G9, G11, G13, G15, G17, G19 = (2.0 / k for k in range(3, 20, 2))


@numba.njit(inline="always", error_model="numpy")
def exp(x: float) -> float:
    """e^x, for -700 < x < 700."""
    shifted = x * 1.4426950408889634 + _MAGIC
    k = shifted - _MAGIC
    r = x - k * _LN2_HIGH - k * _LN2_LOW
    # Estrin's order: pairs, then pairs of pairs, so that a lane does not wait for one long chain.
    r2 = r * r
    r4 = r2 * r2
    low = (1.0 + r) + r2 * (F2 + r * F3)
    middle = (F4 + r * F5) + r2 * (F6 + r * F7)
    high = ((F8 + r * F9) + r2 * (F10 + r * F11)) + r4 * F12
    series = low + r4 * (middle + r4 * high)
    scale = np.int64((np.float64(shifted).view(np.int64) + 1023) << 52).view(np.float64)
    return series * scale


@numba.njit(inline="always", error_model="numpy")
def ln(x: float) -> float:
    """Natural logarithm, for normal x > 0."""
    bits = np.float64(x).view(np.int64)
    # Centre the mantissa on 1: between sqrt(1/2) and sqrt(2).
    bits = bits + (0x3FF0000000000000 - 0x3FE6A09E667F3BCD)
    e = np.int64((bits >> 52) | 0x4330000000000000).view(np.float64) - (_EXPONENT_OFFSET + 1023.0)
    m = np.int64((bits & 0x000FFFFFFFFFFFFF) + 0x3FE6A09E667F3BCD).view(np.float64)
    s = (m - 1.0) / (m + 1.0)
    square = s * s
    fourth = square * square
    low = (G3 + square * G5) + fourth * (G7 + square * G9)
    high = ((G11 + square * G13) + fourth * (G15 + square * G17)) + fourth * fourth * G19
    series = low + fourth * fourth * high
    return e * 0.6931471805599453 + (2.0 * s + s * square * series)


@numba.njit(inline="always", error_model="numpy")
def power(x: float, n: float) -> float:
    """x^n for x >= 0 and n up to 8; numbers beyond 1e-30 and 1e30 count as those."""
    return exp(n * ln(min(max(x, 1e-30), 1e30)))
