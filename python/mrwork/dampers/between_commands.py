"""Laws between the tested commands, where no test shows them: extrema, the least curved form, how far forms differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.hints import SMALLEST
from mrwork.base.numbers import of_unit
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.dampers.dependence import CURVE_FORMS, SATURATING_FORMS, Dependence, dependence_through
from mrwork.dampers.parameters import ParamSpec
from mrwork.dampers.simulation import Loading, simulate_forces
from mrwork.dampers.spec import VANISHED, DamperSpec, by_parameter, plain_parameters
from mrwork.dampers.tested_range import OperatingRange

# Share of the larger of a law's values at two neighbouring commands by which it may pass both between them.
_OVERSHOOT = 0.05
_PER_GAP = 41
_EXTREMUM = RemarkKind(
    "extremum_untested",
    "the law of {0} has an extremum between the tested commands {low:.3g} and {high:.3g} {1}, {extreme} at {command}, "
    "that no test shows",
    "test there, or {remedy}",
)
# Cycles of a sine between two commands, of which the last one counts, and its samples.
_CYCLES, _PER_CYCLE = 3, 200
# Share of its values by which a curve that is said to go through them misses one at most.
_THROUGH = 1e-6
LAWS_OPEN = RemarkKind(
    "laws_open_between_commands",
    "no test tells the law of {0} between the tested commands: at {command} forms through the same values differ by "
    "{value:.2g} % of the force, which a test there would tell",
)


class HiddenExtremum(NamedTuple):
    """An extremum of a law between two tested commands, and a law through the same values that has none."""

    parameter: str
    instead: Dependence | None
    remark: Remark


def hidden_extrema(spec: DamperSpec, theta: ArrayLike, levels: Sequence[float]) -> tuple[HiddenExtremum, ...]:
    """For each parameter the largest extremum of its law between neighbouring tested commands, lowest first.

    There the law passes its values at both commands by more than 5 % of the larger of them.
    """
    if spec.command_unit is None or len(levels) < 2:
        return ()
    unit, command = spec.command_unit, np.linspace(levels[:-1], levels[1:], _PER_GAP)
    extrema = []
    by_law = by_parameter(spec, np.asarray(theta, dtype=np.float64))
    for (parameter, law), coefficients in zip(spec.law_pairs, by_law, strict=False):
        share, value = _passing(law, coefficients, command)
        if share.max() <= _OVERSHOOT:
            continue
        most = int(np.argmax(share))
        instead = _least_curved(parameter, law.other_forms(parameter), coefficients, command)
        low, high = (levels[most % command.shape[1] + end] for end in (0, 1))
        extreme = Measured(float(value.flat[most]), "" if parameter.unit == "1" else parameter.unit)
        remark = _EXTREMUM.remark(
            parameter.name,
            unit,
            measured=extreme,
            low=low,
            high=high,
            extreme=of_unit(extreme.value, extreme.unit, 3),
            command=of_unit(float(command.flat[most]), unit, 3),
            remedy=f"give {parameter.name}={instead} as its law" if instead else "choose another law",
        )
        extrema.append(HiddenExtremum(parameter.name, instead, remark))
    return tuple(extrema)


def least_curved(spec: DamperSpec, theta: ArrayLike, levels: Sequence[float]) -> dict[str, Dependence]:
    """For each parameter with a law by values the least curved form through these without an extremum between levels.

    Straight lines are taken where all curves have one; a parameter of which all forms have one is left out.
    """
    command = np.linspace(levels[:-1], levels[1:], _PER_GAP)
    by_law = by_parameter(spec, np.asarray(theta, dtype=np.float64))
    found = {
        parameter.name: _least_curved(parameter, [law, *law.other_forms(parameter)], coefficients, command)
        for (parameter, law), coefficients in zip(spec.law_pairs, by_law, strict=False)
        if law.nodes
    }
    return {name: law for name, law in found.items() if law is not None}


class FormThrough(NamedTuple):
    """A law through values at the tested commands, and its coefficients."""

    law: Dependence
    coefficients: Floats


def forms_through(
    spec: DamperSpec, theta: ArrayLike, levels: Sequence[float]
) -> dict[str, tuple[FormThrough, ...]]:
    """For each parameter whose law has as many coefficients as there are levels, the forms through its values there.

    Without those that have an extremum between levels, or leave the range of the parameter. Of two values a curve that
    saturates has a rate of one over their distance, which no test tells.
    """
    if spec.command_unit is None or len(levels) < 2:
        return {}
    found = dict[str, tuple[FormThrough, ...]]()
    command, nodes = np.linspace(levels[:-1], levels[1:], _PER_GAP), np.array(levels)
    by_law = by_parameter(spec, np.asarray(theta, dtype=np.float64))
    for (parameter, law), coefficients in zip(spec.law_pairs, by_law, strict=False):
        if law.is_constant or law.n_coefficients != len(levels):
            continue
        values = np.clip(law.values(coefficients, nodes), parameter.lower, parameter.upper)
        straight = dependence_through(levels, "straight")
        through = [FormThrough(form, values) for form in (straight, *straight.other_forms(parameter))]
        for form in SATURATING_FORMS:
            curve = dependence_through((levels[0], levels[-1]), form)
            fitted = np.array(curve.through(parameter, nodes, values))
            if np.allclose(curve.values(fitted, nodes), values, rtol=_THROUGH):
                through.append(FormThrough(curve, fitted))
        found[parameter.name] = tuple(
            each for each in through if _is_smooth(parameter, *_passing(each.law, each.coefficients, command))
        )
    return found


def _is_smooth(parameter: ParamSpec, share: Floats, value: Floats) -> bool:
    """Whether a law stays in its range and has no extremum, by what it passes and its values at commands."""
    lowest = max(parameter.lower, parameter.is_positive * VANISHED * value.max())
    return bool(share.max() <= _OVERSHOOT and lowest <= value.min() and value.max() <= parameter.upper)


def _least_curved(
    parameter: ParamSpec, laws: Sequence[Dependence], coefficients: Floats, command: Floats
) -> Dependence | None:
    """Of laws through the same values the least curved one within its range and without an extremum.

    `command` has a column for each gap, (n_per_gap, n_gaps). The curvature is the integral of the squared second
    derivative. Straight lines, whose kinks have none, come last, in their order.
    """
    best, least = None, np.inf
    every = np.linspace(command.min(), command.max(), 2 * command.size)
    for law in laws:
        if not _is_smooth(parameter, *_passing(law, coefficients, command)):
            continue
        curvature = float(np.sum(np.diff(law.values(coefficients, every), 2) ** 2))
        if best is None or (not law.is_straight and (best.is_straight or curvature < least)):
            best, least = law, curvature
    return best


def _passing(law: Dependence, coefficients: Floats, command: Floats) -> tuple[Floats, Floats]:
    """By which share of the larger end of its gap a law passes both ends at each command, and its values there."""
    value = law.values(coefficients, command.ravel()).reshape(command.shape)
    ends = value[[0, -1]]
    beyond = np.maximum(value - ends.max(axis=0), ends.min(axis=0) - value)
    return beyond / np.maximum(np.abs(ends).max(axis=0), SMALLEST), value


def open_between_commands(spec: DamperSpec, theta: ArrayLike, tested: OperatingRange) -> Remark | None:
    """How far forms of laws that no test tells apart differ where they differ most, halfway between tested commands.

    These laws have as many coefficients as there are tested commands. The motion is the sine of the tested stroke and
    velocity; `percent` is the root mean square of the largest minus the least force, per that of the force. `None`
    where the tests at other commands tell the forms of all laws, or there is no tested motion.
    """
    coefficients = np.asarray(theta, dtype=np.float64)
    forms = forms_through(spec, coefficients, tested.levels)
    if not forms or not (tested.stroke > 0.0 and tested.velocity > 0.0):
        return None
    omega = tested.velocity / tested.stroke
    dt = 2.0 * np.pi / (omega * _PER_CYCLE)
    motion = Loading(
        dt=dt, displacement=tested.stroke * np.sin(omega * dt * np.arange(_CYCLES * _PER_CYCLE + 1))
    )
    levels = np.array(tested.levels)
    percents = list[float]()
    halfway = 0.5 * (levels[:-1] + levels[1:])
    for command in halfway.tolist():
        rows = _plain_in_forms(spec, coefficients, forms, command)
        force = simulate_forces(spec.without_laws, rows, motion.history()).force[:, -_PER_CYCLE:]
        scale = float(np.linalg.norm(force[0]))
        force = force[np.isfinite(force).all(axis=1)]
        is_known = np.isfinite(scale) and scale > 0.0
        percents.append(100.0 * float(np.linalg.norm(np.ptp(force, axis=0))) / scale if is_known else 0.0)
    worst = int(np.argmax(percents))
    at = of_unit(float(halfway[worst]), tested.command_unit or "", 3)
    return LAWS_OPEN.remark(list_names([*forms]), measured=Measured(percents[worst], "%"), command=at)


def _plain_in_forms(
    spec: DamperSpec, theta: Floats, forms: Mapping[str, tuple[FormThrough, ...]], command: float
) -> Floats:
    """Parameters of the plain model at a command by its own laws, then by each form, (1 + n_forms, n_plain)."""
    names, own = [parameter.name for parameter, _ in spec.law_pairs], plain_parameters(spec, theta, command)
    every = (*CURVE_FORMS, *SATURATING_FORMS)
    rows = np.tile(own, (1 + len(every), 1))
    for name, through in forms.items():
        for form in through:
            value = form.law.values(form.coefficients, np.float64(command))
            rows[1 + every.index(form.law.form), names.index(name)] = value
    return rows
