"""Quantiles of errors for the next test, from the errors of several."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError


def pooled_quantile(scores: Sequence[NDArray[np.float64]], level: float) -> float:
    """What a share `level` of the errors stays below, each test weighing the same however many errors it has."""
    values, share = _pooled(scores)
    return float(values[min(int(np.searchsorted(share, level * (1.0 - 1e-12))), values.size - 1)])


def next_test_quantile(scores: Sequence[NDArray[np.float64]], level: float) -> float:
    """What a share `level` of the errors of one more test stays below, as far as the given ones tell.

    A new test may be worse than all known ones, the fewer there are the more so. So each in turn is taken for the new
    one: the pooled quantile of the others that would have covered `level` of the errors of tests so left out, on
    average, is the one that is taken of them all. (The bound of hierarchical conformal prediction, Lee, Barber and
    Willett, JRSS B 87, 2025, holds for every distribution, but is infinite for fewer than nine tests at 90 %.) A single
    test tells nothing of the next: its own quantile.

    Raises
    ------
    SettingError
        Where the level is not between 0 and 1.
    """
    if not 0.0 < level < 1.0:
        raise SettingError(f"the level of a band lies between 0 and 1, got {level:g}")
    if len(scores) == 1:
        return pooled_quantile(scores, level)
    needed = []
    for index, own in enumerate(scores):
        values, share = _pooled([*scores[:index], *scores[index + 1 :]])
        # The level of the others' quantile at which each of its errors comes to lie inside.
        below = np.searchsorted(values, own, side="left")
        needed.append(np.concatenate([[0.0], share])[below] + 1e-12)
    return pooled_quantile(scores, min(pooled_quantile(needed, level), 1.0))


def _pooled(scores: Sequence[NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """All errors in order, and the share of weight up to each."""
    values = np.concatenate(scores)
    weights = np.concatenate([np.full(each.size, 1.0 / (each.size * len(scores))) for each in scores])
    order = np.argsort(values, kind="stable")
    return values[order], np.cumsum(weights[order])
