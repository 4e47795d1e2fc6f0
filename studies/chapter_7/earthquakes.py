"""Commands of the table, measured records where they are at hand, else synthetic motions; what they take of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt

import mrwork as mr
from mrwork.closed_loop import STANDARD_GRAVITY
from mrwork.motions import brought_to_rest, scaled_to_peak, trimmed
from studies.chapter_7.virtual_rig import TABLE
from studies.former.command import Work
from studies.former.frame import CHOOSING, RECORDS

PEAK = 0.3
"""Peak of the commands [g]."""
CORNER = 0.4
"""Corner of the high-pass of the commands [Hz]: a table has no stroke for slower motion, and 3 Hz is far above."""
LEAD = 2.0
"""Time that the table rests before a motion [s]."""
LONGEST = 30.0
"""Of a record, whose rest is cut off [s]."""
# Time after a record, in which the high-pass comes to rest, and padding about it for the filter [s].
_TAIL, _PADDING = 3.0, 20.0
# Seeds of motions that stand in for absent records.
_STAND_IN = (11, 12, 13, 14)


def natural(work: Work) -> list[mr.GroundMotion]:
    """The four records as they were measured, or four synthetic motions; a short one in the quick form."""
    if work.quick:
        return [synthetic(_STAND_IN[0], 8.0)]
    if work.records is None:
        return [synthetic(seed, 20.0) for seed in _STAND_IN]
    return [
        replace(trimmed(mr.read_motion(work.records / file), end=LONGEST), name=name)
        for name, file in RECORDS
    ]


def choosing(work: Work) -> list[mr.GroundMotion]:
    """What the specimen gets of the motions on which settings are chosen."""
    seeds, duration = (CHOOSING[:1], 8.0) if work.quick else (CHOOSING, 20.0)
    return driven([synthetic(seed, duration) for seed in seeds])


def synthetic(seed: int, duration: float) -> mr.GroundMotion:
    """A draw of the Clough-Penzien spectrum of firm soil."""
    return mr.synthetic_motion(rng=seed, duration=duration, peak=4.0, name=f"synthetic {seed}")


def command(motion: mr.GroundMotion) -> mr.GroundMotion:
    """A record as a command: high-passed forwards and backwards, with rest before it, still at its end."""
    rest, tail, padding = (round(seconds / motion.dt) for seconds in (LEAD, _TAIL, _PADDING))
    zeros = np.zeros(padding)
    sections = butter(2, CORNER, "highpass", fs=1.0 / motion.dt, output="sos")
    filtered = sosfiltfilt(sections, np.concatenate((zeros, motion.acceleration, zeros)))
    kept = filtered[padding - rest : filtered.size - padding + tail]
    passed = replace(motion, acceleration=kept, changes=(*motion.changes, f"high-passed at {CORNER:g} Hz"))
    return brought_to_rest(passed)


def driven(motions: list[mr.GroundMotion]) -> list[mr.GroundMotion]:
    """What the specimen gets of the commands, scaled to the peak of the study; refused where a limit binds."""
    return [TABLE.driven(scaled_to_peak(command(motion), PEAK * STANDARD_GRAVITY)) for motion in motions]


def demands(motions: list[mr.GroundMotion]) -> dict[str, Any]:
    """What each command takes of the table at its natural amplitude, the limit nearest, and the factor to it."""
    found = {}
    for motion in motions:
        whole = command(motion)
        taken = TABLE.demand(whole)
        scaled = TABLE.demand(scaled_to_peak(whole, PEAK * STANDARD_GRAVITY))
        found[motion.name] = {
            "peak_g": whole.peak / STANDARD_GRAVITY,
            "stroke_mm": 1e3 * taken.stroke,
            "velocity_mm_s": 1e3 * taken.velocity,
            "acceleration_g": taken.acceleration / STANDARD_GRAVITY,
            "limit": taken.limit,
            "share": taken.share,
            "share_scaled": scaled.share,
            "limit_scaled": scaled.limit,
            "unfiltered_stroke_mm": 1e3 * TABLE.demand(motion).stroke,
        }
    return found
