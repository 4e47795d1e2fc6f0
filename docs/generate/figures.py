"""Figures of the reference, drawn at build, with the words that stand for them where they cannot be seen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

import mrwork as mr
from mrwork.drawing import canvas, style

Floats = NDArray[np.float64]

# A sinusoid as in the tests of Spencer et al. 1997, of which the last of three cycles is drawn.
_AMPLITUDE, _FREQUENCY = 0.015, 2.5
_CYCLES, _PER_CYCLE = 3, 1000
LOOP_CAPTION = f"One cycle of {1e3 * _AMPLITUDE:g} mm at {_FREQUENCY:g} Hz with the nominal parameters."


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """One cycle of a damper: displacement [m], velocity [m/s] and force [N], shape (n_time,)."""

    displacement: Floats
    velocity: Floats
    force: Floats

    @property
    def dissipated(self) -> float:
        """Energy of the cycle [J]."""
        return float(np.trapezoid(self.force * self.velocity, dx=1.0 / (_PER_CYCLE * _FREQUENCY)))


@cache
def _loop(name: str) -> Loop:
    spec = mr.damper(name)
    phase = 2.0 * np.pi * np.arange(_CYCLES * _PER_CYCLE + 1) / _PER_CYCLE
    displacement = _AMPLITUDE * np.sin(phase)
    velocity = 2.0 * np.pi * _FREQUENCY * _AMPLITUDE * np.cos(phase)
    loading = mr.Loading(dt=1.0 / (_PER_CYCLE * _FREQUENCY), displacement=displacement, velocity=velocity)
    last = slice(-_PER_CYCLE - 1, None)
    force = mr.simulate_force(spec, spec.nominal, loading)
    return Loop(displacement=displacement[last], velocity=velocity[last], force=force[last])


def loop_words(spec: mr.DamperSpec) -> str:
    """What the figure of a model shows, for those who cannot see it."""
    loop = _loop(spec.name)
    return (
        f"Loops of force over displacement and over velocity of the model {spec.name}: from {loop.force.min():.4g} to "
        f"{loop.force.max():.4g} N, {loop.dissipated:.3g} J dissipated."
    )


def loop_figure(spec: mr.DamperSpec) -> bytes:
    """Hysteresis loop of a model with its nominal parameters, as SVG."""
    loop = _loop(spec.name)
    unit = style.force_unit(float(np.abs(loop.force).max()))
    with style.drawn_in_style():
        figure, panels = canvas.grid_of_axes(2, 2, canvas.SMALL)
        for axes, abscissa, name in zip(
            panels,
            (loop.displacement, loop.velocity),
            ("Displacement (mm)", "Velocity (mm/s)"),
            strict=True,
        ):
            axes.plot(1e3 * abscissa, unit.factor * loop.force, color=style.MODEL, linewidth=1.4)
            canvas.finish(axes, f"Force ({unit.symbol})", name)
        return canvas.svg_bytes(figure)
