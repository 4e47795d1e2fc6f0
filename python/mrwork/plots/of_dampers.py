"""Figures of a damper model without a test: its loops with the nominal parameters."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, get_args

import numpy as np
from matplotlib.figure import Figure

from mrwork.base.hints import InUnit, Within
from mrwork.dampers.simulation import simulate_force, sinusoid
from mrwork.dampers.spec import DamperSpec
from mrwork.plots import canvas, style
from mrwork.plots.of_tests import Motion, axis_values
from mrwork.records.damper_test import DamperTest
from mrwork.records.read import test_from_arrays

# Cycles of a motion from rest, and samples of a cycle.
_CYCLES, _PER_CYCLE = 3, 1000


def nominal_test(
    spec: DamperSpec, *, amplitude: float, frequency: float, per_cycle: int, command: float = 0.0
) -> DamperTest:
    """The nominal force under a sinusoid [m, Hz], at this command where the model takes one."""
    unit = spec.command_unit
    level = None if unit is None else command
    loading = sinusoid(
        amplitude,
        2.0 * np.pi * frequency * amplitude,
        cycles=_CYCLES,
        per_cycle=per_cycle,
        command=level,
        command_unit=unit,
    )
    test = test_from_arrays(
        loading.dt * np.arange(len(loading.displacement)),
        loading.displacement,
        simulate_force(spec, spec.nominal, loading),
        velocity=loading.velocity,
        name="nominal",
        command=level,
        command_unit=unit,
    )
    return replace(test, synthetic=True)


@style.drawn_in_style()
def nominal_loops(
    spec: DamperSpec,
    *,
    amplitude: Annotated[float, Within(least=1e-6, most=1.0), InUnit("m")] = 0.015,
    frequency: Annotated[float, Within(least=1e-4, most=1e3), InUnit("Hz")] = 2.5,
) -> Figure:
    """Force over displacement and over velocity in the last cycle of a sinusoid, at zero command.

    Parameters
    ----------
    amplitude, frequency
        Of the motion of the figure.
    """
    whole = nominal_test(spec, amplitude=amplitude, frequency=frequency, per_cycle=_PER_CYCLE)
    test = whole.part(whole.n_time - _PER_CYCLE - 1, whole.n_time)
    unit = style.force_unit(float(np.abs(test.force).max()))
    figure, panels = canvas.grid_of_axes(2, 2, canvas.SMALL)
    for axes, over in zip(panels, get_args(Motion), strict=True):
        across, name = axis_values(test, over)
        axes.plot(across, unit.factor * test.force, color=style.MODEL, linewidth=1.4)
        canvas.finish(axes, f"Force ({unit.symbol})", name)
    return figure
