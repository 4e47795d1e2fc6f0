"""Dampers sized for the five-storey frame at 0.3 g, in the loop beside the pair of RD-1005-3, which saturates there.

Each damper stands between ground and floor 1. Constant currents and clipped-optimal control are chosen on two synthetic
motions and judged on two others, which chose nothing, and on the four records of chapter 6 where these are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import mrwork as mr
from mrwork.closed_loop import SCORE
from mrwork.dampers import design
from studies.former.arrays import Floats
from studies.former.command import Work
from studies.former.frame import (
    CHOOSING,
    FRAME,
    HARDWARE,
    JUDGING,
    RECORDS,
    pair,
    recorded_motions,
    regulators,
    score_criteria,
    score_ratios,
    synthetic_motions,
)
from studies.former.scores import constant_commands

PEAK = 0.3
"""Peak of the ground motions [g]."""
FORCES = (4e3, 8e3, 12e3)
"""Desired forces of the sized dampers [N]."""
SUPPLY = 24.0
"""Voltage of the current driver [V]."""
PAIR = pair().name
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


def sized_frame(work: Work) -> SizedFrame:
    """Size the dampers and run them, also under the measured records.

    The quick form has the smallest wish, one motion that chooses and one that judges, and fewer settings.
    """
    designs = {}
    for force in FORCES[:1] if work.quick else FORCES:
        work.say(f"damper of {1e-3 * force:g} kN")
        designs[f"sized, {1e-3 * force:g} kN"] = design.size_damper(
            wishes(force),
            fluid=design.fluid("MRF-132DG"),
            steel=design.steel("AISI 1010"),
            budget=700 if work.quick else 3000,
        ).design
    devices = {PAIR: pair(), **{name: _device(name, damper) for name, damper in designs.items()}}
    work.say("loop")
    bench = _Bench(work)
    return SizedFrame(
        designs=designs,
        sizes={name: _size(damper) for name, damper in designs.items()},
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

    def __init__(self, work: Work) -> None:
        self.threads = work.threads
        self.n_currents = 5 if work.quick else 17
        self.weights = _WEIGHTS[::6] if work.quick else _WEIGHTS
        self.shares = _SHARES[-1:] if work.quick else _SHARES
        self.choosing = synthetic_motions(CHOOSING, PEAK, quick=work.quick)
        self.judging = synthetic_motions(JUDGING, PEAK, quick=work.quick)
        self.recorded = [] if work.records is None else recorded_motions(work.records, PEAK)

    def compared(self, device: mr.Device) -> dict[str, Any]:
        """The best constant current and the best clipped-optimal control, each judged on the other motions."""
        currents = np.linspace(0.0, device.largest_command, self.n_currents)
        scores = self._scores(device, constant_commands(currents))
        best = int(scores.argmin())
        tried = []
        for share in self.shares:
            limited = replace(device, largest_command=share * device.largest_command)
            limited_scores = self._scores(limited, _clipped(limited, self.weights))
            tried += [
                (float(score), limited, float(weight))
                for score, weight in zip(limited_scores, self.weights, strict=True)
            ]
        least, limited, weight = min(tried, key=lambda setting: setting[0])
        return {
            "currents": currents.tolist(),
            "scores": scores.tolist(),
            "at_largest_current": float(scores[-1]),
            "constant": {
                "score": float(scores[best]),
                "current_a": float(currents[best]),
                **self._judged(device, constant_commands(currents[best])),
            },
            "clipped": {
                "score": least,
                "current_a": limited.largest_command,
                "control_weight": weight,
                **self._judged(limited, _clipped(limited, [weight])),
            },
        }

    def _scores(self, device: mr.Device, law: mr.ControlLaw) -> Floats:
        """Score of each candidate on the motions that choose."""
        ratios, _ = self._run(device, law, self.choosing)
        return ratios.mean(axis=(1, 2))

    def _judged(self, device: mr.Device, law: mr.ControlLaw) -> dict[str, Any]:
        """Scores, their parts and peaks of a law on the motions that chose nothing, the records apart."""
        found: dict[str, Any] = self._judged_on(self.judging, device, law)
        if self.recorded:
            found["records"] = self._judged_on(self.recorded, device, law)
        return found

    def _judged_on(
        self, motions: list[mr.GroundMotion], device: mr.Device, law: mr.ControlLaw
    ) -> dict[str, float]:
        (ratios,), runs = self._run(device, law, motions)
        parts = ratios.mean(axis=0)
        by_record = zip(RECORDS, ratios.mean(axis=1), strict=True) if motions is self.recorded else ()
        return {
            "judged": float(parts.mean()),
            **{name: float(value) for name, value in zip(SCORE, parts, strict=True)},
            "force_kn": 1e-3 * float(runs.peak_force[:, 0].max()),
            "stroke_mm": 1e3 * float(runs.peak_stroke[:, 0].max()),
            **{title: float(score) for (title, _), score in by_record},
        }

    def _run(
        self, device: mr.Device, law: mr.ControlLaw, motions: Sequence[mr.GroundMotion]
    ) -> tuple[Floats, mr.Responses]:
        """Criteria over those of the pair at i = 0, shape (candidates, motions, criteria), and the runs."""
        off, runs = (
            mr.simulate_loop(FRAME, [driven], by, motions, HARDWARE, threads=self.threads)
            for driven, by in ((pair(), constant_commands(0.0)), (device, law))
        )
        return score_ratios(runs, score_criteria(off)), runs


def _clipped(device: mr.Device, weights: Sequence[float] | Floats) -> mr.ControlLaw:
    """A candidate for each control weight."""
    return regulators("clipped_optimal", FRAME, device, weights)
