"""Termination of a search: the hypothesis test of Kwok et al. (2007), and a stall test.

The test reads the trace `e_g` of the least misfit per generation. From the first improvement `g0`
on, the errors are taken as exponentially distributed with mean `mu`. The first and greatest of them
then belongs to the same population with probability `exp(-max(e)/mu)`; once this is below the
significance `a_s = 1 - confidence` the errors have decayed significantly and the search may end::

    mean(e_g) / max(e_g) <= 1 / ln(1/a_s)            0.334 at 95 %, 0.217 at 99 %

The exact statistic is our definition; that of the source was not available.

**Floor.** On a measured record a model error `e_inf > 0` remains however long the search is. The ratio then
tends to `e_inf / e_g0`, which is above the threshold unless the initial error is at least three times the final
one. The published test ended only one of 32 searches of 300 generations on measured damper tests (static and
normalised Bouc-Wen, two tests each, eight seeds). There are two alternatives, both our definition:

- `stalled`: the best misfit has not fallen by a given share for a given number of generations. By default the
  search uses it together with the published test and reports the first that applies. The same searches then ended
  after 127 to 300 generations (the limit) within 14 % of the best known error, 4 % in the median.
- `floor`: the same statistic on `e_g - floor`. With the least misfit so far as floor it measures the share of the
  attainable decay, and meets the threshold on every trace that decreases twice and then levels off. It applies
  early: on the same tests first after 4 to 23 generations (once 130), at 1.1 to 2.3 times the best known error. Use
  it only with enough `min_generations`.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import AnyNumbers, Shape, checked
from mrwork.errors import SettingError


class ExpectedTermination(NamedTuple):
    """Generation at which the test is expected to stop, and the probability of this generation."""

    generation: int | None
    likelihood: float


def threshold(confidence: float) -> float:
    """Value `1/ln(1/(1 - confidence))` that the statistic must not exceed."""
    if not (0.0 < confidence < 1.0 and 1.0 - confidence < 1.0):
        raise SettingError(
            f"`confidence` lies strictly between 0 and 1, got {confidence!r}; 0.95 and 0.99 are usual"
        )
    return 1.0 / math.log(1.0 / (1.0 - confidence))


def first_improvement(best: NDArray[np.float64]) -> NDArray[np.int64]:
    """Index g0 of the first entry of each trace below its predecessor; a first finite value after `inf` counts.

    Shape (...) for traces (..., n_generations); `n_generations` where none is.
    """
    count = best.shape[-1]
    if count < 2:
        return np.full(best.shape[:-1], count, dtype=np.int64)
    improved = best[..., 1:] < best[..., :-1]
    return np.asarray(np.where(improved.any(axis=-1), np.argmax(improved, axis=-1) + 1, count))


def statistic(best: NDArray[np.float64], *, floor: NDArray[np.float64] | float = 0.0) -> NDArray[np.float64]:
    """Mean over maximum of `e_g - floor` from the first improvement on.

    Parameters
    ----------
    best
        Least misfit up to each generation, shape (..., n_generations), never rising.
    floor
        Lower bound of the misfit, shape (...); 0 gives the published statistic.

    Returns
    -------
    NDArray
        Shape (...), in (0, 1]; 1 before any decay, so that no threshold is met.
    """
    g0 = first_improvement(best)[..., None]
    count = best.shape[-1]
    excess = np.where(np.arange(count) >= g0, best - np.asarray(floor)[..., None], 0.0)
    greatest = excess.max(axis=-1, keepdims=True, initial=0.0)
    decayed = greatest[..., 0] > 0.0
    # Division before the sum avoids overflow.
    total = np.sum(excess / np.where(decayed[..., None], greatest, 1.0), axis=-1)
    return np.where(decayed, total / np.maximum(count - g0[..., 0], 1), 1.0)


def hypothesis_test(
    best: NDArray[np.float64], *, confidence: float = 0.95, floor: NDArray[np.float64] | float = 0.0
) -> NDArray[np.bool_]:
    """Whether each trace, (..., n_generations), has decayed enough to stop at this confidence."""
    return np.asarray(statistic(best, floor=floor) <= threshold(confidence))


def stalled(best: NDArray[np.float64], *, generations: int, tolerance: float) -> NDArray[np.bool_]:
    """Whether the best misfit of each trace fell by less than the share `tolerance` in the last `generations`."""
    if best.shape[-1] <= generations:
        return np.zeros(best.shape[:-1], np.bool_)
    before, now = best[..., -1 - generations], best[..., -1]
    # As a product, so that 0 after 0 and inf after inf count as stalled.
    return np.asarray(now >= before * (1.0 - tolerance))


@checked
def expected_termination(
    best: Annotated[AnyNumbers, Shape(("n_generations",))], confidence: float = 0.95, *, floor: float = 0.0
) -> ExpectedTermination:
    """Where an exponential decay fitted to the trace meets the threshold (in the manner of thesis table 4.4).

    Fits `ln(e_g - floor) = a - lambda (g - g0)` by least squares over the generations from the first
    improvement on, and finds the first `n` with `(1 - q^n) / (n (1 - q)) <= 1/ln(1/a_s)`,
    `q = exp(-lambda)`: the test's own statistic on the fitted curve. The likelihood is our
    definition: the probability that the rate, normal about its estimate with its standard error,
    lies among those that end at this same generation. It is 1 for an exact exponential.

    Parameters
    ----------
    best
        Least misfit up to each generation, shape (n_generations,), never rising.
    confidence
        Of the test, between 0 and 1.
    floor
        As in `statistic`; entries at or below it are left out of the fit.

    Returns
    -------
    ExpectedTermination
        `(None, 0.0)` where fewer than three generations can be fitted or the fitted curve does not fall.
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
