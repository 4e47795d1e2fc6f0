"""Global search of a plain model: starting points of the final least-squares fits.

By default multistart least squares: local minimisations (Levenberg-Marquardt) start from the best of many samples, in
rounds, until several of them have reached the least misfit. The rounds that are run in any case are one batch, which
takes little longer than a round, because the time steps of a record are sequential. The misfit of a hysteresis model is
smooth except for a few kinks, so a local minimisation of two hundred simulations reaches a minimum that a
population-based search only approaches in thousands. Only repeated local minimisations show whether that minimum is the
global one. The simpler model that a searched model contains is fitted first: starts near it, and the misfit to be
reached.

A minimum is suspicious where descriptions of the same tests, simpler or of single ones, are better.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import Seed
from mrwork.base.numbers import apart, with_decimals
from mrwork.base.summary import Summarised, list_names
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.command import command_level
from mrwork.dampers.conversions import nesting_of
from mrwork.dampers.coordinates import ON_BOUND, Box
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import SimulationError
from mrwork.identification.equivalent import Form, bounds_of, half_ranges, identifiable_form, search_box
from mrwork.identification.fit import NEGLIGIBLE, SearchTrace
from mrwork.identification.minimise.levenberg_marquardt import (
    Hopeless,
    LocalMinima,
    find_minima,
    is_at_stiffness_limit,
    stiffness_and_slope,
)
from mrwork.identification.objective import Objective, friction_limit, up_to
from mrwork.identification.problem import Problem
from mrwork.identification.progress import Found, Identifying
from mrwork.identification.settings import Multistart, Start
from mrwork.records import DamperTest
from mrwork.records.window import excerpt
from mrwork.search.unit_cube import Streams, latin_hypercube

if TYPE_CHECKING:
    from mrwork.search import Optimiser, SearchResult

# A fit whose misfit is not below this share of that of a linear spring and dashpot has lost its non-linear part.
LINEAR_SHARE = 0.98


def linear_misfit(tests: Sequence[DamperTest], *, follows_command: bool = False) -> float:
    """Root mean square NRMSE of a linear spring and dashpot with an offset, one for all tests.

    For a model that follows the command, those at each command have their own.
    """
    groups: dict[object, list[DamperTest]] = {}
    for test in tests:
        groups.setdefault(command_of(test) if follows_command else None, []).append(test)
    squares = [square for group in groups.values() for square in _linear_squares(group)]
    return float(np.sqrt(np.mean(squares)))


def command_of(test: DamperTest, varying: str = "") -> object:
    """Key of a test, equal for those of one constant command; one that varies has its label, or the one given."""
    if test.has_varying_command:
        return varying or test.label
    return tuple((unit, command_level(float(np.mean(command)), unit)) for command, unit in test.commands)


def _linear_squares(tests: Sequence[DamperTest]) -> list[float]:
    """Squared NRMSE of each test, for the one spring, dashpot and offset that minimise their sum."""
    forces, motions = [], []
    for test in tests:
        force = test.force[test.counted]
        motion = np.stack([test.displacement, test.velocity, np.ones_like(test.force)], axis=1)[test.counted]
        weight = np.std(force) * np.sqrt(force.size)
        forces.append(force / weight)
        motions.append(motion / weight)
    scale = np.maximum(np.abs(np.concatenate(motions)).max(axis=0), np.finfo(np.float64).tiny)
    solution = np.linalg.lstsq(np.concatenate(motions) / scale, np.concatenate(forces), rcond=None)[0]
    residuals = [force - (motion / scale) @ solution for force, motion in zip(forces, motions, strict=True)]
    return [float(residual @ residual) for residual in residuals]


def linear_warning(
    nrmse: float, tests: Sequence[DamperTest], *, follows_command: bool = False
) -> tuple[str, ...]:
    """Warning that a fit with this misfit is no better than a linear spring and dashpot; empty if it is better."""
    linear = linear_misfit(tests, follows_command=follows_command)
    if nrmse < LINEAR_SHARE * linear:
        return ()
    return (
        f"the fit, {100.0 * (1.0 - nrmse):.2f} %, is no better than that of a linear spring and dashpot, "
        f"{100.0 * (1.0 - linear):.2f} %: the minimum is false, or this model cannot describe the tests; "
        "try another seed or another model",
    )


# A test is far worse in a joint fit than alone above this multiple of the NRMSE of its own fit, which is at least
# `_RESOLVED`. On nine measured tests the best minimum of one set of laws reaches 3.1, a false one 3 to 14.
_FAR_WORSE = 5.0
_RESOLVED = 0.02
# Tests that a sentence names.
_SHOWN = 3


def far_worse(joint: Floats, alone: Floats) -> NDArray[np.intp]:
    """Indices of the tests whose `joint` NRMSE, shape (n_tests,), is far above their own; NaN where there is none."""
    return np.flatnonzero(joint > _FAR_WORSE * np.maximum(alone, _RESOLVED))


def far_worse_sentence(
    tests: Sequence[DamperTest], worse: NDArray[np.intp], joint: Floats, alone: Floats, *, found_again: bool
) -> str:
    """Sentence on the tests whose NRMSE in the joint fit is far above that of their own fits."""
    both = [
        f"{tests[index].name} ({100.0 * (1.0 - joint[index]):.1f} % for {100.0 * (1.0 - alone[index]):.1f} %)"
        for index in worse
    ]
    shown = list_names(both, _SHOWN)
    other = "compare other models (--model A,B)"
    are = "is" if len(worse) == 1 else "are"
    tests_shown = f"{len(worse)} of {len(tests)} tests {are} described far worse together than alone: {shown}"
    if found_again:
        return (
            f"{tests_shown}; no start found a better minimum, so these laws of this model cannot follow the tests: "
            f"let more parameters follow the command, give laws of a higher degree (--law auto tries both), or {other}"
        )
    return f"false minimum suspected: {tests_shown}; try another seed, other laws (--law auto), or {other}"


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
    """Local minima, best first, shape (n_minima, n_params), with misfits (n_minima,), and why the search ended.

    The trace has one entry per iteration: `evaluations` and `best` misfit so far, `median` misfit of the present round.
    """

    theta: Floats
    misfit: Floats
    stop_reason: str
    evaluations: tuple[int, ...]
    best: tuple[float, ...]
    median: tuple[float, ...]


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
    on_search: Callable[[Found], None] | None = None,
) -> MultistartResult:
    """Local minima inside `box`, by minimisations from samples of the narrower box `searched`.

    The best samples often lie in one basin, which need not be that of the least misfit. Only half of them therefore
    start minimisations, the others are samples in random order; later rounds also start from the best minimum with some
    of its parameters replaced. The search ends early only if the last round has not lowered the least misfit, that
    misfit is not `suspicious`, and it has been found again; a minimum on a bound takes one more round than others. Once
    enough minimisations agree, slow ones that are behind are given up, see `Hopeless`.

    `mirrored`: parameters whose signs can be changed together with little effect, but across a barrier that no local
    minimisation crosses; a further one starts from the mirror image of the best minimum. `nested`: further starts of
    the first round, shape (n_starts, n_params). `suspicious`: least misfit above which a simpler description is as
    good. `on_search`: called after each iteration.
    """
    n_free = len(searched.free)
    sample = latin_hypercube(Streams(rng=rng), settings.samples * n_free, n_free)
    samples, misfit = scaled_to_force(objective, searched, np.asarray(searched.theta_from_unit(sample)))
    finite = np.flatnonzero(np.isfinite(misfit))
    order = finite[np.argsort(misfit[finite], kind="stable")]
    rounds = _Rounds(objective, samples[order], misfit[order])
    most = settings.most_rounds * settings.most_iterations

    def tell() -> None:
        if on_search is not None:
            on_search(rounds.found(min((len(rounds.best) - 1) / most, 1.0)))

    def run_round(starts: Floats) -> None:
        def advance(minima: LocalMinima) -> None:
            rounds.advance(minima)
            tell()

        rounds.end(_descend(objective, box, starts, settings, earlier=rounds.misfits, on_iteration=advance))

    if order.size:
        tell()
    reason = "max_rounds"
    left = list(order)
    number = settings.least_rounds
    while number <= settings.most_rounds:
        if rounds.ended:
            given = rounds.cross_samples(samples, np.random.default_rng([rng, number]))
            wanted = settings.starts
        else:
            given = samples[:0] if nested is None else nested
            wanted = settings.starts * number
        chosen = _take_samples(left, max(wanted - len(given), 0))
        starts = np.concatenate([given, samples[chosen]])
        if not len(starts):
            break
        run_round(starts)
        least_rounds = settings.least_rounds
        if least_rounds > 1:
            best = np.asarray(box.unit_from_theta(rounds.best_minimum))
            least_rounds += bool(np.any(_on_bound(best)))
        at_best = np.count_nonzero(np.array(rounds.misfits) <= (1.0 + settings.closeness) * rounds.least)
        # Of the rounds that ran together, the last one too must not have lowered the least misfit.
        before = min(rounds.misfits[: -settings.starts], default=math.inf)
        if (
            number >= least_rounds
            and (number == 1 or rounds.least >= (1.0 - settings.closeness) * before)
            and rounds.least <= (1.0 + settings.closeness) * suspicious
            and at_best >= settings.found
        ):
            reason = "found_again"
            break
        number += 1
    if mirrored and rounds.ended:
        run_round(mirror(rounds.make_result("").theta[:1], mirrored))
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
    unit of force does. The squared misfit is a quadratic function of the factor, which two misfits and that of no
    force determine. Samples are thus compared by the shape of their loops, not by their force. If a parameter with
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
    order = np.argsort(misfit, kind="stable")
    return distinct_minima(box, theta[order], misfit[order])


class _Rounds:
    """State of the search: the best sample, and the minima of the completed rounds and of the present one."""

    def __init__(self, objective: Objective, theta: Floats, misfit: Floats) -> None:
        self.objective = objective
        self.sampled = (theta[:1], misfit[:1])
        self.ended: list[LocalMinima] = []
        self.running: LocalMinima | None = None
        self.evaluations = [objective.tally.simulations]
        self.best = [float(misfit[0]) if misfit.size else math.inf]
        self.median = [float(np.median(misfit)) if misfit.size else math.inf]

    def advance(self, minima: LocalMinima) -> None:
        self.running = minima
        self.evaluations.append(self.objective.tally.simulations)
        self.best.append(min(self.best[-1], float(minima.misfit.min())))
        self.median.append(float(np.median(minima.misfit)))

    def end(self, minima: LocalMinima) -> None:
        self.running = None
        self.ended.append(minima)

    @property
    def misfits(self) -> tuple[float, ...]:
        """Misfits of the local minimisations that ended, in the order of their starts."""
        return tuple(float(misfit) for minima in self.ended for misfit in minima.misfit)

    @property
    def least(self) -> float:
        """Least misfit of the local minimisations that ended; infinite before the first."""
        return min(self.misfits, default=math.inf)

    @property
    def best_minimum(self) -> Floats:
        """Parameters of the least misfit of the local minimisations that ended, shape (n_params,)."""
        minima = min(self.ended, key=lambda minima: float(minima.misfit.min()))
        return np.asarray(minima.theta[int(np.argmin(minima.misfit))])

    def cross_samples(self, samples: Floats, random: np.random.Generator) -> Floats:
        """Crossover of the best minimum with random samples, shape (n_crossed, n_params)."""
        chosen = samples[random.integers(len(samples), size=_CROSSED)]
        return np.where(random.random(chosen.shape) < _REPLACED, chosen, self.best_minimum)

    def found(self, share: float) -> Found:
        """What is found so far, with the share of the allowed iterations that is used up."""
        minima = self.make_result("")
        return Found(
            best=lambda: minima.theta[0],
            trace=trace_of(minima),
            # The first entry is that of the samples.
            iteration=len(minima.best) - 1,
            misfit=minima.best[-1],
            median=minima.median[-1],
            share=share,
        )

    def make_result(self, stop_reason: str) -> MultistartResult:
        groups = [(minima.theta, minima.misfit) for minima in self.ended]
        if self.running is not None:
            groups.append((self.running.theta, self.running.misfit))
        theta, misfit = (np.concatenate(parts) for parts in zip(*(groups or [self.sampled]), strict=True))
        order = np.argsort(misfit, kind="stable")
        return MultistartResult(
            theta=theta[order],
            misfit=misfit[order],
            stop_reason=stop_reason,
            evaluations=tuple(self.evaluations),
            best=tuple(self.best),
            median=tuple(self.median),
        )


OnSearch = Callable[[str, Found], None]
"""Called after an iteration with what is fitted, empty for the model on all samples, and what is found so far."""
EXCERPTS = "excerpts"
"""What the searches fit that compare parts of the tests."""

# Nested starts are moved off the faces of the box, by this share of its ranges: on a face a parameter has no slope.
_OFF_FACES = 5e-3
# Rounds of the search of a simpler model, and iterations of its local minimisations: its fit is only a start.
_NESTED_ROUNDS = 3
_NESTED_ITERATIONS = 30
# A point near the simpler model has its misfit plus this at most; where bounds exclude such points, it is further away.
_NEAR = 0.1


@array_dataclass()
class NestedFit:
    """Fit of a simpler `model` that the searched one contains.

    `starts` are points of the searched model near it, shape (n_starts, n_params). `misfit` is that of the simpler
    model, which the searched one can at least approach; infinite where bounds prevent that.
    """

    model: str
    starts: Floats
    misfit: float


def nested_fit(
    objective: Objective, box: Box, search: Multistart, *, rng: int, on_search: OnSearch
) -> NestedFit | None:
    """Fit of the simpler model that the searched one contains, within shared bounds; `None` without one."""
    nesting = nesting_of(objective.spec)
    if nesting is None:
        return None
    simpler = damper(nesting.model)
    names = objective.spec.names
    if objective.settings.ties:
        # Without the ties the simpler model would be contained no more.
        return None
    form = identifiable_form(simpler, bounds_of(box, nesting.shared))
    rough = objective.on(simpler, objective.tests)
    search = replace(
        search,
        least_rounds=1,
        most_rounds=min(search.most_rounds, _NESTED_ROUNDS),
        most_iterations=min(search.most_iterations, _NESTED_ITERATIONS),
    )

    def lift_points(theta: Floats) -> Floats:
        values = dict(zip(simpler.names, theta.tolist(), strict=True))
        points = nesting.points(values, half_ranges(objective.tests))
        whole = np.array([[point[name] for name in names] for point in points])
        unit = np.asarray(box.unit_from_theta(np.clip(whole, box.lower, box.upper)))
        return np.asarray(box.theta_from_unit(np.clip(unit, _OFF_FACES, 1.0 - _OFF_FACES)))

    def lifted(fitted: str, found: Found) -> None:
        on_search(fitted, replace(found, best=lambda: lift_points(found.best())[-1]))

    deeper = nested_fit(rough, form.box, search, rng=rng, on_search=part_of(lifted, 0.0, 0.5))
    minima = search_starts(
        rough,
        form.box,
        search_box(simpler, form.box, objective.tests),
        search,
        rng=rng,
        nested=None if deeper is None else deeper.starts,
        suspicious=math.inf if deeper is None else deeper.misfit,
        on_search=partial(part_of(lifted, 0.5, 0.5), simpler.name),
    )
    if not len(minima.theta):
        return None
    starts, misfit = lift_points(minima.theta[0]), float(minima.misfit[0])
    near = float(np.min(objective(starts))) <= misfit + _NEAR
    return NestedFit(model=simpler.name, starts=starts, misfit=misfit if near else math.inf)


def part_of(on_search: OnSearch, before: float, share: float) -> OnSearch:
    """The callback of a search that is a share of the whole, after what is done before."""
    return lambda fitted, found: on_search(fitted, replace(found, share=before + share * found.share))


# Largest number of starting points.
_STARTS = 16


@array_dataclass()
class StartingPoints:
    """Starting points, shape (n_starts, n_params), best first, and the trace of the search that found them.

    `objective` compares them, and they are fitted inside the box of `form`. Where they are `minima` already, no
    screening is needed to select the best; `warnings` say what makes the best suspicious, and `is_suspected` that it is
    taken for a false minimum.
    """

    objective: Objective
    form: Form
    theta: Floats
    trace: SearchTrace
    minima: bool = False
    warnings: tuple[str, ...] = ()
    is_suspected: bool = False

    def with_given(self, spec: DamperSpec, given: Sequence[Start]) -> StartingPoints:
        """The starting points, and the user's starts, in parameters of the requested model, moved inside the box.

        A parameter that a start does not name is that of the best point. A start above the limit of stiffness lifts it.
        """
        box = self.form.box
        best = np.asarray(self.form.to_model(self.theta[0]))
        whole = [
            np.array([start.get(name, own) for name, own in zip(spec.names, best, strict=True)])
            for start in given
        ]
        inside = [box.inside(np.clip(self.form.from_model(theta), box.lower, box.upper)) for theta in whole]
        objective = self.objective
        if inside and any(np.any(each.stiffness(np.array(inside)) > 1.0) for each in objective.compared):
            objective = up_to(objective, np.inf)
        return replace(self, objective=objective, theta=np.array([*self.theta, *inside]))


# Minima at the limit of stiffness start again off the bounds, by this share of the ranges. Above the limit they are
# better if their misfit falls by this share in so many iterations.
_OFF_BOUNDS = 0.05
_MEASURABLE = 0.02
_BEYOND_LIMIT = 10


def examine_limit(
    objective: Objective,
    form: Form,
    theta: Floats,
    *,
    raised: float = math.inf,
    points: float = NEGLIGIBLE,
    on_iteration: Callable[[LocalMinima], None] | None = None,
) -> tuple[Objective, Floats]:
    """Starts of the final fit where minima, (n_minima, n_params), are at the limit of stiffness, and their objective.

    The limit is `raised` by this factor while the misfit falls measurably above it: by `_MEASURABLE` of itself or by
    more than `points`. On a bound parameters have no slope: what the limit leaves to them is found from off it.
    """
    box = form.box
    while is_at_stiffness_limit(objective.compared, theta[:1])[0]:
        higher = up_to(objective, raised * objective.stiffest)
        beyond = find_minima(higher, box, theta, max_iterations=_BEYOND_LIMIT, on_iteration=on_iteration)
        within, least = float(objective(theta).min()), float(beyond.misfit.min())
        if within - least <= min(points / 100.0, _MEASURABLE * within):
            unit = np.asarray(box.unit_from_theta(theta))
            inner = np.clip(unit, _OFF_BOUNDS, 1.0 - _OFF_BOUNDS)[np.any(_on_bound(unit), axis=1)]
            return objective, np.concatenate([theta, np.asarray(box.theta_from_unit(inner))])
        theta = minima_from(higher, box, beyond.theta, mirrored=form.mirrored, on_iteration=on_iteration)
        objective = higher
    return objective, theta


# A parameter takes part in the stiffness if it changes it by this share of what the others do.
_TAKES_PART = 0.01


def friction_warning(
    objective: Objective, form: Form, theta: Floats, nested: NestedFit | None = None
) -> tuple[str, ...]:
    """Sentence on starts, (n_starts, n_params), best first, that are at the limit of stiffness; empty elsewhere."""
    if not is_at_stiffness_limit(objective.compared, theta[:1])[0]:
        return ()
    latent = np.asarray(form.box.latent_from_theta(form.box.inside(theta[:1])))[0]
    slope = np.abs(stiffness_and_slope(objective.compared, form.box, latent)[1]).max(axis=0)
    names = [
        form.box.names[index]
        for index in np.take(form.box.free, np.flatnonzero(slope > _TAKES_PART * slope.max()))
    ]
    beside = ""
    if nested is not None and nested.misfit < math.inf:
        both = [100.0 * (1.0 - misfit) for misfit in (nested.misfit, float(objective(theta[:1])[0]))]
        beside = (
            f" ({nested.model}, which it contains, fits {both[0]:.2f} % of the excerpts, it {both[1]:.2f} %)"
        )
    return (
        f"{form.spec.name} becomes a friction element by its {list_names(names)}: a loop that yields or unloads faster "
        f"would lower the misfit by less than {100.0 * _MEASURABLE:g} % of it and was not searched; use a model that "
        f"costs less where it fits as well{beside}: compare models without states (--model hyperbolic_tangent_guo)",
    )


def _on_bound(unit: Floats) -> NDArray[np.bool_]:
    return np.asarray((unit < ON_BOUND) | (unit > 1.0 - ON_BOUND))


def points_from_multistart(problem: Problem, search: Multistart, *, call: Identifying) -> StartingPoints:
    """The best minima of a multistart search among candidates below the limit of stiffness.

    There is no limit where no candidate is below it, or where stiffer ones describe the tests measurably better.
    """
    # The loops of a few cycles are sufficient to find the minima; the final fit compares all samples.
    excerpts = tuple(excerpt(test) for test in problem.objective.tests)
    objective = problem.objective.on(problem.form.spec, excerpts)
    for limited in (up_to(objective, friction_limit(problem.objective.tests)), objective):
        points = _search_points(problem, limited, search, call)
        if points is not None:
            return points
    raise no_simulation(problem.form.spec, objective.tally.simulations)


def _search_points(
    problem: Problem, objective: Objective, search: Multistart, call: Identifying
) -> StartingPoints | None:
    """The best minima that a multistart search finds on the excerpts of `objective`; `None` where there are none."""
    form, rng = problem.form, problem.settings.rng

    def on_nested(simpler: str, found: Found) -> None:
        call.on_search(f"{simpler} on {EXCERPTS}", found)

    nested = nested_fit(objective, form.box, search, rng=rng, on_search=part_of(on_nested, 0.0, 0.5))
    minima = search_starts(
        objective,
        form.box,
        search_box(form.spec, form.box, objective.tests),
        search,
        rng=rng,
        mirrored=form.mirrored,
        nested=None if nested is None else nested.starts,
        suspicious=min(
            math.inf if nested is None else nested.misfit, LINEAR_SHARE * linear_misfit(objective.tests)
        ),
        on_search=partial(part_of(call.on_search, 0.5, 0.5), EXCERPTS),
    )
    if not len(minima.theta):
        return None
    theta = distinct_minima(form.box, minima.theta, minima.misfit)
    call.so_far = lambda: (minima.theta[0], trace_of(minima))
    objective, theta = examine_limit(objective, form, theta)
    return StartingPoints(
        objective=objective,
        form=form,
        theta=theta,
        trace=trace_of(minima),
        minima=True,
        warnings=(*doubts_about(minima, nested, search), *friction_warning(objective, form, theta, nested)),
    )


def doubts_about(minima: MultistartResult, nested: NestedFit | None, settings: Multistart) -> tuple[str, ...]:
    """Warnings about the minimum of a search."""
    least = float(minima.misfit[0])
    if nested is not None and least > (1.0 + settings.closeness) * nested.misfit:
        better, own = apart(with_decimals, 100.0 * (1.0 - nested.misfit), 100.0 * (1.0 - least), 2)
        return (
            f"the fit of {nested.model}, which this model contains, is better in the search "
            f"({better} % against {own} %): the minimum is false; try another seed",
        )
    if minima.stop_reason == "max_rounds":
        again = int(np.count_nonzero(minima.misfit <= (1.0 + settings.closeness) * least))
        if again >= max(settings.found, len(minima.misfit) / 2):
            # The search went on only because a simpler description is as good, which has a warning of its own.
            return ()
        return (
            f"the search is not sure of its minimum: {again} of {len(minima.misfit)} local minimisations reached it; "
            "compare the fit of another seed",
        )
    return ()


def trace_of(minima: MultistartResult) -> SearchTrace:
    """Trace of a multistart search."""
    return SearchTrace(
        evaluations=minima.evaluations,
        best=minima.best,
        median=minima.median,
        stop_reason=minima.stop_reason,
        ends=tuple(minima.misfit.tolist()),
    )


def points_from_optimiser(problem: Problem, search: Optimiser, *, call: Identifying) -> StartingPoints:
    """The elite of an optimiser (its best points that are far apart), for a model without current laws."""
    objective, form = problem.objective, problem.form
    box = search_box(form.spec, form.box, objective.tests)

    elite = optimise(
        search,
        objective,
        box.theta_from_unit,
        n_params=len(box.free),
        rng=problem.settings.rng,
        on_search=partial(call.on_search, ""),
    )
    return StartingPoints(
        objective=objective,
        form=form,
        theta=np.asarray(box.theta_from_unit(elite.elite[:_STARTS])),
        trace=trace_of_generations(elite),
    )


def optimise(
    search: Optimiser,
    objective: Objective,
    theta_of: Callable[[Floats], Floats],
    *,
    n_params: int,
    rng: int,
    on_search: Callable[[Found], None],
) -> SearchResult:
    """Minimum of the objective over unit vectors, mapped to parameters by `theta_of`, as the search result."""
    from mrwork.search import run_search

    def on_generation(so_far: SearchResult) -> None:
        if not math.isfinite(so_far.best_misfit):
            return
        on_search(
            Found(
                best=lambda: theta_of(so_far.best_unit[None])[0],
                trace=trace_of_generations(so_far),
                iteration=so_far.generations,
                misfit=so_far.best_misfit,
                median=float(so_far.trace.median[-1]),
                share=so_far.generations / search.stop.max_generations,
            )
        )

    result = run_search(
        search,
        lambda unit: objective(theta_of(unit)),
        rng=rng,
        n_params=n_params,
        on_generation=on_generation,
        journal=objective.journal,
    )
    if not len(result.elite):
        raise no_simulation(objective.spec, result.evaluations)
    return result


def trace_of_generations(search: SearchResult) -> SearchTrace:
    """Trace of an optimiser, an entry for each generation."""
    return SearchTrace(
        evaluations=tuple(int(count) for count in search.trace.evaluations),
        best=tuple(float(value) for value in search.trace.best),
        median=tuple(float(value) for value in search.trace.median),
        stop_reason=search.stop_reason,
    )


def no_simulation(spec: DamperSpec, evaluations: int) -> SimulationError:
    """The error of a search in which every simulation failed."""
    return SimulationError(
        f"none of {evaluations} candidates of {spec.name} could be simulated on these tests; "
        "check the units of the record, or narrow the bounds"
    )
