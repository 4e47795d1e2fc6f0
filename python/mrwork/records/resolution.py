"""Detectors of what a channel does not resolve: its range, its smallest step, its samples."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats
from mrwork.records.damper_test import DamperTest, Finding, Measured
from mrwork.records.motion import SmoothMotion

_SHORTEST_RUN: Final = 3
_FEWEST_RUNS: Final = 2
# A parabola with slope s per sample at the cut would have risen by s n / 4 over the n samples cut. Rounding alone
# gives less than one step of the resolution.
_OVERSHOOT_STEPS: Final = 4.0
# Rounding to this share of half the range is an error of 0.7 % of it, rms, and makes plateaus as clipping does.
_COARSE: Final = 0.025
_FEWEST_LEVELS: Final = 5
_FEWEST_PER_LEVEL: Final = 5
# Levels are whole steps apart, but for this share of one; what is closer than this share of the range is rounding.
_OFF_THE_STEPS: Final = 0.05
_ROUNDED: Final = 1e-9


def _channels(test: DamperTest) -> list[tuple[str, Floats, str]]:
    """The measured channels with their units."""
    channels = [("displacement", test.displacement, "m"), ("force", test.force, "N")]
    return [*channels, ("velocity", test.velocity, "m/s")] if test.velocity_source == "measured" else channels


def resolution_findings(test: DamperTest, _: SmoothMotion) -> tuple[Finding, ...]:
    """Warn of channels with few levels, of clipped ones, and of those whose samples are held."""
    found: list[Finding] = []
    for name, samples, unit in _channels(test):
        step = coarse_step(samples)
        if step is not None:
            found.append(_of_coarse(name, samples, step, unit))
        elif (share := clipped_share(samples)) > 0.0:
            found.append(_of_clipped(name, share))
        if (held := held_samples(samples)) > 1:
            found.append(_of_held(name, held, test.dt))
    return tuple(found)


def _of_coarse(name: str, samples: Floats, step: float, unit: str) -> Finding:
    half = 0.5 * float(np.ptp(samples))
    message = (
        f"the {name} is read in steps of {step:.3g} {unit}, {100 * step / half:.2g} % of its half range of {half:.4g} "
        f"{unit}"
    )
    action = "measure again with a smaller range or more digits"
    return Finding.warning("coarse", message, action=action, measured=Measured(value=step, unit=unit))


def _of_clipped(name: str, share: float) -> Finding:
    message = (
        f"the {name} is clipped at its extreme in {100 * share:.2g} % of its samples: the channel exceeded its "
        "range"
    )
    action = "measure again with a wider one, or omit these parts"
    return Finding.warning("clipped", message, action=action, measured=Measured(value=share, unit=""))


def _of_held(name: str, held: int, dt: float) -> Finding:
    message = (
        f"the {name} has a new value in one of {held} samples only: it is sampled at {1.0 / (held * dt):.3g} Hz, and "
        f"late by {500.0 * (held - 1) * dt:.3g} ms in the mean"
    )
    action = f"use --every {held}, or sample all channels alike"
    return Finding.warning(
        "held_samples", message, action=action, measured=Measured(value=held, unit="samples")
    )


def coarse_step(samples: Floats) -> float | None:
    """Step between the levels of a channel, shape (n_time,), if it is coarse; `None` otherwise."""
    levels = np.unique(samples)
    whole = float(levels[-1] - levels[0])
    gaps = np.diff(levels)
    gaps = gaps[gaps > _ROUNDED * whole]
    if not _FEWEST_LEVELS <= gaps.size + 1 <= samples.size / _FEWEST_PER_LEVEL:
        return None
    step = float(gaps.min())
    if step <= 0.5 * _COARSE * whole:
        return None
    return step if np.all(np.abs(gaps / step - np.round(gaps / step)) < _OFF_THE_STEPS) else None


def clipped_share(samples: Floats) -> float:
    """Fraction of the samples of a channel, shape (n_time,), in clipped peaks.

    Such a peak is a run of three or more samples at the extreme value, with slopes beside it so steep that the curve
    would have continued by four steps of its resolution. A single one may be rest.
    """
    levels = np.unique(samples)
    if levels.size < 2 * _SHORTEST_RUN:
        return 0.0
    resolution = float(np.diff(levels).min())
    flat = sum(_flat_samples(side * samples, resolution) for side in (1.0, -1.0))
    return flat / samples.size


def _flat_samples(samples: Floats, resolution: float) -> int:
    """Number of samples in runs at the maximum with steep flanks."""
    at_top = np.concatenate([[False], samples == samples.max(), [False]])
    edges = np.flatnonzero(np.diff(at_top))
    begin, end = edges[::2], edges[1::2]
    inside = (end - begin >= _SHORTEST_RUN) & (begin >= 2) & (end + 2 <= samples.size)
    begin, end = begin[inside], end[inside]
    # Both flanks must be steep; with one steep flank only, it may be a start from rest. They must be so beside the run,
    # and for a quarter of its length: of a rounded curve the nearest step alone is steep.
    slopes = [
        (samples[at] - samples[np.clip(at + side * length, 0, samples.size - 1)]) / length
        for at, side in ((begin, -1), (end - 1, 1))
        for length in (2, np.maximum((end - begin) // 4, 2))
    ]
    overshoot = np.minimum.reduce(slopes) * (end - begin) / 4.0
    cut = overshoot > _OVERSHOOT_STEPS * resolution
    return int(np.sum((end - begin)[cut])) if np.count_nonzero(cut) >= _FEWEST_RUNS else 0


_FEWEST_CHANGES: Final = 20
# Share of the changes that are as far apart as most are, and of those that are a whole number of that apart.
_ALIKE: Final = 0.5
_IN_TIME: Final = 0.95
# Changes of a slow channel are of one step of its resolution each, and as far apart as it is slow.
_STEPS_AT_ONCE: Final = 3.0


def held_samples(samples: Floats) -> int:
    """Number of samples for which a channel, shape (n_time,), holds each of its values; 1 for one that does not."""
    changes = np.diff(samples)
    changed = np.flatnonzero(changes)
    if not _FEWEST_CHANGES <= changed.size <= samples.size // 2:
        return 1
    apart: NDArray[np.intp] = np.diff(changed)
    held = int(np.median(apart))
    sizes = np.abs(changes[changed])
    regular = np.mean(apart == held) > _ALIKE and np.mean(apart % held == 0) > _IN_TIME
    return held if held > 1 and regular and np.median(sizes) > _STEPS_AT_ONCE * sizes.min() else 1
