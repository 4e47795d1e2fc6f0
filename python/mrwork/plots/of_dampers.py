"""Drawing of a damper model without a test: its loops with the nominal parameters."""

from __future__ import annotations

from typing import get_args

import numpy as np
from matplotlib.figure import Figure

from mrwork.dampers.simulation import simulate_force
from mrwork.dampers.spec import DamperSpec
from mrwork.plots import canvas, style
from mrwork.plots.of_tests import AXES, Motion, axis_name
from mrwork.uncertainty.candidate_tests import Candidate, harmonic_motion

# Samples of a cycle, of which the last is drawn.
_PER_CYCLE = 1000


@style.drawn_in_style()
def nominal_loops(spec: DamperSpec, *, amplitude: float, frequency: float) -> Figure:
    """Force over displacement and over velocity under a sinusoid [m, Hz], at zero command where the model takes one."""
    command = None if spec.current is None else 0.0
    motion = Candidate(amplitude=amplitude, frequency=frequency, command=command)
    loading, _ = harmonic_motion(motion, spec, _PER_CYCLE)
    last = slice(-_PER_CYCLE - 1, None)
    force = simulate_force(spec, spec.nominal, loading)[last]
    unit = style.force_unit(float(np.abs(force).max()))
    figure, panels = canvas.grid_of_axes(2, 2, canvas.SMALL)
    for axes, over in zip(panels, get_args(Motion), strict=True):
        across = np.asarray(getattr(loading, over))[last] * AXES[over].factor
        axes.plot(across, force * unit.factor, color=style.MODEL, linewidth=1.4)
        canvas.finish(axes, f"Force ({unit.symbol})", axis_name(over))
    return figure
