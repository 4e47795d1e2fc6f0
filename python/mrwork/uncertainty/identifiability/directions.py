"""Directions in the space of parameters, in words: what goes up with what, and what the data see instead."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from mrwork.identification.fit import Change

# Shares smaller than this of the largest are rounding, or nothing to speak of.
_SPOKEN = 0.03
# An exponent this close to a fraction of small numbers is one.
_SIMPLE = 2e-3
_LARGEST_DENOMINATOR = 2
_LARGEST_EXPONENT = 3


def changes_along(
    direction: NDArray[np.float64], names: Sequence[str], of_range: Sequence[bool]
) -> tuple[Change, ...]:
    """Changes along a direction, shape (n_params,), in shares of each parameter's scale.

    The first that is named goes up by 1 %; parameters that hardly change are left out.
    """
    spoken = np.flatnonzero(np.abs(direction) > _SPOKEN * np.max(np.abs(direction)))
    unit = direction / direction[spoken[0]]
    return tuple(
        Change(name=names[index], percent=float(unit[index]), of_range=of_range[index])
        for index in map(int, spoken)
    )


def sparse_basis(null: NDArray[np.float64]) -> NDArray[np.float64]:
    """A basis of the same space as the rows of `null`, shape (n_directions, n_params), with few parameters in each.

    Gauss-Jordan elimination with pivots: each row has one parameter to itself.
    """
    rows = np.array(null)
    pivots: list[int] = []
    for index in range(len(rows)):
        size = np.abs(rows[index])
        size[pivots] = 0.0
        pivots.append(int(np.argmax(size)))
        rows[index] /= rows[index, pivots[-1]]
        others = np.delete(np.arange(len(rows)), index)
        rows[others] -= np.outer(rows[others, pivots[-1]], rows[index])
    return np.where(np.abs(rows) > _SPOKEN * np.max(np.abs(rows), axis=1, keepdims=True), rows, 0.0)


def told_combinations(changes: Sequence[Change], *, within: float = _SIMPLE) -> tuple[str, ...]:
    """Products and ratios of two parameters that stay as they are along a direction, where their exponents are simple.

    Along `d ln p_i = v_i` the product `p_i^a p_j^b` stays where `a v_i + b v_j = 0`. Each parameter is joined to the
    first before it that suits, exponents simple `within` this share.
    """
    if any(change.of_range for change in changes):
        return ()
    found = []
    for number, second in enumerate(changes):
        joined = (_combination(first, second, within) for first in changes[:number])
        found += list(filter(None, joined))[:1]
    return tuple(found)


def _combination(first: Change, second: Change, within: float) -> str:
    """As in "alpha A", "gamma/beta", "alpha^2 A"; empty where no simple exponents do."""
    ratio = first.percent / second.percent
    simple = Fraction(ratio).limit_denominator(_LARGEST_DENOMINATOR)
    power, other = simple.denominator, abs(simple.numerator)
    if other == 0 or other > _LARGEST_EXPONENT or abs(float(simple) - ratio) > within * abs(ratio):
        return ""
    return f"{_power(first.name, power)}{'/' if ratio > 0 else ' '}{_power(second.name, other)}"


def _power(name: str, exponent: int) -> str:
    return name if exponent == 1 else f"{name}^{exponent}"


def listed(parts: Sequence[str]) -> str:
    """As in "a, b and c"."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
