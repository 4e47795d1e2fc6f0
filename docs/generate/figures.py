"""Figures of the reference, drawn at build, with the words that stand for them where they cannot be seen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

import mrwork as mr
from mrwork.report import canvas, style

Floats = NDArray[np.float64]

# A sinusoid as in the tests of Spencer et al. 1997, of which the last of three cycles is drawn.
_AMPLITUDE, _FREQUENCY = 0.015, 2.5
_CYCLES, _PER_CYCLE = 3, 1000
LOOP_CAPTION = f"One cycle of {1e3 * _AMPLITUDE:g} mm at {_FREQUENCY:g} Hz with the nominal parameters."
# Inches of a picture of the first page, and the room below its lines for a legend.
_PICTURE, _ROOM = (4.6, 3.1), 1.3


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


DAMPER_WORDS = (
    "Force over displacement of an embedded synthetic test of a damper, with the identified model on top."
)
BUILDING_WORDS = (
    "Drift of the first storey of a frame under a synthetic earthquake: smaller with two dampers under "
    "clipped-optimal control than with the same dampers passive-off (i = 0)."
)


def damper_figure() -> bytes:
    """A picture of the first page, as SVG: a damper is identified."""
    test = mr.synthetic_test("rd1005_1a")
    fit = mr.identify("static_hysteretic", test, rng=0)
    loading = mr.Loading(dt=test.dt, displacement=test.displacement, velocity=test.velocity)
    force = mr.simulate_force(mr.damper(fit.model), fit.theta, loading)
    with style.drawn_in_style():
        figure, axes = canvas.blank(_PICTURE)
        axes.plot(
            1e3 * test.displacement, test.force, color=style.DATA, linewidth=2.5, label="synthetic test"
        )
        axes.plot(1e3 * test.displacement, force, color=style.MODEL, linewidth=1.0, label="identified model")
        canvas.finish(axes, "Force (N)", "Displacement (mm)")
        axes.legend(loc="center")
        return canvas.svg_bytes(figure)


def building_figure() -> bytes:
    """A picture of the first page, as SVG: a building with dampers under an earthquake."""
    with style.drawn_in_style():
        figure, axes = canvas.blank(_PICTURE)
        for (name, time, drift), colour in zip(_frame_responses(), (style.DATA, style.MODEL), strict=True):
            axes.plot(time, 1e3 * drift, color=colour, linewidth=1.1, label=name)
        canvas.finish_signed(axes, "Drift of the first storey (mm)", "Time (s)")
        axes.set_ylim(bottom=_ROOM * axes.get_ylim()[0])
        axes.legend(loc="lower right", ncols=2)
        return canvas.svg_bytes(figure)


def _frame_responses() -> list[tuple[str, Floats, Floats]]:
    """Drift of the first storey [m] over time [s] with dampers passive-off, and with them under control."""
    frame = mr.building("uts")
    preset = mr.damper("static_hysteretic").preset("kwok2006")
    pair = mr.Device(
        name="pair in storey 1",
        spec=preset.spec,
        theta=preset.theta,
        row=frame.storeys[0],
        largest_command=preset.largest_command or 0.0,
        differential=True,
    )
    plant = mr.control.plant_of(frame, frame.storeys[:1])
    gain = mr.control.regulator_of_state(plant, plant.energy, 1e-9).gain
    laws = {
        "passive-off": mr.ControlLaw(name="passive", gains={"command": [0.0]}),
        "clipped-optimal": mr.ControlLaw(name="clipped_optimal", gains={"gain": gain}),
    }
    motion = mr.synthetic_motion(rng=0, peak=3.0)
    hardware = mr.Hardware(sample_time=1e-3)
    found = []
    for name, law in laws.items():
        responses = mr.simulate_loop(frame, [pair], law, [motion], hardware, histories=True)
        assert responses.histories is not None
        history = responses.histories[0]
        found.append((name, history.time, history.drift[:, 0]))
    return found
