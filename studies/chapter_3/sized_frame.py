"""Dampers sized for the five-storey frame at 0.3 g, in the loop beside the pair of RD-1005-3, which saturates there.

Each damper stands between ground and floor 1. Constant currents and clipped-optimal control are chosen on two synthetic
motions and judged on two others, which chose nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import mrwork as mr
from mrwork.closed_loop import SCORE, STANDARD_GRAVITY, values
from mrwork.control import DesignProblem, RegulatorSettings, design_candidates
from mrwork.dampers import design
from mrwork.motions import scaled_to_peak

Floats = NDArray[np.float64]

PEAK = 0.3
"""Peak of the ground motions [g]."""
FORCES = (4e3, 8e3, 12e3)
"""Wanted forces of the sized dampers [N]."""
SUPPLY = 24.0
"""Voltage of the current driver [V]."""
PAIR = "pair of RD-1005-3"
FRAME = mr.building("uts")
HARDWARE = mr.Hardware(sample_time=1e-3, step=5e-4)
WEIGHT = FRAME.total_mass * STANDARD_GRAVITY
# Seeds of the motions that choose the settings, and of those that judge them.
_CHOOSING, _JUDGING = (1940, 1995), (1968, 1994)
_DURATION = 20.0
# Largest currents that are tried, as shares of that of the damper, and control weights [1/N^2].
_SHARES, _WEIGHTS = (0.4, 0.7, 1.0), np.geomspace(1e-11, 1e-5, 13)
# The current of the RD-1005-3 above which its published friction decreases again, and the rate of its driver [1/s].
_PAIR_CURRENT, _PAIR_RATE = 1.88, 190.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SizedFrame:
    """The sized dampers by name, and what each damper comes to in the loop."""

    designs: dict[str, design.DamperDesign]
    sizes: dict[str, dict[str, float]]
    loop: dict[str, dict[str, Any]]


def wishes(force: float) -> design.DamperWishes:
    """What a damper of the first storey has to do: 0.1 m/s is 5 mm at the 3 Hz of the frame."""
    return design.DamperWishes(
        force=force,
        dynamic_range=8.0,
        stroke=0.03,
        velocity=0.1,
        outer_diameter=0.15,
        length=0.3,
        voltage=SUPPLY,
        current=2.0,
        response_time=0.01,
    )


def sized_frame(*, quick: bool, threads: int, say: Callable[[str], None]) -> SizedFrame:
    """Size the dampers and run them; the quick form has the smallest wish, one motion and fewer settings."""
    designs = {}
    for force in FORCES[:1] if quick else FORCES:
        say(f"damper of {1e-3 * force:g} kN")
        designs[f"sized, {1e-3 * force:g} kN"] = design.size_damper(
            wishes(force),
            fluid=design.fluid("MRF-132DG"),
            steel=design.steel("AISI 1010"),
            budget=700 if quick else 3000,
        ).design
    devices = {PAIR: pair_of_rd1005(), **{name: _device(name, each) for name, each in designs.items()}}
    say("loop")
    bench = _Bench(quick=quick, threads=threads)
    return SizedFrame(
        designs=designs,
        sizes={name: _size(each) for name, each in designs.items()},
        loop={name: bench.compared(device) for name, device in devices.items()},
    )


def pair_of_rd1005() -> mr.Device:
    """Two RD-1005-3 in opposition with the lag of their driver, as in `studies/chapter_6`."""
    preset = mr.damper("static_hysteretic").preset("kwok2006")
    laws = (
        {}
        if preset.spec.current is None
        else dict(zip((plain.name for plain in preset.spec.plain), preset.spec.current.laws, strict=True))
    )
    return mr.Device(
        name=PAIR,
        spec=mr.damper("static_hysteretic").with_current_laws(laws, unit="A", lagged=True),
        theta=np.append(preset.theta, _PAIR_RATE),
        row=FRAME.storeys[0],
        largest_command=_PAIR_CURRENT,
        differential=True,
    )


def _device(name: str, damper: design.DamperDesign) -> mr.Device:
    model = damper.as_model(supply=SUPPLY)
    return mr.Device(
        name=name,
        spec=model.spec,
        theta=model.theta,
        row=FRAME.storeys[0],
        largest_command=model.largest_command,
    )


def _size(damper: design.DamperDesign) -> dict[str, float]:
    return {
        "force_kn": 1e-3 * damper.largest_force,
        "dynamic_range": damper.dynamic_range,
        "outer_diameter_mm": 1e3 * damper.outer_diameter,
        "length_mm": 1e3 * damper.chamber_length,
        "volume_l": 1e3 * damper.envelope_volume,
        "fluid_kg": damper.fluid_mass,
        "largest_current_a": damper.largest_current,
        "power_w": damper.power,
        "response_ms": 1e3 * damper.response_time(SUPPLY),
        "model_nrmse": damper.as_model(supply=SUPPLY).nrmse,
    }


class _Bench:
    """The frame under the motions that choose settings and those that judge them."""

    def __init__(self, *, quick: bool, threads: int) -> None:
        self.threads = threads
        self.n_currents = 5 if quick else 17
        self.weights = _WEIGHTS[::6] if quick else _WEIGHTS
        self.shares = _SHARES[-1:] if quick else _SHARES
        duration = 8.0 if quick else _DURATION
        self.choosing, self.judging = (
            [_motion(seed, duration) for seed in seeds[: 1 if quick else None]]
            for seeds in (_CHOOSING, _JUDGING)
        )
        passive = mr.ControlLaw(name="passive", gains={"command": [[0.0]]})
        self.passive = {
            id(motions): values(self._run(pair_of_rd1005(), passive, motions), weight=WEIGHT)
            for motions in (self.choosing, self.judging)
        }

    def compared(self, device: mr.Device) -> dict[str, Any]:
        """The best constant current and the best clipped-optimal control, each judged on the other motions."""
        currents = np.linspace(0.0, device.largest_command, self.n_currents)
        constant = mr.ControlLaw(name="passive", gains={"command": currents[:, None]})
        scores, _ = self._scored(device, constant, self.choosing)
        best = int(scores.argmin())
        tried = []
        for share in self.shares:
            limited = replace(device, largest_command=share * device.largest_command)
            law = self._clipped(limited)
            tried += [
                (float(score), limited, row)
                for row, score in enumerate(self._scored(limited, law, self.choosing)[0])
            ]
        least, limited, row = min(tried, key=lambda each: each[0])
        return {
            "currents": currents.tolist(),
            "scores": scores.tolist(),
            "at_largest_current": float(scores[-1]),
            "constant": {
                "score": float(scores[best]),
                "current_a": float(currents[best]),
                **self._judged(device, constant, best),
            },
            "clipped": {
                "score": least,
                "current_a": limited.largest_command,
                "control_weight": float(self.weights[row]),
                **self._judged(limited, self._clipped(limited), row),
            },
        }

    def _clipped(self, device: mr.Device) -> mr.ControlLaw:
        problem = DesignProblem(building=FRAME, devices=[device], sample_time=HARDWARE.sample_time)
        settings = [RegulatorSettings(control_weight=float(weight)) for weight in self.weights]
        law = design_candidates("clipped_optimal", problem, settings).law
        assert law is not None, "every positive control weight has a regulator"
        return law

    def _judged(self, device: mr.Device, law: mr.ControlLaw, row: int) -> dict[str, Any]:
        scores, found = self._scored(device, law, self.judging)
        parts, peaks = found
        return {
            "judged": float(scores[row]),
            **{name: float(value) for name, value in zip(SCORE, parts[row], strict=True)},
            **{name: float(value[row]) for name, value in peaks.items()},
        }

    def _scored(
        self, device: mr.Device, law: mr.ControlLaw, motions: list[mr.GroundMotion]
    ) -> tuple[Floats, tuple[Floats, dict[str, Floats]]]:
        """Scores of the candidates; their parts, shape (candidates, criteria), and peaks over the motions."""
        runs = self._run(device, law, motions)
        shape, passive = (runs.shape[0], -1), self.passive[id(motions)]
        found = values(runs, weight=WEIGHT)
        ratios = np.stack([found[name].reshape(shape) / passive[name] for name in SCORE], axis=2)
        parts = ratios.mean(axis=1)
        peaks = {
            "force_kn": 1e-3 * runs.peak_force[:, 0].reshape(shape).max(axis=1),
            "stroke_mm": 1e3 * runs.peak_stroke[:, 0].reshape(shape).max(axis=1),
        }
        return parts.mean(axis=1), (parts, peaks)

    def _run(self, device: mr.Device, law: mr.ControlLaw, motions: list[mr.GroundMotion]) -> mr.Responses:
        return mr.simulate_loop(FRAME, [device], law, motions, HARDWARE, threads=self.threads)


def _motion(seed: int, duration: float) -> mr.GroundMotion:
    """A draw of the Clough-Penzien spectrum of firm soil."""
    drawn = mr.synthetic_motion(rng=seed, duration=duration, name=f"seed {seed}")
    return scaled_to_peak(drawn, PEAK * STANDARD_GRAVITY)
