"""The best of several candidates of a law on given motions, and the best constant command (optimal passive)."""

from __future__ import annotations

import numpy as np

import mrwork as mr
from mrwork.closed_loop import UserLaw
from studies.former.arrays import Floats
from studies.former.scores import constant_commands, criteria
from studies.leaderboard.entries import Motions

N_LEVELS = 17


def training_scores(
    law: mr.ControlLaw | UserLaw,
    building: mr.Building,
    damper: mr.Device,
    motions: Motions,
    hardware: mr.Hardware,
) -> Floats:
    """Mean of the four ratios to i = 0 over the motions, of each candidate, shape (n_candidates,)."""
    off = criteria(building, [damper], constant_commands([0.0]), motions, hardware)
    scores = (criteria(building, [damper], law, motions, hardware) / off).mean(axis=(1, 2))
    return np.where(np.isfinite(scores), scores, np.inf)


def best_constant(
    building: mr.Building, damper: mr.Device, motions: Motions, hardware: mr.Hardware
) -> mr.ControlLaw:
    """The constant command with the least score on the motions, of 17 levels up to the largest one."""
    levels = np.linspace(0.0, damper.largest_command, N_LEVELS)
    scores = training_scores(constant_commands(levels), building, damper, motions, hardware)
    return constant_commands([levels[int(scores.argmin())]])
