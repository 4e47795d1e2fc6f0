"""Global search of a plain model: starting points of the final least-squares fits.

By default multistart least squares: local minimisations (Levenberg-Marquardt) start from the best of many samples, in
rounds, until several of them have reached the least misfit. The rounds that are run in any case are one batch, which
takes little longer than a round, because the time steps of a record are sequential. The misfit of a hysteresis model is
smooth except for a few kinks, so a local minimisation of two hundred simulations reaches a minimum that a
population-based search only approaches in thousands. Only repeated local minimisations show whether that minimum is the
global one.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import Seed
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import ON_BOUND, Box
from mrwork.identification.fit import SearchTrace
from mrwork.identification.minimise.levenberg_marquardt import Hopeless, LocalMinima, find_minima
from mrwork.identification.objective import Objective
from mrwork.identification.progress import Found, Identifying, OnSearch
from mrwork.identification.settings import Multistart
from mrwork.search.unit_cube import Streams, latin_hypercube

# A second minimum is fitted too if its misfit is larger by this share at most, and a unit coordinate differs by more
# than `_DISTANT`.
_CLOSE = 0.01
_DISTANT = 0.05
_MOST_DISTINCT = 3
# Relative decrease of the squared misfit at which a local minimisation of the search ends; the final fit continues.
_TOLERANCE = 1e-5
# Local minimisations are given up after this number of iterations above this multiple of the least misfit.
_HOPELESS_AFTER = 12
_HOPELESS = 4.0
# In later rounds, starts from the best minimum, and the share of its parameters that are replaced.
_CROSSED = 3
_REPLACED = 0.3


@array_dataclass(repr=False)
class MultistartResult(Summarised):
    """Local minima, best first, shape (n_minima, n_params), with misfits (n_minima,), and the trace of the search."""

    theta: Floats
    misfit: Floats
    trace: SearchTrace


@array_dataclass()
class NestedFit:
    """Fit of a simpler `model` that the searched one contains.

    `starts` are points of the searched model near it, shape (n_starts, n_params). The searched model can at least
    approach the `misfit` of the simpler one, which is infinite where bounds prevent that.
    """

    model: str
    starts: Floats
    misfit: float


def search_starts(
    objective: Objective,
    box: Box,
    searched: Box,
    settings: Multistart,
    *,
    rng: Seed,
    mirrored: tuple[int, ...] = (),
    nested: Floats | None = None,
    suspicious: float = math.inf,
    on_search: OnSearch = lambda found: None,
) -> MultistartResult:
    """Local minima inside `box`, by minimisations from samples of the narrower box `searched`.

    The best samples often lie in one basin, not always the basin of the least misfit. Only half of them therefore
    start minimisations, the others are samples in random order; later rounds also start from the best minimum with some
    of its parameters replaced. The search ends early only if the last round has not lowered the least misfit, that
    misfit is not `suspicious`, and it has been found again; a minimum on a bound takes one more round than others. Once
    enough minimisations agree, slow ones that are behind are given up, see `Hopeless`.

    `mirrored`: parameters whose signs can be changed together with little effect, but across a barrier that no local
    minimisation crosses; a further one starts from the mirror image of the best minimum. `nested`: further starts of
    the first round, shape (n_starts, n_params). `suspicious`: least misfit above which a simpler description is as
    good.
    """
    n_free = len(searched.free)
    sample = latin_hypercube(Streams(rng=rng), settings.samples * n_free, n_free)
    samples, misfit = scaled_to_force(objective, searched, np.asarray(searched.theta_from_unit(sample)))
    finite = np.flatnonzero(np.isfinite(misfit))
    order = finite[np.argsort(misfit[finite], kind="stable")]
    rounds = _Rounds(objective, samples[order], misfit[order])
    most = settings.most_rounds * settings.most_iterations

    def tell() -> None:
        on_search(rounds.found(min((len(rounds.best) - 1) / most, 1.0)))

    def advance(minima: LocalMinima) -> None:
        rounds.advance(minima)
        tell()

    def run_round(starts: Floats) -> None:
        earlier = tuple(rounds.misfit[: rounds.n_ended].tolist())
        rounds.keep(_descend(objective, box, starts, settings, earlier=earlier, on_iteration=advance))
        rounds.n_ended = len(rounds.misfit)

    if order.size:
        tell()
    reason = "max_rounds"
    left = list(order)
    number = settings.least_rounds
    while number <= settings.most_rounds:
        if rounds.n_ended:
            points = rounds.cross_samples(samples, np.random.default_rng([rng, number]))
            wanted = settings.starts
        else:
            points = samples[:0] if nested is None else nested
            wanted = settings.starts * number
        chosen = _take_samples(left, max(wanted - len(points), 0))
        starts = np.concatenate([points, samples[chosen]])
        if not len(starts):
            break
        run_round(starts)
        least_rounds = settings.least_rounds
        if least_rounds > 1:
            best = np.asarray(box.unit_from_theta(rounds.theta[np.argmin(rounds.misfit)]))
            least_rounds += bool(np.any(on_bound(best)))
        least = float(rounds.misfit.min())
        at_best = np.count_nonzero(rounds.misfit <= (1.0 + settings.closeness) * least)
        # Of the rounds that ran together, the last one too must not have lowered the least misfit.
        before = float(np.min(rounds.misfit[: -settings.starts], initial=math.inf))
        if (
            number >= least_rounds
            and (number == 1 or least >= (1.0 - settings.closeness) * before)
            and least <= (1.0 + settings.closeness) * suspicious
            and at_best >= settings.found
        ):
            reason = "found_again"
            break
        number += 1
    if mirrored and rounds.n_ended:
        run_round(mirror(rounds.theta[[np.argmin(rounds.misfit)]], mirrored))
    return rounds.make_result(reason)


def mirror(theta: Floats, mirrored: tuple[int, ...]) -> Floats:
    """Mirror image of points, shape (..., n_params): the `mirrored` parameters with opposite signs."""
    image = theta.copy()
    image[..., list(mirrored)] *= -1.0
    return image


def _take_samples(left: list[np.intp], count: int) -> list[np.intp]:
    """Indices of `count` samples, removed from `left`: by turns the best one, and the first one drawn."""
    taken: list[np.intp] = []
    while left and len(taken) < count:
        chosen = left[0] if len(taken) % 2 == 0 else min(left)
        left.remove(chosen)
        taken.append(chosen)
    return taken


# Range of the factors on the forces of samples.
_SCALE = 1e3


def scaled_to_force(objective: Objective, box: Box, theta: Floats) -> tuple[Floats, Floats]:
    """Samples with their forces scaled to the best fit, and their misfits, which may be infinite.

    To multiply all parameters whose unit contains the newton by a factor multiplies the force by it, as a change of the
    unit of force does. The squared misfit is a quadratic function of the factor, which two misfits and the misfit of
    no force determine. Samples are thus compared by the shape of their loops, not by their force. If a parameter with
    newtons is fixed, the samples are unchanged.
    """
    is_force = np.array([parameter.scales_with_force for parameter in objective.spec.parameters])
    misfit = objective(theta)
    if not set(np.flatnonzero(is_force)) <= set(box.free) or not is_force.any():
        return theta, misfit
    halved = objective(np.where(is_force, 0.5 * theta, theta))
    simulated = np.flatnonzero(np.isfinite(misfit) & np.isfinite(halved))
    if not simulated.size:
        return theta, misfit
    none = float(objective(np.where(is_force, 1e-9 * theta, theta)[simulated[:1]])[0]) ** 2
    if not np.isfinite(none):
        return theta, misfit
    # misfit^2 = none - 2 slope factor + curve factor^2
    full, half = misfit[simulated] ** 2, halved[simulated] ** 2
    curve = 2.0 * (full - 2.0 * half + none)
    slope = 0.5 * (none + curve - full)
    useful = (curve > 0.0) & (slope > 0.0)
    factor = np.clip(np.divide(slope, curve, out=np.ones_like(slope), where=useful), 1.0 / _SCALE, _SCALE)
    scaled = theta.copy()
    scaled[simulated] = np.where(is_force, factor[:, None] * theta[simulated], theta[simulated])
    fitted = misfit.copy()
    fitted[simulated] = np.sqrt(np.maximum(none - 2.0 * slope * factor + curve * factor**2, 0.0))
    return np.clip(scaled, box.lower, box.upper), fitted


def distinct_minima(box: Box, theta: Floats, misfit: Floats) -> Floats:
    """The best minimum, and up to two distant ones whose misfit is at most 1 % larger, as rows, best first."""
    unit = np.asarray(box.unit_from_theta(theta))
    chosen = [0]
    for index in np.flatnonzero(misfit <= (1.0 + _CLOSE) * misfit[0]):
        if np.all(np.abs(unit[chosen] - unit[index]).max(axis=1) > _DISTANT):
            chosen.append(int(index))
    return theta[chosen[:_MOST_DISTINCT]]


def _descend(
    objective: Objective,
    box: Box,
    starts: Floats,
    settings: Multistart,
    *,
    earlier: tuple[float, ...] = (),
    on_iteration: Callable[[LocalMinima], None] | None,
) -> LocalMinima:
    """Local minima of one round; hopeless minimisations are given up, also by the misfits of `earlier` minima."""
    return find_minima(
        objective,
        box,
        starts,
        max_iterations=settings.most_iterations,
        tolerance=_TOLERANCE,
        hopeless=Hopeless(
            after=_HOPELESS_AFTER,
            factor=_HOPELESS,
            found=settings.found,
            closeness=settings.closeness,
            earlier=earlier,
        ),
        on_iteration=on_iteration,
    )


def minima_from(
    objective: Objective,
    box: Box,
    starts: Floats,
    *,
    mirrored: tuple[int, ...] = (),
    on_iteration: Callable[[LocalMinima], None] | None = None,
) -> Floats:
    """The `distinct_minima` that local minimisations from starts, (n_starts, n_params), reach in one batch.

    `mirrored` as in `search_starts`.
    """
    settings = Multistart()
    minima = _descend(objective, box, starts, settings, on_iteration=on_iteration)
    theta, misfit = minima.theta, minima.misfit
    if mirrored:
        image = mirror(theta[[int(np.argmin(misfit))]], mirrored)
        minima = _descend(objective, box, image, settings, on_iteration=on_iteration)
        theta, misfit = np.concatenate([theta, minima.theta]), np.concatenate([misfit, minima.misfit])
    return distinct_minima(box, *best_first(theta, misfit))


def best_first(theta: Floats, misfit: Floats) -> tuple[Floats, Floats]:
    """Minima, (n_minima, n_params), with their misfits, sorted by these."""
    order = np.argsort(misfit, kind="stable")
    return theta[order], misfit[order]


def report_minima(call: Identifying, fitted: str, trace: SearchTrace, minima: LocalMinima) -> None:
    """Report local minimisations of what is `fitted`, from starts that a search with this trace has found."""
    best = minima.best
    call.so_far = lambda: (best.theta, trace)
    call.on_steps("screening", best.steps, best.misfit, fitted)


class _Rounds:
    """State of the search: the minima of the completed rounds and of the present one; before them, the best sample."""

    def __init__(self, objective: Objective, theta: Floats, misfit: Floats) -> None:
        self.objective = objective
        self.theta, self.misfit, self.n_ended = theta[:1], misfit[:1], 0
        self.evaluations = [objective.tally.simulations]
        self.best = [float(misfit[0]) if misfit.size else math.inf]
        self.median = [float(np.median(misfit)) if misfit.size else math.inf]

    def keep(self, minima: LocalMinima) -> None:
        """Replace the minima of the present round; those of the rounds that ended stay."""
        self.theta = np.concatenate([self.theta[: self.n_ended], minima.theta])
        self.misfit = np.concatenate([self.misfit[: self.n_ended], minima.misfit])

    def advance(self, minima: LocalMinima) -> None:
        self.keep(minima)
        self.evaluations.append(self.objective.tally.simulations)
        self.best.append(min(self.best[-1], float(minima.misfit.min())))
        self.median.append(float(np.median(minima.misfit)))

    def cross_samples(self, samples: Floats, random: np.random.Generator) -> Floats:
        """Crossover of the best minimum with random samples, shape (n_crossed, n_params)."""
        chosen = samples[random.integers(len(samples), size=_CROSSED)]
        return np.where(random.random(chosen.shape) < _REPLACED, chosen, self.theta[np.argmin(self.misfit)])

    def found(self, share: float) -> Found:
        """What is found so far, with the share of the allowed iterations that is used up."""
        minima = self.make_result("")
        return Found(best=lambda: minima.theta[0], trace=minima.trace, share=share)

    def make_result(self, stop_reason: str) -> MultistartResult:
        theta, misfit = best_first(self.theta, self.misfit)
        return MultistartResult(
            theta=theta,
            misfit=misfit,
            trace=SearchTrace(
                evaluations=tuple(self.evaluations),
                best=tuple(self.best),
                median=tuple(self.median),
                stop_reason=stop_reason,
                ends=tuple(misfit.tolist()),
            ),
        )


EXCERPTS = "excerpts"
"""What the searches fit that compare parts of the tests."""


def on_bound(unit: Floats) -> NDArray[np.bool_]:
    """Whether each unit coordinate is within `ON_BOUND` of 0 or 1, same shape."""
    return np.asarray((unit < ON_BOUND) | (unit > 1.0 - ON_BOUND))
