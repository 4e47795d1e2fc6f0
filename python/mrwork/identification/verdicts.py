"""The parameters of a fit with their standard errors and verdicts, and the rule of every verdict on a parameter.

Standard errors, profiles and posterior draws are judged by the one rule, which measures them by the size of a relevant
change of the parameter. Directions in parameter space follow from the Fisher information, with reasons in words.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from fractions import Fraction
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from mrwork.base.numbers import of_unit
from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.dampers.parameters import RATE_NAMES
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.covariance import INSENSITIVE, Covariance, states_of
from mrwork.identification.equivalent import search_box
from mrwork.identification.fit import Direction, FittedParameter, ParameterChange
from mrwork.identification.interval import Interval, Verdict
from mrwork.identification.problem import Problem
from mrwork.records import DamperTest
from mrwork.records.observation import Effect
from mrwork.records.repairs import seconds_of_pulses

# A standard deviation above this share of the value, or of 1 in the logarithm, is no determination.
WEAK = 0.25
# A parameter that changes the force by no more than this share of its standard deviation is negligible.
NEGLIGIBLE = 0.01
# An error of so many times the size of a relevant change is beyond what derivatives at a minimum tell, and not given.
_BEYOND = 100.0
# A value smaller than this share of the nominal one counts as zero.
_AS_ZERO = 0.01
# Standard deviations that the 95 % interval of a normal density reaches to either side.
DEVIATIONS = NormalDist().inv_cdf(0.975)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """Size of a relevant change of one parameter: its value, or half its range `lower` to `upper` where `of_range`.

    A parameter without a logarithmic scale may be zero: its range is at the scales of the records within the `bounds`,
    else at the size of the value, or of the nominal one.
    """

    name: str
    unit: str
    value: float
    size: float
    of_range: bool
    lower: float
    upper: float
    log: bool
    bounds: tuple[float, float]

    def share(self, share: float) -> str:
        """A share of the size, such as "40 % of its value", or "33 times its value" above 100 %."""
        whole = "its value"
        if self.of_range:
            limits = f"{self.lower:.3g} to {of_unit(self.upper, self.unit, 3)}"
            whole = f"half its range for these tests ({limits})"
        return _times(share, whole)


def parameter_scales(
    spec: DamperSpec, box: Box, tests: tuple[DamperTest, ...], theta: Floats, effects: Sequence[Effect] = ()
) -> tuple[Scale, ...]:
    """The scale of each parameter, and then of each free effect, at `theta`, shape (n_params + n_effects,)."""
    ranges, scales = search_box(spec, box, tests), []
    kinds = [(each.name, each.unit, each.nominal) for each in spec.parameters]
    kinds += [(effect.parameter, effect.unit, 0.0) for effect in effects]
    for index, ((name, unit, nominal), value) in enumerate(zip(kinds, theta.tolist(), strict=True)):
        bounds, log = (box.lower[index], box.upper[index]), box.log[index]
        lower, upper = ranges.lower[index], ranges.upper[index]
        nominal, most = abs(nominal), abs(value)
        most = most if most > _AS_ZERO * nominal else nominal
        ends = max(bounds[0], -most), min(bounds[1], most)
        if (lower, upper) == bounds and not log and most > 0.0 and ends[0] < ends[1]:
            lower, upper = ends
        half = 0.5 * (upper - lower)
        of_range = not log and half > abs(value)
        scales.append(
            Scale(
                name=name,
                unit=unit,
                value=value,
                size=half if of_range else abs(value),
                of_range=of_range,
                lower=lower,
                upper=upper,
                log=log,
                bounds=bounds,
            )
        )
    return tuple(scales)


def judge_error(error: float, scale: Scale, sensitivity: float, coherent: float = 1.0) -> Verdict:
    """Judge a parameter by its standard error, in its unit; see `judge_interval`."""
    half = DEVIATIONS * error
    ends = scale.value - half, scale.value + half
    share = error / abs(scale.value) if scale.value else np.inf
    width = f"its standard error is {_times(share, 'its value')}" if scale.value else "its value is 0"
    return _judge(scale, sensitivity, ends, share, width, coherent)


def judge_interval(interval: Interval, scale: Scale, sensitivity: float, coherent: float = 1.0) -> Verdict:
    """Judge a parameter by its interval.

    `sensitivity` is the root mean square of the change of force per unit of the parameter, in standard deviations of
    the force; `coherent` see `Fit.coherent`.
    """
    lower, upper = interval.lower, interval.upper
    if lower is None or upper is None:
        return _judge(scale, sensitivity, (lower, upper), np.inf, interval.opened, coherent)
    if scale.log:
        half = 0.5 * float(np.log(upper / lower))
        width = f"the interval is a factor of {np.exp(half):.2g} wide to either side"
    else:
        centre = 0.5 * abs(lower + upper)
        half = 0.5 * (upper - lower) / centre if centre else np.inf
        width = f"the interval is {_times(half, 'its value')} wide to either side"
    # The interval of a normal density reaches so many standard deviations to either side.
    deviations = NormalDist().inv_cdf(0.5 * (1.0 + interval.level))
    return _judge(scale, sensitivity, (lower, upper), half / deviations, width, coherent)


def _judge(
    scale: Scale,
    sensitivity: float,
    ends: tuple[float | None, float | None],
    share: float,
    width: str,
    coherent: float,
) -> Verdict:
    if share * coherent <= WEAK:
        return Verdict("identifiable")
    if share <= WEAK:
        moved = _times(share * coherent, "its value")
        return Verdict("model-dependent", f"a force of twice the residual could move it by {moved}")
    lower, upper = scale.bounds
    low = lower if ends[0] is None else max(ends[0], lower)
    high = upper if ends[1] is None else min(ends[1], upper)
    # Without a logarithmic scale the force is near to linear in the parameter, so that it may be left out.
    effect = sensitivity * max(abs(low), abs(high))
    if not scale.log and lower <= 0.0 <= upper and effect <= NEGLIGIBLE:
        reason = (
            f"its whole interval changes the force by at most {100.0 * effect:.2g} % of the force's deviation"
        )
        return Verdict("negligible", reason)
    if ends == (None, None):
        return Verdict("not identifiable", width)
    if low < 0.0 < high:
        including = f"the interval, {low:.4g} to {of_unit(high, scale.unit)}, includes zero"
        return Verdict("sign unknown", f"{width}; {including}")
    return Verdict("weakly identifiable", width)


def _times(share: float, whole: str) -> str:
    if share > _BEYOND:
        return f"more than {_BEYOND:g} times {whole}"
    return f"{100.0 * share:.2g} % of {whole}" if share < 1.0 else f"{share:.3g} times {whole}"


# Components of a direction smaller than this share of the largest are not named.
_NEGLIGIBLE = 0.03
# Relative tolerance for exponents to count as simple fractions, and the largest of those.
_SIMPLE = 2e-3
_LARGEST_DENOMINATOR = 2
_LARGEST_EXPONENT = 3


def changes_along(
    direction: Floats, scales: Sequence[Scale], effects: Floats | None = None
) -> tuple[ParameterChange, ...]:
    """Changes of the parameters along a direction, shape (n_params,), in shares of their scales; the first is by 1 %.

    Those that hardly change are left out, or hardly change the force by `effects` per share, (n_params,).
    """
    weight = np.abs(direction if effects is None else direction * effects)
    named = np.flatnonzero(weight > _NEGLIGIBLE * np.max(weight))
    unit = direction / direction[named[0]]
    return tuple(
        ParameterChange(
            name=scales[index].name,
            percent=float(unit[index]),
            of_range=scales[index].of_range,
            amount=0.01 * float(unit[index]) * scales[index].size,
            unit=scales[index].unit,
        )
        for index in map(int, named)
    )


def sparse_basis(null: Floats) -> Floats:
    """Sparse basis of the row space of `null`, (n_directions, n_params), by Gauss-Jordan elimination with pivoting."""
    rows = np.array(null)
    pivots: list[int] = []
    for index in range(len(rows)):
        size = np.abs(rows[index])
        size[pivots] = 0.0
        pivots.append(int(np.argmax(size)))
        rows[index] /= rows[index, pivots[-1]]
        others = np.delete(np.arange(len(rows)), index)
        rows[others] -= np.outer(rows[others, pivots[-1]], rows[index])
    return np.where(np.abs(rows) > _NEGLIGIBLE * np.max(np.abs(rows), axis=1, keepdims=True), rows, 0.0)


def simple_combinations(changes: Sequence[ParameterChange], *, within: float = _SIMPLE) -> tuple[str, ...]:
    """Products and ratios of two parameters with simple exponents that are constant along a direction.

    Along `d ln p_i = v_i` the product `p_i^a p_j^b` is constant if `a v_i + b v_j = 0`, `within` a relative tolerance.
    """
    if any(change.of_range for change in changes):
        return ()
    combinations = []
    for number, second in enumerate(changes):
        joined = (_combination(first, second, within) for first in changes[:number])
        combinations += list(filter(None, joined))[:1]
    return tuple(combinations)


def _combination(first: ParameterChange, second: ParameterChange, within: float) -> str:
    """Combination such as "alpha A", "gamma/beta", "alpha^2 A"; empty without simple exponents."""
    ratio = first.percent / second.percent
    simple = Fraction(ratio).limit_denominator(_LARGEST_DENOMINATOR)
    power, other = simple.denominator, abs(simple.numerator)
    if other == 0 or other > _LARGEST_EXPONENT or abs(float(simple) - ratio) > within * abs(ratio):
        return ""
    powers = [
        name if exponent == 1 else f"{name}^{exponent}"
        for name, exponent in ((first.name, power), (second.name, other))
    ]
    return ("/" if ratio > 0 else " ").join(powers)


def join_parts(parts: Sequence[str]) -> str:
    """Enumeration such as "a, b and c"."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


# Tolerance of exponents for combinations along weakly identifiable directions.
_APPROXIMATE = 0.05
# Smallest correlation at which a partner is named.
_STRONG_CORRELATION = 0.9


def judged(
    parameters: Sequence[FittedParameter],
    jacobian: Floats,
    covariance: Floats,
    *,
    scales: Sequence[Scale],
    held: frozenset[str] = frozenset(),
    coherent: float = 1.0,
) -> tuple[tuple[FittedParameter, ...], tuple[Direction, ...]]:
    """Parameters with standard errors and verdicts, and the directions that the data determine weakly or not at all.

    From the derivative of the residuals, (n_residuals, n_params), and the covariance, both in units of the scales. A
    direction is unidentifiable if its singular value, parameters scaled to unit sensitivity, is below `INSENSITIVE` of
    the largest, and weakly identifiable if the standard error along it exceeds `WEAK` of the scale. Parameters that
    were `held` get no verdict, but where an unidentifiable direction has one, its others are determined. `coherent` see
    `Fit.coherent`.
    """
    null = _null_space(jacobian)
    unseen = tuple(_unidentifiable_direction(row, jacobian, scales, held) for row in null)
    involved = [{change.name for change in direction.changes} for direction in unseen]
    open_names = held.union(*(names for names in involved if not held & names))
    is_open = np.array([scale.name in open_names for scale in scales], dtype=np.bool_)
    determined = np.isfinite(np.diag(covariance)) & ~is_open
    judged_parameters = [
        parameter
        if parameter.name in held
        else _judged(index, parameter, scales, covariance, jacobian, determined, held, coherent)
        for index, parameter in enumerate(parameters)
    ]
    weak = _weak_directions(
        covariance[np.ix_(determined, determined)],
        jacobian[:, determined],
        [scale for scale, is_determined in zip(scales, determined, strict=True) if is_determined],
    )
    return tuple(judged_parameters), unseen + weak


def _null_space(jacobian: Floats) -> Floats:
    """Sparse basis of the unidentifiable directions in units of unit sensitivity, shape (n_directions, n_params)."""
    if jacobian.shape[1] == 0:
        return np.empty((0, 0))
    unit = jacobian / _effects(jacobian)
    _, singular, right = np.linalg.svd(unit, full_matrices=len(jacobian) < jacobian.shape[1])
    short = np.concatenate([singular, np.zeros(len(right) - len(singular))])
    null = right[short <= INSENSITIVE * max(singular[0], 1e-300)]
    return sparse_basis(null) if len(null) else null


def _effects(jacobian: Floats) -> Floats:
    """Change of the force per change of each parameter, shape (n_params,); 1 for one without effect."""
    norm = np.linalg.norm(jacobian, axis=0)
    return np.asarray(np.where(norm == 0.0, 1.0, norm))


def _unidentifiable_direction(
    direction: Floats, jacobian: Floats, scales: Sequence[Scale], held: Set[str]
) -> Direction:
    effects = _effects(jacobian)
    changes = changes_along(direction / effects, scales, effects)
    if len(changes) == 1:
        sentence = f"the residuals do not depend on {changes[0].name}"
    else:
        combinations = simple_combinations(changes)
        only = f"; combinations such as {join_parts(combinations)} can be identified" if combinations else ""
        sentence = (
            f"{join_parts([change.name for change in changes])} cannot be distinguished: {_joint_change(changes)} "
            f"does not change the force{only}"
        )
    held_names = [change.name for change in changes if change.name in held]
    if held_names:
        sentence += f"; {join_parts(held_names)} was held fixed for this reason"
    return Direction(
        changes=changes, effect=_effect(changes, jacobian, scales), seen=False, sentence=sentence
    )


def _weak_directions(cov: Floats, jacobian: Floats, scales: Sequence[Scale]) -> tuple[Direction, ...]:
    """Directions along which the standard error exceeds `WEAK` of the scales, largest first."""
    if not len(cov):
        return ()
    variances, vectors = np.linalg.eigh(cov)
    directions = []
    for variance, vector in zip(variances[::-1], vectors.T[::-1], strict=True):
        # Of a nearly singular covariance the least eigenvalues may be negative by rounding.
        if variance <= WEAK**2:
            break
        # The parameter with the largest component comes first.
        largest = int(np.argmax(np.abs(vector)))
        order = np.argsort(np.arange(len(scales)) != largest, kind="stable")
        changes = changes_along(vector[order], [scales[index] for index in order])
        effect = _effect(changes, jacobian, scales)
        names = [parameter_scale.name for parameter_scale in scales]
        in_order = sorted(changes, key=lambda change: names.index(change.name))
        combinations = simple_combinations(in_order, within=_APPROXIMATE)
        better = f"; {join_parts(combinations)} is better identifiable" if combinations else ""
        along = float(np.sqrt(variance)) * abs(vector[largest])
        sentence = (
            f"{_joint_change(changes)} changes the force by no more than {100.0 * effect:.1g} % of its deviation, so "
            f"along it the standard error of {changes[0].name} is {scales[largest].share(along)}{better}"
        )
        directions.append(Direction(changes=changes, effect=effect, seen=True, sentence=sentence))
    return tuple(directions)


def _joint_change(changes: Sequence[ParameterChange]) -> str:
    first, *rest = [change.in_words for change in changes]
    return f"{first} with {join_parts(rest)}" if rest else first


def _effect(changes: Sequence[ParameterChange], jacobian: Floats, scales: Sequence[Scale]) -> float:
    column = {parameter_scale.name: number for number, parameter_scale in enumerate(scales)}
    moved = sum(0.01 * change.percent * jacobian[:, column[change.name]] for change in changes)
    return float(np.linalg.norm(moved))


def _judged(
    number: int,
    parameter: FittedParameter,
    scales: Sequence[Scale],
    cov: Floats,
    jacobian: Floats,
    determined: NDArray[np.bool_],
    held: Set[str],
    coherent: float,
) -> FittedParameter:
    scale = scales[number]
    if not determined[number]:
        undetermined = [scales[index].name for index in np.flatnonzero(~determined).tolist()]
        others = [name for name in undetermined if name not in {scale.name, *held}]
        reason = "the residuals do not depend on it"
        if others and np.any(jacobian[:, number] != 0.0):
            reason = f"identifiable only in combination with {join_parts(others)}"
        return replace(parameter, verdict=Verdict("not identifiable", reason), standard_error=None)
    error = float(np.sqrt(cov[number, number]))
    sensitivity = float(np.linalg.norm(jacobian[:, number])) / scale.size
    verdict = judge_error(error * scale.size, scale, sensitivity, coherent)
    if verdict.word in ("weakly identifiable", "sign unknown"):
        deviation = np.sqrt(np.where(determined, np.diag(cov), 1.0))
        correlation = np.where(determined, cov[number] / (error * deviation), 0.0)
        correlation[number] = 0.0
        partner = int(np.argmax(np.abs(correlation)))
        if abs(correlation[partner]) > _STRONG_CORRELATION:
            other = scales[partner].name
            because = f"mostly because {other} can compensate for it (correlation {correlation[partner]:.3f})"
            verdict = Verdict(verdict.word, f"{verdict.reason}; {because}")
    told = error * scale.size if error <= _BEYOND else None
    return replace(parameter, verdict=verdict, standard_error=told)


def fitted_parameters(
    problem: Problem, theta: Floats, covariance: Covariance | None, coherent: float = 1.0
) -> tuple[tuple[FittedParameter, ...], tuple[Direction, ...]]:
    """Parameters of the requested model at `theta` of the problem's form, (n_params,), and directions; see `judged`.

    Nothing is judged without a covariance. A parameter that was held fixed to remove a redundant scale, such as `A` of
    the Spencer Bouc-Wen, gets no verdict, but the redundant direction is named. A parameter on its bound counts as
    known for the others.
    """
    spec, form, ties = problem.spec, problem.form, problem.settings.ties
    box = Box.of(spec).with_bounds(problem.settings.bounds)
    values, states = np.asarray(form.to_model(theta)), states_of(form, theta)
    errors = np.full(values.shape, np.nan) if covariance is None else covariance.standard_errors
    estimates: list[FittedParameter] = []
    for index, (parameter, state) in enumerate(zip(spec.parameters, states, strict=True)):
        tie = ties.get(parameter.name, "")
        verdict = Verdict("fixed") if state == "fixed" else Verdict("", state)
        has_error = not state and np.isfinite(errors[index])
        estimates.append(
            FittedParameter(
                name=parameter.name,
                value=float(values[index]),
                unit=parameter.unit,
                standard_error=float(errors[index]) if has_error else None,
                lower=box.lower[index],
                upper=box.upper[index],
                state=state,
                verdict=Verdict("tied", f"it is {tie}") if tie else verdict,
                tie=tie,
            )
        )
    if covariance is None:
        return tuple(estimates), ()
    # What is tied follows from the others, and has no verdict of its own.
    free = [index for index in box.free if spec.names[index] not in ties]
    for index in free:
        if estimates[index].at_bound:
            one_sided = Verdict(
                "weakly identifiable", f"{states[index]}: the data bound it from one side only"
            )
            estimates[index] = replace(estimates[index], verdict=one_sided)
    taken = [index for index in free if states[index] == "" or spec.names[index] in form.fixed]
    every = parameter_scales(spec, box, problem.objective.tests, values)
    scales = [every[index] for index in taken]
    # Signed, so that the magnitude of a negative value increases, and products and ratios keep their form.
    size = np.array([scale.size if scale.of_range or scale.value >= 0.0 else -scale.size for scale in scales])
    judged_estimates, directions = judged(
        [estimates[index] for index in taken],
        covariance.slopes.by_model()[:, taken] * size,
        covariance.matrix[np.ix_(taken, taken)] / np.outer(size, size),
        scales=scales,
        coherent=coherent,
        # Fixed by the form for the sake of a redundant scale, not by the user.
        held=frozenset(estimate.name for estimate in estimates if not estimate.is_free) & {*form.fixed},
    )
    for index, estimate in zip(taken, judged_estimates, strict=True):
        estimates[index] = estimate
    averaged = max(map(seconds_of_pulses, problem.objective.tests))
    return tuple(_beside_pulses(estimate, averaged) for estimate in estimates), directions


def _beside_pulses(estimate: FittedParameter, averaged: float) -> FittedParameter:
    """The rate of a driver is not known from a command that is a mean over more than its time [s]."""
    if estimate.name not in RATE_NAMES or averaged * estimate.value <= 1.0:
        return estimate
    reason = (
        f"the command is the mean of pulses over {1e3 * averaged:.3g} ms, which tells no rate above "
        f"{1.0 / averaged:.2g} 1/s"
    )
    return replace(estimate, verdict=Verdict("not identifiable", reason))
