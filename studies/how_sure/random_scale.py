"""Per-test random effects: each test's errors are Gaussian about its own size, sizes lognormal from test to test."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm, t

# Quantiles of the size over which the mixture is averaged.
_NODES = (np.arange(400) + 0.5) / 400


def next_test_half_width(sizes: np.ndarray, level: float) -> float:
    """Half width that holds `level` of the errors of one more test, from the root mean squares of K tests.

    The size of the next is exp of Student's t with K - 1 degrees of freedom about the mean logarithm, its spread
    widened by sqrt(1 + 1/K): the prediction of a normal sample.
    """
    logs = np.log(sizes)
    spread = np.std(logs, ddof=1) * np.sqrt(1.0 + 1.0 / len(logs))
    size = np.exp(np.mean(logs) + spread * t.ppf(_NODES, len(logs) - 1))
    return float(
        brentq(lambda half: np.mean(2.0 * norm.cdf(half / size) - 1.0) - level, 1e-6, 100.0 * sizes.max())
    )
