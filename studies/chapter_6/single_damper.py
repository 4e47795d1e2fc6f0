"""Dampers that push one way against the differential pair: the offset that the pair removes, and the peaks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mrwork.closed_loop import simulate_loop
from mrwork.motions import GroundMotion
from studies.chapter_6.direct_laws import SHOWN, Controlled, controlled_at, motions_at
from studies.common.frame import FRAME, HARDWARE, LEVELS, Bench, level_name

PAIR, TWO, ONE = "pair in opposition", "two, one way", "one"
ARRANGEMENTS: dict[str, tuple[float, bool]] = {PAIR: (1.0, True), TWO: (2.0, False), ONE: (1.0, False)}
"""Number of dampers of each direction, and whether as many are opposed to them."""
# The frame is at rest before a record, and comes to rest after it; in the last second of each the offset is read [s].
_STILL, _READ = 20.0, 1.0


def arrangements_found(over: Bench, constants: Sequence[float], *, quick: bool) -> dict[str, Any]:
    """By level, control, arrangement and record: offsets of floor 1 [mm], peaks, and the current at rest [A].

    Laws have the settings of the pair. The quick form has the first record at the first level.
    """
    levels = LEVELS[:1] if quick else LEVELS
    return {
        level_name(level): {
            row.label: {
                name: _of(over, row, arrangement, motions_at(over, number)[: 1 if quick else None])
                for name, arrangement in ARRANGEMENTS.items()
            }
            for row in controlled_at(number, constants[number], SHOWN)
        }
        for number, level in enumerate(levels)
    }


def _of(
    over: Bench, row: Controlled, arrangement: tuple[float, bool], motions: Sequence[GroundMotion]
) -> dict[str, Any]:
    count, differential = arrangement
    device = replace(row.device, count=count, differential=differential)
    table = {}
    for motion in motions:
        found = simulate_loop(
            FRAME, [device], row.law, [between_rests(motion)], HARDWARE, histories=True, threads=over.threads
        )
        assert found.histories is not None
        (history,) = found.histories
        before = (history.time > _STILL - _READ) & (history.time <= _STILL)
        after = history.time > history.time[-1] - _READ
        table[motion.name] = {
            "before": 1e3 * float(history.displacement[before, 0].mean()),
            "after": 1e3 * float(history.displacement[after, 0].mean()),
            "current_before": float(history.current[before, 0].mean()),
            "current_after": float(history.current[after, 0].mean()),
            "peak_displacement": 1e3 * float(found.peak_displacement[0, 0]),
            "peak_drift": 1e3 * float(found.peak_drift[0].max()),
            "peak_acceleration": float(found.peak_acceleration[0].max()),
            "peak_acceleration_1": float(found.peak_acceleration[0, 0]),
        }
    return table


def between_rests(motion: GroundMotion) -> GroundMotion:
    """A motion with the ground at rest before and after it."""
    # Between samples the ground runs straight: it is at rest up to the last zero.
    still = np.zeros(round(_STILL / motion.dt) + 1)
    acceleration = np.concatenate([still, np.asarray(motion.acceleration), still])
    return GroundMotion(name=motion.name, dt=motion.dt, acceleration=acceleration)
