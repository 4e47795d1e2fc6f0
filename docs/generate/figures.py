"""Figures of the reference, drawn at build, with the words that stand for them where they cannot be seen."""

from __future__ import annotations

import numpy as np

import mrwork as mr
from mrwork.plots.canvas import svg_bytes
from mrwork.plots.of_tests import nominal_loops

# A sinusoid as in the tests of Spencer et al. 1997, of which the last of three cycles is drawn.
_AMPLITUDE, _FREQUENCY = 0.015, 2.5
_CYCLES, _PER_CYCLE = 3, 1000
LOOP_CAPTION = f"One cycle of {1e3 * _AMPLITUDE:g} mm at {_FREQUENCY:g} Hz with the nominal parameters."


def loop_words(spec: mr.DamperSpec) -> str:
    """What the figure of a model shows, for those who cannot see it."""
    dt = 1.0 / (_PER_CYCLE * _FREQUENCY)
    phase = 2.0 * np.pi * np.arange(_CYCLES * _PER_CYCLE + 1) / _PER_CYCLE
    displacement = _AMPLITUDE * np.sin(phase)
    velocity = 2.0 * np.pi * _FREQUENCY * _AMPLITUDE * np.cos(phase)
    loading = mr.Loading(dt=dt, displacement=displacement, velocity=velocity)
    last = slice(-_PER_CYCLE - 1, None)
    force = mr.simulate_force(spec, spec.nominal, loading)[last]
    dissipated = float(np.trapezoid(force * velocity[last], dx=dt))
    return (
        f"Loops of force over displacement and over velocity of the model {spec.name}: from {force.min():.4g} to "
        f"{force.max():.4g} N, {dissipated:.3g} J dissipated."
    )


def loop_figure(spec: mr.DamperSpec) -> bytes:
    """Loops of a model with its nominal parameters, as SVG."""
    return svg_bytes(nominal_loops(spec, amplitude=_AMPLITUDE, frequency=_FREQUENCY))
