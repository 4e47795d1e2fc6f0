"""Dampers sized for the five-storey frame at 0.3 g, in the loop beside the pair of RD-1005-3, which saturates there.

Each damper stands between ground and floor 1. Constant currents and clipped-optimal control are chosen on two synthetic
motions and judged on two others, which chose nothing, and on the four records of chapter 6 where these are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import mrwork as mr
from mrwork.closed_loop import SCORE, STANDARD_GRAVITY, values
from mrwork.control import DesignProblem, RegulatorSettings, design_candidates
from mrwork.dampers import design
from mrwork.motions import scaled_to_peak, trimmed
from studies.common.frame import FRAME, HARDWARE, LONGEST, RECORDS, pair

Floats = NDArray[np.float64]

PEAK = 0.3
"""Peak of the ground motions [g]."""
FORCES = (4e3, 8e3, 12e3)
"""Desired forces of the sized dampers [N]."""
SUPPLY = 24.0
"""Voltage of the current driver [V]."""
PAIR = pair().name
WEIGHT = FRAME.total_mass * STANDARD_GRAVITY
# Seeds of the motions that choose the settings, and of those that judge them.
_CHOOSING, _JUDGING = (1940, 1995), (1968, 1994)
_DURATION = 20.0
# Largest currents that are tried, as shares of that of the damper, and control weights [1/N^2].
_SHARES, _WEIGHTS = (0.4, 0.7, 1.0), np.geomspace(1e-11, 1e-5, 13)


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


def sized_frame(*, records: Path | None, quick: bool, threads: int, say: Callable[[str], None]) -> SizedFrame:
    """Size the dampers and run them, also under the records of a folder.

    The quick form has the smallest wish, one motion that chooses and one that judges, and fewer settings.
    """
    designs = {}
    for force in FORCES[:1] if quick else FORCES:
        say(f"damper of {1e-3 * force:g} kN")
        designs[f"sized, {1e-3 * force:g} kN"] = design.size_damper(
            wishes(force),
            fluid=design.fluid("MRF-132DG"),
            steel=design.steel("AISI 1010"),
            budget=700 if quick else 3000,
        ).design
    devices = {PAIR: pair(), **{name: _device(name, each) for name, each in designs.items()}}
    say("loop")
    bench = _Bench(records=records, quick=quick, threads=threads)
    return SizedFrame(
        designs=designs,
        sizes={name: _size(each) for name, each in designs.items()},
        loop={name: bench.compared(device) for name, device in devices.items()},
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
    """The frame under motions that choose settings and motions that judge them."""

    def __init__(self, *, records: Path | None, quick: bool, threads: int) -> None:
        self.threads = threads
        self.n_currents = 5 if quick else 17
        self.weights = _WEIGHTS[::6] if quick else _WEIGHTS
        self.shares = _SHARES[-1:] if quick else _SHARES
        duration = 8.0 if quick else _DURATION
        self.choosing, self.judging = (
            [_motion(seed, duration) for seed in seeds[: 1 if quick else None]]
            for seeds in (_CHOOSING, _JUDGING)
        )
        self.recorded = [] if records is None else [_record(records / file) for _, file in RECORDS]

    def compared(self, device: mr.Device) -> dict[str, Any]:
        """The best constant current and the best clipped-optimal control, each judged on the other motions."""
        currents = np.linspace(0.0, device.largest_command, self.n_currents)
        scores = self._ratios(device, _constant(currents), self.choosing).mean(axis=(1, 2))
        best = int(scores.argmin())
        tried = []
        for share in self.shares:
            limited = replace(device, largest_command=share * device.largest_command)
            found = self._ratios(limited, _clipped(limited, self.weights), self.choosing).mean(axis=(1, 2))
            tried += [
                (float(score), limited, float(weight))
                for score, weight in zip(found, self.weights, strict=True)
            ]
        least, limited, weight = min(tried, key=lambda each: each[0])
        return {
            "currents": currents.tolist(),
            "scores": scores.tolist(),
            "at_largest_current": float(scores[-1]),
            "constant": {
                "score": float(scores[best]),
                "current_a": float(currents[best]),
                **self._judged(device, _constant(currents[[best]])),
            },
            "clipped": {
                "score": least,
                "current_a": limited.largest_command,
                "control_weight": weight,
                **self._judged(limited, _clipped(limited, np.array([weight]))),
            },
        }

    def _judged(self, device: mr.Device, law: mr.ControlLaw) -> dict[str, Any]:
        """Scores, their parts and peaks of a law on the motions that chose nothing, the records apart."""
        found: dict[str, Any] = self._judged_on(self.judging, device, law)
        if self.recorded:
            each = self._ratios(device, law, self.recorded)[0].mean(axis=1)
            found["records"] = {
                **self._judged_on(self.recorded, device, law),
                **{name: float(score) for (name, _), score in zip(RECORDS, each, strict=True)},
            }
        return found

    def _judged_on(
        self, motions: list[mr.GroundMotion], device: mr.Device, law: mr.ControlLaw
    ) -> dict[str, float]:
        parts = self._ratios(device, law, motions)[0].mean(axis=0)
        runs = self._run(device, law, motions)
        return {
            "judged": float(parts.mean()),
            **{name: float(value) for name, value in zip(SCORE, parts, strict=True)},
            "force_kn": 1e-3 * float(runs.peak_force[:, 0].max()),
            "stroke_mm": 1e3 * float(runs.peak_stroke[:, 0].max()),
        }

    def _ratios(self, device: mr.Device, law: mr.ControlLaw, motions: list[mr.GroundMotion]) -> Floats:
        """Criteria over those of the pair at i = 0, shape (candidates, motions, criteria)."""
        passive = values(self._run(pair(), _constant(np.zeros(1)), motions), weight=WEIGHT)
        runs = self._run(device, law, motions)
        found = values(runs, weight=WEIGHT)
        shape = (runs.shape[0], -1)
        return np.stack([found[name].reshape(shape) / passive[name] for name in SCORE], axis=2)

    def _run(self, device: mr.Device, law: mr.ControlLaw, motions: list[mr.GroundMotion]) -> mr.Responses:
        return mr.simulate_loop(FRAME, [device], law, motions, HARDWARE, threads=self.threads)


def _constant(currents: Floats) -> mr.ControlLaw:
    """A candidate for each current."""
    return mr.ControlLaw(name="passive", gains={"command": currents[:, None]})


def _clipped(device: mr.Device, weights: Floats) -> mr.ControlLaw:
    """A candidate for each control weight."""
    problem = DesignProblem(building=FRAME, devices=[device], sample_time=HARDWARE.sample_time)
    settings = [RegulatorSettings(control_weight=float(weight)) for weight in weights]
    law = design_candidates("clipped_optimal", problem, settings).law
    assert law is not None, "every positive control weight has a regulator"
    return law


def _record(file: Path) -> mr.GroundMotion:
    """A record as in chapter 6, at the peak of this study."""
    return scaled_to_peak(trimmed(mr.read_motion(file), end=LONGEST), PEAK * STANDARD_GRAVITY)


def _motion(seed: int, duration: float) -> mr.GroundMotion:
    """A draw of the Clough-Penzien spectrum of firm soil."""
    drawn = mr.synthetic_motion(rng=seed, duration=duration, name=f"seed {seed}")
    return scaled_to_peak(drawn, PEAK * STANDARD_GRAVITY)
