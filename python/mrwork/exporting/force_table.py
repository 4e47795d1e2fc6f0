"""Force of a fitted damper over velocity and command, as a table for a supplier."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrwork.dampers.spec import damper, plain_parameters
from mrwork.errors import SettingError, SimulationError
from mrwork.exporting.single_command import parameters_at, refuse_bounds
from mrwork.identification.fit import Fit
from mrwork.records.columns import StatedCommand
from mrwork.simulation import Loading, Outcome, simulate_forces
from mrwork.table import csv_text
from mrwork.tested_range import OperatingRange
from mrwork.values import Floats

_SPEEDS = 20
_COMMANDS = 5
# The force is that of the third cycle: the hysteresis has forgotten the start.
_CYCLES = 3
_PER_CYCLE = 2000


def force_table(fit: Fit, stated: StatedCommand | None) -> str:
    """Force [N] in the middle of the stroke over peak velocity [m/s], both ways, and command.

    Of harmonic tests of the largest tested stroke: a damper with hysteresis has no force over velocity alone. Rows go
    over evenly spaced velocities up to the largest tested one, for the commands over the tested range, or for one.
    """
    refuse_bounds(fit)
    tested = fit.tested
    if tested is None or tested.velocity == 0.0:
        raise SettingError(
            "the tested ranges of this fit are not known, and the table goes over them; run mrwork identify again"
        )
    commands, rows = _commands(fit, stated, tested)
    unit = "" if fit.spec.current is None else fit.spec.current.unit
    heading = [f"command [{unit}]"] if unit else []
    lines = [[*heading, "velocity [m/s]", "force [N]", "amplitude [m]", "frequency [Hz]"]]
    speeds = tested.velocity * np.arange(1, _SPEEDS + 1) / _SPEEDS
    forces = np.stack([_forces(fit, rows, tested.stroke, float(speed)) for speed in speeds])
    both_ways = np.concatenate([-speeds[::-1], speeds])
    force = np.concatenate([forces[::-1, :, 1], forces[:, :, 0]])
    frequency = np.abs(both_ways) / (2.0 * np.pi * tested.stroke)
    amplitude = np.full(both_ways.size, tested.stroke)
    for index, command in enumerate(commands):
        columns = np.column_stack([both_ways, force[:, index], amplitude, frequency]).tolist()
        lines += [[*([] if command is None else [repr(command)]), *map(repr, numbers)] for numbers in columns]
    return csv_text(lines)


def _commands(
    fit: Fit, stated: StatedCommand | None, tested: OperatingRange
) -> tuple[Sequence[float | None], Floats]:
    """Commands, and the parameters of the plain model at each, shape (n_commands, n_plain)."""
    if stated is not None or not fit.spec.follows_command or tested.command is None:
        theta, value = parameters_at(fit, stated)
        return [value], theta[None]
    levels = np.linspace(*tested.command, _COMMANDS).tolist()
    return levels, np.stack([plain_parameters(fit.spec, fit.theta, each) for each in levels])


def _forces(fit: Fit, theta: Floats, amplitude: float, speed: float) -> Floats:
    """Force at the passages through the middle with and against `speed` [m/s], shape (n_commands, 2)."""
    phase = 2.0 * np.pi * np.arange(_CYCLES * _PER_CYCLE) / _PER_CYCLE
    loading = Loading(
        dt=2.0 * np.pi * amplitude / speed / _PER_CYCLE,
        displacement=amplitude * np.sin(phase),
        velocity=speed * np.cos(phase),
    )
    run = simulate_forces(damper(fit.model), theta, loading.history())
    if run.outcome.any():
        outcome = Outcome(int(run.outcome.max()))
        raise SimulationError(
            f"{fit.model} ended as {outcome.name.lower()} at {speed:.3g} m/s: {outcome.remedy}"
        )
    first = (_CYCLES - 1) * _PER_CYCLE
    return np.asarray(run.force[:, [first, first + _PER_CYCLE // 2]])
