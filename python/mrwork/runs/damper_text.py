"""The damper of a fit as text: a table of its force over velocity and command, and at one command for OpenSees.

Of OpenSees these are materials in Tcl, and in Python for openseespy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import astuple
from math import ceil
from typing import Literal

import numpy as np

from mrwork.base.numbers import of_unit
from mrwork.base.table import csv_text
from mrwork.base.values import Floats
from mrwork.dampers.command import command_noise
from mrwork.dampers.conventions import USUAL_OPENSEES_ERROR, opensees_from_bouc_wen, require_bounded_loop
from mrwork.dampers.conversions import bouc_wen_from_normalised, normalised_from_bouc_wen
from mrwork.dampers.coordinates import Box, bound_at
from mrwork.dampers.parameters import DRIVER_RATES
from mrwork.dampers.simulation import refuse_failure, simulate_forces, sinusoid
from mrwork.dampers.spec import law_limits, plain_parameters
from mrwork.errors import SettingError
from mrwork.identification.fit import Fit, FittedParameter
from mrwork.records.columns import StatedCommand

_SPEEDS = 20
_COMMANDS = 5
# The force is taken in the third cycle: the hysteresis has forgotten the start.
_CYCLES = 3
_PER_CYCLE = 2000


def force_table(fit: Fit, stated: StatedCommand | None) -> str:
    """Force [N] in the middle of the stroke over peak velocity [m/s], both ways, and command.

    Of harmonic tests of the largest tested stroke: a damper with hysteresis has no force over velocity alone. Rows go
    over evenly spaced velocities up to the largest tested one, for the commands over the tested range, or for one.
    """
    refuse_bounds(fit)
    tested, spec = fit.tested, fit.spec
    if tested is None or tested.velocity == 0.0:
        raise SettingError(
            "the tested ranges of this fit are not known, and the table goes over them; run mrwork identify again"
        )
    commands: Sequence[float | None]
    if stated is None and spec.follows_command and tested.command is not None:
        commands = levels = np.linspace(*tested.command, _COMMANDS).tolist()
        theta = np.stack([plain_parameters(spec, fit.theta, command) for command in levels])
    else:
        values, command = parameters_at_stated(fit, stated)
        commands, theta = [command], values[None]
    heading = [f"command [{spec.command_unit}]"] if spec.command_unit else []
    remarks = ["; ".join(_left_out(fit, command)) for command in commands]
    # Readers of numbers take no words, so that there is a column for them only where there are some.
    remark = ["remark"] if any(remarks) else []
    lines = [[*heading, "velocity [m/s]", "force [N]", "amplitude [m]", "frequency [Hz]", *remark]]
    speeds = tested.velocity * np.arange(1, _SPEEDS + 1) / _SPEEDS
    forces = np.stack([_forces(fit, theta, tested.stroke, float(speed)) for speed in speeds])
    velocity = np.concatenate([-speeds[::-1], speeds])
    force = np.concatenate([forces[::-1, :, 1], forces[:, :, 0]])
    frequency = np.abs(velocity) / (2.0 * np.pi * tested.stroke)
    for number, (command, words) in enumerate(zip(commands, remarks, strict=True)):
        columns = velocity, force[:, number], np.full_like(velocity, tested.stroke), frequency
        first, last = [] if command is None else [repr(command)], [words] if remark else []
        lines += [[*first, *map(repr, row), *last] for row in np.stack(columns, axis=1).tolist()]
    return csv_text(lines)


def _forces(fit: Fit, theta: Floats, amplitude: float, speed: float) -> Floats:
    """Force at the passages through the middle with and against `speed` [m/s], shape (n_commands, 2)."""
    motion = sinusoid(amplitude, speed, cycles=_CYCLES, per_cycle=_PER_CYCLE)
    run = simulate_forces(fit.spec.without_laws, theta, motion.history())
    refuse_failure(f"{fit.model} at {speed:.3g} m/s", int(run.outcome.max()))
    first = (_CYCLES - 1) * _PER_CYCLE
    return np.asarray(run.force[:, [first, first + _PER_CYCLE // 2]])


def refuse_bounds(fit: Fit) -> None:
    """Refuse a fit with a parameter on a bound that was given, or on the end of the range of its search.

    A better fit may lie beyond such a bound, and not beyond the model's own.
    """
    admissible = Box.of(fit.spec)
    for index, (estimate, spec) in enumerate(zip(fit.estimates, fit.spec.parameters, strict=True)):
        side = _side(estimate)
        given = getattr(estimate, side) != getattr(spec, side)
        searched = spec.coefficient is not None and not bound_at(admissible, index, estimate.value)
        if estimate.at_bound and (given or searched):
            is_at = (
                f"the {side} bound that was given"
                if given
                else "the end of the range in which its law was searched"
            )
            raise SettingError(
                f"{estimate.name} is at {of_unit(estimate.value, estimate.unit)}, {is_at}, and a better fit may lie "
                f"beyond; fit again by mrwork identify with a wider --bound {estimate.name}=LOWER:UPPER, the model "
                f"admits {spec.lower:g} to {spec.upper:g}, or with --fix {estimate.name}={estimate.value:.6g}, and "
                "export that"
            )


def _side(estimate: FittedParameter) -> Literal["lower", "upper"]:
    return "lower" if estimate.state == "at lower bound" else "upper"


def parameters_at_stated(fit: Fit, stated: StatedCommand | None) -> tuple[Floats, float | None]:
    """Parameters of the plain model at a command, shape (n_plain,), and the command in the unit of the laws."""
    unit, tested = fit.spec.command_unit, fit.tested.command
    if unit is None:
        if stated is not None:
            raise SettingError(
                "this fit has no current laws, so its damper is the same at any command; leave the command out"
            )
        return plain_parameters(fit.spec, fit.theta, 0.0), None
    if stated is None or stated.value is None or stated.unit != unit:
        raise SettingError(
            f"the laws of this fit take the command in {unit}; give a number with that unit, as in 0.5{unit}"
        )
    value, noise = stated.value, command_noise(0.0, unit)
    if tested is not None and not tested[0] - noise <= value <= tested[1] + noise:
        raise SettingError(
            f"{of_unit(value, unit)} is outside the tested commands, {tested[0]:g} to "
            f"{of_unit(tested[1], unit)}; give one within"
        )
    if limits := law_limits(fit.spec, fit.theta, (value, value)):
        raise SettingError(f"{limits[0].in_words}; give another command")
    return plain_parameters(fit.spec, fit.theta, value), value


USUAL_TIME_STEP = 0.001
"""Step [s] of an analysis in OpenSees where none is given."""
# As many as the package itself takes in a step.
_MOST_SUBSTEPS = 256


# Models that are BoucWen beside a dashpot and a spring, with the conversion to the normalised form.
_NORMALISED: dict[str, Callable[[Floats], Floats]] = {
    "normalised_bouc_wen": lambda theta: theta,
    "bouc_wen": lambda theta: np.asarray(normalised_from_bouc_wen(require_bounded_loop(theta))),
}


def opensees_text(
    fit: Fit, stated: StatedCommand | None, *, error: float | None, time_step: float | None, tcl: bool
) -> str:
    """The damper of a fit at a command, with the strain step and the sub-steps that keep the wanted error.

    In Tcl `damper TAG` makes it, for openseespy `damper(tag)`. The loop is BoucWen with z up to 1, from where the
    iteration of OpenSees starts near enough; dashpot and spring are materials of their own, the spring with the free
    length x0 as an initial strain.
    """
    if fit.model not in _NORMALISED:
        raise SettingError(
            f"OpenSees has no material that equals {fit.model}; fit {' or '.join(_NORMALISED)}, or export to csv"
        )
    refuse_bounds(fit)
    theta, command = parameters_at_stated(fit, stated)
    normalised = _NORMALISED[fit.model](theta)
    c, k, x0, k_w, rho, sigma, _ = normalised.tolist()
    loop = normalised * np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0])
    bouc_wen, _ = opensees_from_bouc_wen(bouc_wen_from_normalised(loop, A=rho), Ao=rho)
    wanted = USUAL_OPENSEES_ERROR if error is None else error
    step = bouc_wen.strain_step(wanted)
    at = "" if command is None else f" at {of_unit(command, fit.spec.command_unit or '')}"
    facts = [
        f"{fit.spec.title}{at}, fit {fit.fit_in_words}; units N, m, s",
        f"for an error of the hysteretic force below {100.0 * wanted:g} % of its largest value, {k_w:.4g} N,",
        f"let the strain change by at most {step:.3g} m in a step: the error of OpenSees is proportional to it",
    ]
    if fit.tested.velocity > 0.0:
        facts.append(_substeps_in_words(fit.tested.velocity, step, time_step or USUAL_TIME_STEP, sigma))
    facts += [
        f"{estimate.name} is on the {_side(estimate)} bound of the model, "
        f"{of_unit(estimate.value, estimate.unit)}"
        for estimate in fit.estimates
        if estimate.at_bound
    ]
    facts += _left_out(fit, command)
    if k and x0:
        facts.append(f"the spring is free at {x0:.4g} m: at rest the force is {-k * x0:.4g} N")

    def tag(number: int) -> str:
        return f"[expr {{$tag + {number}}}]" if tcl else f"tag + {number}"

    def material(kind: str, number: int, *words: str) -> str:
        words = (tag(number), *words)
        if tcl:
            return f"    uniaxialMaterial {kind} {' '.join(words)}"
        return f'    ops.uniaxialMaterial("{kind}", {", ".join(words)})'

    parts = [
        ("BoucWen", astuple(bouc_wen)),
        ("Viscous", (c, 1.0) if c else ()),
        ("Elastic", (k,) if k else ()),
    ]
    present = [(kind, map(repr, arguments)) for kind, arguments in parts if arguments]
    lines = [material(kind, number, *words) for number, (kind, words) in enumerate(present, start=1)]
    joined = [*range(1, len(lines) + 1)]
    if k and x0:
        lines.append(material("InitStrainMaterial", len(lines) + 1, tag(joined[-1]), repr(-x0)))
        joined[-1] = len(lines)
    lines.append(material("Parallel", 0, *map(tag, joined)))
    if tcl:
        lines = ["proc damper {tag} {", *lines, "}"]
    else:
        lines = ["import openseespy.opensees as ops", "", "", "def damper(tag: int) -> None:", *lines]
    return "\n".join([*(f"# {fact}" for fact in facts), *lines, ""])


def _left_out(fit: Fit, command: float | None) -> list[str]:
    """What the parameters at a command leave out: observation model, lag of the driver, gap of the tested commands."""
    facts = [fit.observation_in_words] if fit.observation_in_words else []
    rates = [fit.parameters[rate.name] for rate in DRIVER_RATES[fit.spec.lag]]
    if rates:
        found = " and ".join(f"{rate.name} {of_unit(rate.value, rate.unit, 4)}" for rate in rates)
        facts.append(f"the lag of the driver is not in it: {found}")
    gap, unit = fit.tested.gap, fit.tested.command_unit
    if command is not None and gap is not None and gap[0] < command < gap[1]:
        facts.append(f"no test is between {gap[0]:g} and {gap[1]:g} {unit}: its laws are interpolated there")
    return facts


def _substeps_in_words(velocity: float, step: float, time_step: float, sigma: float) -> str:
    """How many parts of a time step a velocity [m/s] needs for a strain step [m]; refused where they are too many.

    They grow with sigma, the steepness of unloading.
    """
    count = ceil(velocity * time_step / step)
    if count > _MOST_SUBSTEPS:
        steep = ", or mrwork identify --model normalised_bouc_wen --fix sigma=0.5, which unloads less steeply"
        less = steep if sigma > 1.0 else ""
        raise SettingError(
            f"OpenSees would need {count} sub-steps of {time_step:g} s at the largest tested velocity, {velocity:.3g} "
            f"m/s, and {_MOST_SUBSTEPS} are the most; give a larger error or a shorter time step{less}"
        )
    return (
        f"at the largest tested velocity, {velocity:.3g} m/s, these are {count} sub-steps of {time_step:g} s"
    )
