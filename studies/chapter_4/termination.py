"""Generation at which the hypothesis test is expected to end a search, from the decay of its misfit."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mrwork.search import first_improvement, threshold
from studies.former.arrays import Floats


class ExpectedTermination(NamedTuple):
    """Generation at which the test is expected to stop, and the probability of this generation."""

    generation: int | None
    likelihood: float


def expected_termination(
    best: Floats, confidence: float = 0.95, *, floor: float = 0.0
) -> ExpectedTermination:
    """Where an exponential decay fitted to the trace meets the threshold (in the manner of thesis table 4.4).

    Fits `ln(e_g - floor) = a - lambda (g - g0)` by least squares over the generations from the first improvement on,
    and finds the first `n` with `(1 - q^n) / (n (1 - q)) <= 1/ln(1/a_s)`, `q = exp(-lambda)`: the test's own statistic
    on the fitted curve. The likelihood is our definition: the probability that the rate, normal about its estimate with
    its standard error, lies among those that end at this same generation. It is 1 for an exact exponential.

    `(None, 0.0)` where fewer than three generations are above the floor or the fitted curve does not fall.
    """
    limit = threshold(confidence)
    g0 = int(first_improvement(best))
    excess = best[g0:] - floor
    age = np.flatnonzero((excess > 0.0) & np.isfinite(excess))
    if age.size < 3:
        return ExpectedTermination(None, 0.0)
    logarithm = np.log(excess[age])
    centred = age - age.mean()
    rate = -float(centred @ logarithm) / float(centred @ centred)
    residual = logarithm - logarithm.mean() + rate * centred
    deviation = math.sqrt(float(residual @ residual) / (age.size - 2) / float(centred @ centred))
    # A slope that is zero within rounding is no decay.
    if rate <= 1e-12:
        return ExpectedTermination(None, 0.0)
    length = _generations_to(limit, rate)
    slow, fast = _rate_to(limit, length), _rate_to(limit, length - 1)
    return ExpectedTermination(g0 + length - 1, _normal_between(slow, fast, mean=rate, deviation=deviation))


def _mean_decay(rate: float, length: float) -> float:
    """Mean of `exp(-rate k)` over k = 0 ... length - 1."""
    return math.expm1(-rate * length) / (math.expm1(-rate) * length)


def _generations_to(limit: float, rate: float) -> int:
    """Fewest generations whose mean decay is at most `limit`; the mean falls with length."""
    above, below = 0, 1
    while _mean_decay(rate, below) > limit:
        above, below = below, 2 * below
    while below - above > 1:
        middle = (above + below) // 2
        if _mean_decay(rate, middle) > limit:
            above = middle
        else:
            below = middle
    return below


def _rate_to(limit: float, length: int) -> float:
    """Slowest decay that meets `limit` within `length` generations; `inf` where even a drop to 0 does not."""
    if length * limit <= 1.0:
        return math.inf
    slow, fast = 1e-15, 1.0
    while _mean_decay(fast, length) > limit:
        fast *= 2.0
    for _ in range(80):
        middle = 0.5 * (slow + fast)
        if _mean_decay(middle, length) > limit:
            slow = middle
        else:
            fast = middle
    return fast


def _normal_between(lower: float, upper: float, *, mean: float, deviation: float) -> float:
    """Probability of [lower, upper) under a normal distribution; 1 where its deviation is only rounding."""
    # The residual of an exact exponential is rounding error.
    if deviation <= 1e-12 * mean:
        return 1.0
    scale = deviation * math.sqrt(2.0)
    return 0.5 * (math.erf((upper - mean) / scale) - math.erf((lower - mean) / scale))
