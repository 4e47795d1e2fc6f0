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
from mrwork.embedded.c_source import CSource, Flavour, Signal, c_names, head_of, table_rows
from mrwork.errors import SettingError

_SAMPLES = 1000
_CYCLES = 2.5
# Samples of a cycle below which straight lines are no motion of a rig.
_FEWEST = 20
# Commands of the check, one after the other, as shares of the tested range, and the samples that each stays.
_COMMANDS = (0.0, 1.0, 0.25, 0.7)
_HELD = 125
# Multiple of a tested range beyond which a reading is not believed.
_BELIEVED = 10.0
# Displacement that is believed at least [m].
_ANYWHERE = 1.0


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
    exact = simulate_forces(spec, theta[None], motion.history())
    if exact.outcome[0] == Outcome.UNRESOLVED:
        raise SettingError(
            f"{spec.name} needs more than {MOST_SUBSTEPS} sub-steps in a sample of {of_unit(sample_time, 's')}; give a "
            "shorter --time-step (in Python `time_step`)"
        )
    refuse_failure(spec.name, int(exact.outcome[0]))
    substeps = int(exact.substeps[0])
    samples = _sampled(spec, theta, motion, sample_time, substeps)
    names = c_names([parameter.name for parameter in spec.parameters])
    laws = [str(law) for law in spec.laws]
    text = _rust.damper_text(
        spec.core_name,
        [f"parameters->{each}" for each in names],
        sample_time / substeps,
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
    off = samples.force - exact.force[0]
    percent = 100.0 * float(np.sqrt(np.mean(off**2)) / np.sqrt(np.mean(exact.force[0] ** 2)))
    straight = (
        f"Between samples the motion is straight: at {of_unit(sample_time, 's')} the force of this damper differs by "
        f"{percent:.2g} % rms from the one under a smooth motion through the same samples, and by "
        f"{100.0 * float(np.abs(off).max() / np.abs(exact.force[0]).max()):.2g} % of the largest at kinks."
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
        straight,
    ]
    n_params = len(spec.without_laws.parameters)
    command = max(map(abs, tested.command or (1.0,)))
    # The origin of a displacement is anywhere.
    limits = (
        max(_BELIEVED * tested.stroke, _ANYWHERE),
        _BELIEVED * tested.velocity,
        _BELIEVED * (command or 1.0),
    )
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
        "limits": ", ".join(map(flavour.number, limits)),
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
            f"{name}_check.c": _check(name, samples, flavour),
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
        notes=(*open_laws, straight),
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
        f"const {flavour.real} decay = m->decay[{falls}];",
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


def _sampled(spec: DamperSpec, theta: Floats, motion: Loading, dt: float, substeps: int) -> Sampled:
    """The motion as a rig would measure it, with the force of straight lines."""
    stages = motion.history().stages(1)
    velocity = np.append(stages[:, 0, 1], stages[-1, -1, 1])
    command = (
        np.zeros(len(velocity)) if motion.command is None else np.asarray(motion.command, dtype=np.float64)
    )
    force = _rust.straight_forces(
        spec.core_name,
        theta,
        motion.displacement,
        velocity,
        command,
        dt,
        substeps,
        [*map(str, spec.laws)],
        spec.n_rates,
    )
    return Sampled(
        displacement=motion.displacement, velocity=velocity, command=command, force=np.asarray(force)
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
