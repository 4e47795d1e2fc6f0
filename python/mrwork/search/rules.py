"""Settings of every optimiser: rules that end a replicate, points that are kept as elite.

**Hypothesis test** of Kwok et al. (2007). The test reads the trace `e_g` of the least misfit per generation. From the
first improvement `g0` on, the errors are taken as exponentially distributed with mean `mu`. The first and greatest of
them then belongs to the same population with probability `exp(-max(e)/mu)`; once this is below the significance
`a_s = 1 - confidence` the errors have decayed significantly and the search may end::

    mean(e_g) / max(e_g) <= 1 / ln(1/a_s)            0.334 at 95 %, 0.217 at 99 %

The exact statistic is our definition; that of the source was not available.

**Floor.** On a measured record a model error `e_inf > 0` remains however long the search is. The ratio then
tends to `e_inf / e_g0`, which is above the threshold unless the initial error is at least three times the final
one. The published test ended only one of 32 searches of 300 generations on measured damper tests (static and
normalised Bouc-Wen, two tests each, eight seeds). There are two alternatives, both our definition:

- `has_stalled`: the best misfit has not fallen by a given share for a given number of generations. By default the
  search uses it together with the published test and reports the first that applies. The same searches then ended
  after 127 to 300 generations (the limit) within 14 % of the best known error, 4 % in the median.
- `floor`: the same statistic on `e_g - floor`. With the least misfit so far as floor it measures the share of the
  attainable decay, and meets the threshold on every trace that decreases twice and then levels off. It applies
  early: on the same tests first after 4 to 23 generations (once 130), at 1.1 to 2.3 times the best known error. Use
  it only with enough `min_generations`.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import AnyNumbers, Count, NotNegative, Shape, Share, checked
from mrwork.base.values import Floats
from mrwork.errors import SettingError

# Why a search ended, in words; a search of another library has reasons of its own.
_ENDED = {
    "found_again": "once enough local minimisations had reached the best minimum",
    "max_rounds": "at the limit of local minimisations",
    "hypothesis_test": "by the hypothesis test on its decay",
    "stall": "when the best no longer improved",
    "spread": "when the population had drawn together",
    "max_generations": "at the limit of generations",
    "max_evaluations": "at the limit of simulations",
    "max_seconds": "at the limit of time",
    "target": "at the target misfit",
    "callback": "on request",
    "interrupted": "by an interrupt",
}


def ended_in_words(stop_reason: str) -> str:
    """Why a search ended, in words."""
    return _ENDED.get(stop_reason, stop_reason)


def threshold(confidence: float) -> float:
    """Value `1/ln(1/(1 - confidence))` that the statistic must not exceed."""
    if not (0.0 < confidence < 1.0 and 1.0 - confidence < 1.0):
        raise SettingError(
            f"`confidence` lies strictly between 0 and 1, got {confidence!r}; 0.95 and 0.99 are usual"
        )
    return 1.0 / math.log(1.0 / (1.0 - confidence))


def first_improvement(best: Floats) -> NDArray[np.int64]:
    """Index g0 of the first entry of each trace below its predecessor; a first finite value after `inf` counts.

    Shape (...) for traces (..., n_generations); `n_generations` where none is.
    """
    count = best.shape[-1]
    if count < 2:
        return np.full(best.shape[:-1], count, dtype=np.int64)
    improved = best[..., 1:] < best[..., :-1]
    return np.asarray(np.where(improved.any(axis=-1), np.argmax(improved, axis=-1) + 1, count))


def statistic(best: Floats, *, floor: Floats | float = 0.0) -> Floats:
    """Mean over maximum of `e_g - floor` from the first improvement on, shape (...), in (0, 1]; 1 before any decay.

    `best` is the least misfit up to each generation, shape (..., n_generations), never rising; `floor` a lower bound of
    the misfit, shape (...), of which 0 gives the published statistic.
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
    best: Floats, *, confidence: float = 0.95, floor: Floats | float = 0.0
) -> NDArray[np.bool_]:
    """Whether each trace, (..., n_generations), has decayed enough to stop at this confidence."""
    return np.asarray(statistic(best, floor=floor) <= threshold(confidence))


def has_stalled(best: Floats, *, generations: int, tolerance: float) -> NDArray[np.bool_]:
    """Whether the best misfit of each trace fell by less than the share `tolerance` in the last `generations`."""
    if best.shape[-1] <= generations:
        return np.zeros(best.shape[:-1], np.bool_)
    before, now = best[..., -1 - generations], best[..., -1]
    # As a product, so that 0 after 0 and inf after inf count as stalled.
    return np.asarray(now >= before * (1.0 - tolerance))


LARGEST_POPULATION = 1_000_000
"""Most candidates of a generation."""

# The index is the code in `Course.ended`, 0 for none. Where several rules apply, the first is reported.
REASONS = (None, "target", "max_generations", "max_evaluations", "spread", "hypothesis_test", "stall")
_CODE = {reason: code for code, reason in enumerate(REASONS)}


@checked
class StopRules:
    """Rules that end a replicate; the description of each begins with its stop reason. `None` switches a rule off.

    Parameters
    ----------
    target
        `target`: the best misfit is at or below this.
    max_generations
        `max_generations`: this number of generations has been simulated.
    max_evaluations
        `max_evaluations`: one more population could exceed this number of simulations of a replicate. The number is
        never exceeded.
    spread_tolerance
        `spread`: half the population lies within this distance (largest gene difference) of the best.
    confidence, floor_share
        `hypothesis_test`: the decay of the best misfit is significant at this confidence. The test uses the misfit
        above this share of the least misfit so far: 0 is the published statistic, 1 (our definition) measures the
        share of the attainable decay. See above.
    stall_generations, stall_tolerance
        `stall`: the best misfit has not fallen by this share within this number of generations (our definition). It
        ends searches on measured data, where the published test is rarely met.
    min_generations
        `spread`, `hypothesis_test` and `stall` do not apply before this generation.
    max_seconds
        `max_seconds`: the loop has run for this time; checked between generations. This rule alone depends on the
        machine, so it does not change the state: the loop applies it to all running replicates, and their state can
        be resumed.
    """

    target: NotNegative | None = None
    max_generations: Count = 300
    max_evaluations: Count | None = None
    spread_tolerance: Share | None = 1e-6
    confidence: float | None = 0.95
    floor_share: Share = 0.0
    stall_generations: Count | None = 80
    stall_tolerance: Share = 1e-3
    min_generations: Count = 80
    max_seconds: NotNegative | None = None

    def __post_init__(self) -> None:
        if self.confidence is not None:
            threshold(self.confidence)

    @checked
    def ended(
        self, *, trace: AnyNumbers, evaluations: NDArray[np.int64], population: Floats, best_unit: Floats
    ) -> NDArray[np.int8]:
        """Code of the rule that ends each replicate, shape (n,), 0 for none, see `Course.stop_reasons`.

        `trace` is the least misfit up to each generation, shape (n, n_generations), `evaluations` the simulations so
        far, shape (n,); `population` (n, n_population, n_params) has the best member `best_unit` (n, n_params).
        """
        ended = np.zeros(len(trace), np.int8)
        generation, best = trace.shape[1], trace[:, -1]

        def end(where: NDArray[np.bool_], reason: str) -> None:
            ended[(ended == 0) & where] = _CODE[reason]

        if self.target is not None:
            end(best <= self.target, "target")
        if generation >= self.max_generations:
            end(np.ones(len(trace), np.bool_), "max_generations")
        if self.max_evaluations is not None:
            end(evaluations + population.shape[1] > self.max_evaluations, "max_evaluations")
        if generation < self.min_generations:
            return ended
        if self.spread_tolerance is not None:
            away = np.abs(population - best_unit[:, None]).max(axis=2)
            end(np.median(away, axis=1) <= self.spread_tolerance, "spread")
        known = np.isfinite(best)
        if self.confidence is not None:
            floor = self.floor_share * np.where(known, best, 0.0)
            end(known & hypothesis_test(trace, confidence=self.confidence, floor=floor), "hypothesis_test")
        if self.stall_generations is not None:
            has_ended = has_stalled(trace, generations=self.stall_generations, tolerance=self.stall_tolerance)
            end(has_ended, "stall")
        return ended


@checked
class EliteRule:
    """Elite of a run: its best mutually distant points, which are kept as starts of a local minimisation.

    At most `count` points, with at least `distance` (largest gene difference, a share of the box; 0 allows copies)
    between any two.
    """

    count: Count = 16
    distance: Share = 0.2


def distinct_best(
    population: Annotated[Floats, Shape(("n_replicates", "n", "n_params"))],
    misfit: Annotated[AnyNumbers, Shape(("n_replicates", "n"))],
    rule: EliteRule,
) -> NDArray[np.int64]:
    """Indices of the best mutually distant members of each population, shape (n_replicates, rule.count), best first.

    Greedy selection: the best first, then the next best whose distance to all selected ones is at least that of the
    rule; padded with -1 where fewer are distant enough. Local minimisations from close points would end at the same
    minimum. Failures (`inf`) are never selected.
    """
    n_replicates, size = misfit.shape
    n_params = population.shape[2]
    order = np.argsort(misfit, axis=1, kind="stable")
    finite = np.isfinite(np.take_along_axis(misfit, order, axis=1))
    row = size * np.arange(n_replicates)
    gene = np.ascontiguousarray(population.reshape(-1, n_params).T)
    taken = np.full((n_replicates, rule.count), -1, dtype=np.int64)
    n_taken = np.zeros(n_replicates, dtype=np.int64)
    # Empty slots lie outside the cube, far from every member.
    taken_gene = np.full((n_params, n_replicates, rule.count), 9.0)
    # Vectorised over replicates: the j-th best of each.
    for j in range(int(np.count_nonzero(finite, axis=1).max(initial=0))):
        if n_taken.min() == rule.count:
            break
        member = order[:, j]
        candidate = gene[:, row + member]
        gap = np.abs(taken_gene - candidate[..., None]).max(axis=0).min(axis=1)
        enters = np.flatnonzero(finite[:, j] & (gap >= rule.distance) & (n_taken < rule.count))
        taken[enters, n_taken[enters]] = member[enters]
        taken_gene[:, enters, n_taken[enters]] = candidate[:, enters]
        n_taken[enters] += 1
    return taken
