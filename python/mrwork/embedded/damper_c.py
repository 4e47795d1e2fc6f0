"""A damper as C: its formulas printed by the core, in a frame that steps them from sample to sample."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrwork import _rust
from mrwork.base.numbers import of_unit
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.between_commands import open_between_commands
from mrwork.dampers.parameters import MOST_SUBSTEPS
from mrwork.dampers.simulation import Loading, Outcome, refuse_failure, simulate_forces
from mrwork.dampers.spec import DamperSpec
from mrwork.dampers.tested_range import OperatingRange
from mrwork.embedded.c_source import CSource, Flavour, Signal, c_names, head_of, status_of, table_rows
from mrwork.embedded.halving import Halving, halving_of, straight_forces
from mrwork.errors import SettingError

_SAMPLES = 1000
_CYCLES = 2.5
# Samples of a cycle below which straight lines are no motion of a rig.
_FEWEST = 20
# Commands of the check, one after the other, as shares of the tested range, and the samples that each stays.
_COMMANDS = (0.0, 1.0, 0.25, 0.7)
_HELD = 125
# Displacement that is believed at least [m], and multiple of the tested stroke: its origin is anywhere.
_ANYWHERE, _STROKES = 1.0, 10.0
# Multiple of the tested frequency at which the velocity that is believed may alternate: beyond, one sample is a glitch.
_FASTER = 5.0
# Samples of the check's fast part, and its frequency as a multiple of the tested one: eight strokes of travel.
_FAST_SAMPLES, _FAST_CYCLES = 200, 2.5
# Factor on sub-steps whose force is taken for right.
_FINEST = 16
# A demand beyond the tested range by less is within it, as `OperatingRange.exceeded_by` has it.
_TOLERANCE = 0.05


@array_dataclass()
class Sampled:
    """Motion and command at samples, shape (n_time,), and the force that straight lines between them give [N]."""

    displacement: Floats
    velocity: Floats
    command: Floats
    force: Floats


def damper_source(
    name: str,
    spec: DamperSpec,
    theta: Floats,
    tested: OperatingRange,
    flavour: Flavour,
    *,
    sample_time: float,
    origin: Sequence[str] = (),
) -> CSource:
    """The C of a damper with parameters `theta`, shape (n_params,): NAME.h, NAME.c, and NAME_check.c with a test.

    `origin` are sentences on where the parameters are from.
    """
    motion = _motion_of_check(spec, tested, sample_time)
    sine = simulate_forces(spec, theta[None], _sine(spec, tested, sample_time).history())
    if sine.outcome[0] == Outcome.UNRESOLVED:
        raise SettingError(
            f"{spec.name} needs more than {MOST_SUBSTEPS} sub-steps in a sample of {of_unit(sample_time, 's')}; give a "
            "shorter --time-step (in Python `time_step`)"
        )
    refuse_failure(spec.name, int(sine.outcome[0]))
    halving = halving_of(spec, theta, tested, sample_time=sample_time, substeps=int(sine.substeps[0]))
    substeps = halving.substeps
    samples = _sampled(spec, theta, motion, sample_time, halving)
    names = c_names([parameter.name for parameter in spec.parameters])
    laws = [str(law) for law in spec.laws]
    text = _rust.damper_text(
        spec.core_name,
        [f"parameters->{each}" for each in names],
        [sample_time / (substeps << halvings) for halvings in range(len(halving.speeds))],
        laws,
        spec.n_rates,
        flavour.single,
    )
    unit = spec.command_unit or "A"
    parameters = tuple(
        Signal(
            name=c_name, unit=each.unit, description=f"{each.name}: {each.description}", value=float(value)
        )
        for c_name, each, value in zip(names, spec.parameters, theta, strict=True)
    )
    notes = (
        _of_straight_lines(spec, theta, tested, motion, samples, sample_time, halving),
        _of_halving(halving, tested),
    )
    between = open_between_commands(spec, theta, tested)
    open_laws = () if between is None else (between.as_sentence,)
    head = [
        *spec.equation.split("\n"),
        "",
        *origin,
        f"Tested: {tested.in_words}",
        f"Source of the model: {spec.source}",
        *open_laws,
        *notes,
    ]
    n_params = len(spec.without_laws.parameters)
    limits = _limits(spec, tested, halving)
    words = {
        "name": name,
        "macro": name.upper(),
        "title": f"{spec.title} damper, in SI",
        "unit": unit,
        "head": head_of(name, head),
        "n_states": spec.n_states,
        "n_kept": max(spec.n_states, 1),
        "n_params": n_params,
        "lagged": int(spec.n_rates > 0),
        "n_decays": max(spec.n_rates, 1),
        "sample_time": flavour.number(sample_time),
        "substeps": substeps,
        "substep_seconds": flavour.number(sample_time / substeps),
        "fields": "\n".join(
            f"    {flavour.real} {each.name};  /* [{each.unit}] {each.description} */" for each in parameters
        ),
        "values": "\n".join(
            f"    {flavour.number(each.value or 0.0)},  /* {each.name} */" for each in parameters
        ),
        "believed": ", ".join(map(flavour.number, limits["believed"])),
        "tested": ", ".join(map(flavour.number, limits["tested"])),
        "speeds": ", ".join(map(flavour.number, halving.speeds)),
        "fading": flavour.number(halving.fading),
        "most_halvings": len(halving.speeds) - 1,
        "status": status_of(
            name.upper(),
            ("displacement", "velocity", "command"),
            "command_limited",
            "outside_tested",
            "state_healed",
            "sample_missed",
            "parameters_refused",
        ),
        "take": "" if spec.n_rates else f"    {name}_carry(m, to.command);\n",
        **flavour.preamble(calls=text["calls"]),
        **text,
        **_with_lag(n_params, len(names), text, flavour, spec),
    }
    return CSource(
        name=name,
        kind="damper",
        description=f"{spec.title} damper",
        files={
            f"{name}.h": flavour.fill("damper.h", **words),
            f"{name}.c": flavour.fill("damper.c", **words),
            f"{name}_check.c": _check(
                name, _and_fast(spec, theta, samples, tested, sample_time, halving), flavour
            ),
        },
        inputs=(
            Signal(name="displacement", unit="m", description="of the damper, positive as it lengthens"),
            Signal(name="velocity", unit="m/s", description="of the damper"),
            Signal(name="command", unit=unit, description="command of the driver"),
        ),
        outputs=(Signal(name="force", unit="N", description="force with which the damper resists"),),
        parameters=parameters,
        n_states=spec.n_states,
        is_lagged=spec.n_rates > 0,
        sample_time=sample_time,
        substeps=substeps,
        notes=(*open_laws, *notes),
    )


def _with_lag(
    n_params: int, n_columns: int, text: dict[str, str], flavour: Flavour, spec: DamperSpec
) -> dict[str, str]:
    """What moves the current behind the lag of the driver, in a sub-step and as a rate."""
    if not spec.n_rates:
        return {}
    fma = "fmaf" if flavour.single else "fma"
    falls = "0" if spec.lag == "one_rate" else "!(m->current < command)"
    lines = [
        f"{flavour.real} middle[{n_params}], end[{n_params}];",
        f"const {flavour.real} decay = m->decay[halvings][{falls}];",
        f"const {flavour.real} half_way = {fma}(m->current - command, decay, command);",
        "parameters_at(m, half_way, middle);",
        f"const {flavour.real} current = {fma}(half_way - command, decay, command);",
        "parameters_at(m, current, end);",
    ]
    ending = ["m->current = current;", "memcpy(m->p, end, sizeof end);"]
    before, after = ("".join(f"    {line}\n" for line in part) for part in (lines, ending))
    eta = f"m->prepared[{n_columns - spec.n_rates} + {falls}]"
    rate = f"    rate[{spec.n_states}] = {eta} * (command - m->current);\n"
    return {"substep": before + text["substep"] + after, "rate": text["rate"] + rate}


def _motion_of_check(spec: DamperSpec, tested: OperatingRange, sample_time: float) -> Loading:
    """A growing sine and a triangle, with the tested speed and commands that jump over their range."""
    if not (tested.velocity > 0.0 and tested.stroke > 0.0):
        raise SettingError(
            "the tested ranges of this fit are not known, and the printed limits and check follow from them; run "
            "mrwork identify again"
        )
    hertz = tested.velocity / (2.0 * np.pi * tested.stroke)
    if hertz * sample_time * _FEWEST > 1.0:
        raise SettingError(
            f"a time step of {of_unit(sample_time, 's')} has {1.0 / (hertz * sample_time):.2g} samples a cycle of the "
            f"tested stroke and velocity; give at least {_FEWEST}, by a shorter --time-step (in Python `time_step`)"
        )
    time = sample_time * np.arange(_SAMPLES)
    half = time[_SAMPLES // 2]
    cycles = max(_CYCLES, hertz * half)
    turns = cycles * np.minimum(time, half) / half
    amplitude = min(tested.stroke, tested.velocity * half / (2.0 * np.pi * cycles))
    sine = np.minimum(turns, 1.0) * np.sin(2.0 * np.pi * turns)
    later = np.maximum(time - half, 0.0) / half * cycles
    triangle = np.abs((later + 0.25) % 1.0 - 0.5) * -4.0 + 1.0
    shape = np.where(time <= half, sine, -triangle)
    levels = np.repeat(np.resize(_COMMANDS, -(-_SAMPLES // _HELD)), _HELD)[:_SAMPLES]
    lowest, highest = tested.command or (0.0, 0.0)
    command = lowest + (highest - lowest) * levels
    return Loading(
        dt=sample_time,
        displacement=amplitude * shape,
        command=command if spec.follows_command else None,
        command_unit=spec.command_unit,
    )


def _limits(spec: DamperSpec, tested: OperatingRange, halving: Halving) -> dict[str, tuple[float, ...]]:
    """What is believed, and what was tested: displacement, velocity, acceleration, lowest and highest command."""
    hertz = max(tested.velocity / (2.0 * np.pi * tested.stroke), *(tested.frequency or (0.0,)))
    lowest, highest = tested.command or (0.0, 1.0)
    if not spec.follows_command:
        # Nothing depends on it.
        lowest, highest = -10.0 * max(-lowest, highest, 1.0), 10.0 * max(-lowest, highest, 1.0)
    speed, omega = halving.speeds[-1], 2.0 * np.pi * hertz
    return {
        "believed": (
            max(_STROKES * tested.stroke, _ANYWHERE),
            speed,
            _FASTER * omega * speed,
            lowest,
            highest,
        ),
        "tested": (
            tested.stroke,
            (1.0 + _TOLERANCE) * tested.velocity,
            omega * tested.velocity,
            lowest,
            highest,
        ),
    }


def _of_straight_lines(
    spec: DamperSpec,
    theta: Floats,
    tested: OperatingRange,
    motion: Loading,
    samples: Sampled,
    sample_time: float,
    halving: Halving,
) -> str:
    """How far the force under straight lines is from that of the motion, in a smooth one first."""
    smooth = _sine(spec, tested, sample_time)
    finest = simulate_forces(spec, theta[None], smooth.history(), substep_factor=_FINEST)
    sine = _sampled(spec, theta, smooth, sample_time, halving).force

    def percent(force: Floats, right: Floats) -> float:
        return 100.0 * float(np.sqrt(np.mean((force - right) ** 2)) / np.sqrt(np.mean(right**2)))

    sentence = (
        f"Between samples the motion is straight: at {of_unit(sample_time, 's')} the force of this damper differs by "
        f"{percent(sine, finest.force[0]):.2g} % rms from the one under a sine of the tested stroke and velocity, "
        f"{tested.velocity / (2.0 * np.pi * tested.stroke):.3g} Hz, through the same samples."
    )
    exact = simulate_forces(spec, theta[None], motion.history())
    if exact.outcome[0] != Outcome.FINISHED:
        return sentence
    off = 100.0 * float(np.abs(samples.force - exact.force[0]).max() / np.abs(exact.force[0]).max())
    return (
        f"{sentence} Under the triangle of the check, whose corners a smooth motion cuts, it differs by "
        f"{percent(samples.force, exact.force[0]):.2g} % rms, and by {off:.2g} % of the largest at corners."
    )


def _of_halving(halving: Halving, tested: OperatingRange) -> str:
    """Up to which velocity the print is believed, and how it gets there."""
    times = halving.speeds[-1] / tested.velocity
    finer = f" {halving.most_substeps} sub-steps in a sample at most;" if times > 1.0 else ""
    return (
        f"Believed to {of_unit(halving.speeds[-1], 'm/s')}, {times:.3g} times the tested velocity:{finer} under sine, "
        f"triangle and noise its error is at most {100.0 * halving.largest_error:.2g} % of the largest force, against "
        f"{100.0 * halving.errors[0]:.2g} % of sine and triangle of the tested velocity. A velocity beyond is held to "
        "that, and counted."
    )


def _sine(spec: DamperSpec, tested: OperatingRange, dt: float) -> Loading:
    """A sine of the tested stroke and velocity at the highest command."""
    hertz = tested.velocity / (2.0 * np.pi * tested.stroke)
    count = max(_SAMPLES, round(_CYCLES / (hertz * dt)))
    return Loading(
        dt=dt,
        displacement=tested.stroke * np.sin(2.0 * np.pi * hertz * dt * np.arange(count)),
        command=np.full(count, tested.command[1]) if spec.follows_command and tested.command else None,
        command_unit=spec.command_unit,
    )


def _sampled(spec: DamperSpec, theta: Floats, motion: Loading, dt: float, halving: Halving) -> Sampled:
    """The motion as a rig would measure it, with the force of straight lines."""
    stages = motion.history().stages(1)
    velocity = np.append(stages[:, 0, 1], stages[-1, -1, 1])
    command = (
        np.zeros(len(velocity)) if motion.command is None else np.asarray(motion.command, dtype=np.float64)
    )
    columns = np.stack([motion.displacement, velocity, command])
    return Sampled(
        displacement=motion.displacement,
        velocity=velocity,
        command=command,
        force=straight_forces(spec, theta, columns, dt, halving),
    )


def _and_fast(
    spec: DamperSpec, theta: Floats, samples: Sampled, tested: OperatingRange, dt: float, halving: Halving
) -> Sampled:
    """The samples, and a part of a sine as fast as is believed behind them."""
    hertz = _FAST_CYCLES * tested.velocity / (2.0 * np.pi * tested.stroke)
    phase = 2.0 * np.pi * hertz * dt * np.arange(1, _FAST_SAMPLES + 1)
    speed = halving.speeds[-1] * np.sin(phase)
    moved = halving.speeds[-1] / (2.0 * np.pi * hertz) * (1.0 - np.cos(phase))
    columns = np.stack(
        [
            np.append(samples.displacement, samples.displacement[-1] + moved),
            np.append(samples.velocity, speed),
            np.append(samples.command, np.full(phase.size, samples.command[-1])),
        ]
    )
    displacement, velocity, command = columns
    return Sampled(
        displacement=displacement,
        velocity=velocity,
        command=command,
        force=straight_forces(spec, theta, columns, dt, halving),
    )


def _check(name: str, samples: Sampled, flavour: Flavour) -> str:
    """A program that ends with 0 where the printed damper gives the forces of the core."""
    columns = (samples.displacement, samples.velocity, samples.command, samples.force)
    largest = float(np.abs(samples.force).max())
    return flavour.fill(
        "damper_check.c",
        name=name,
        n_samples=len(samples.force),
        rows=table_rows(np.stack(columns, axis=1)),
        tolerance=repr(flavour.share * largest),
    )
