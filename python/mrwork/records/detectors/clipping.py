"""Detector of clipping: channels that reached the end of their range."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.records.damper_test import DamperTest, Finding, Measured

_SHORTEST_RUN: Final = 3
_FEWEST_RUNS: Final = 2
# A parabola with slope s per sample at the cut would have risen by s n / 4 over the n samples cut. Rounding alone
# gives less than one step of the resolution.
_OVERSHOOT_STEPS: Final = 4.0


def clipped_share(samples: NDArray[np.float64]) -> float:
    """Fraction of the samples of a channel, shape (n_time,), in clipped peaks.

    A clipped peak is a run of three or more samples at the extreme value of the channel, with slopes beside it so steep
    that the curve would have continued by more than four steps of its resolution. A single one does not count, because
    it may be rest.
    """
    levels = np.unique(samples)
    if levels.size < 2 * _SHORTEST_RUN:
        return 0.0
    resolution = float(np.diff(levels).min())
    flat = sum(_flat_samples(side * samples, resolution) for side in (1.0, -1.0))
    return flat / samples.size


def clipping_findings(test: DamperTest) -> tuple[Finding, ...]:
    """Warn of clipped channels."""
    channels = [("displacement", test.displacement), ("force", test.force)]
    if test.velocity_source == "measured":
        channels.append(("velocity", test.velocity))
    shares = [(name, clipped_share(samples)) for name, samples in channels]
    return tuple(
        Finding(
            code="clipped",
            severity="warning",
            message=f"the {name} is clipped at its extreme in {100 * share:.2g} % of its samples: the channel "
            "exceeded its range; measure again with a wider one, or omit these parts",
            measured=Measured(value=share, unit=""),
        )
        for name, share in shares
        if share > 0.0
    )


def _flat_samples(samples: NDArray[np.float64], resolution: float) -> int:
    """Number of samples in runs at the maximum with steep flanks."""
    at_top = np.concatenate([[False], samples == samples.max(), [False]])
    edges = np.flatnonzero(np.diff(at_top))
    begin, end = edges[::2], edges[1::2]
    inside = (end - begin >= _SHORTEST_RUN) & (begin >= 2) & (end + 2 <= samples.size)
    begin, end = begin[inside], end[inside]
    rise = 0.5 * (samples[begin] - samples[begin - 2])
    fall = 0.5 * (samples[end - 1] - samples[end + 1])
    # Both flanks must be steep; with one steep flank only, it may be a start from rest.
    overshoot = np.minimum(rise, fall) * (end - begin) / 4.0
    cut = overshoot > _OVERSHOOT_STEPS * resolution
    return int(np.sum((end - begin)[cut])) if np.count_nonzero(cut) >= _FEWEST_RUNS else 0
