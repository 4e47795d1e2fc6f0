"""The best of several candidates of a law on given motions, and the best constant command (optimal passive)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

import mrwork as mr
from mrwork.closed_loop import SCORE, STANDARD_GRAVITY, UserLaw, values

N_LEVELS = 17


def constant_commands(commands: ArrayLike) -> mr.ControlLaw:
    """A passive law for each command [A or V]."""
    return mr.ControlLaw(name="passive", gains={"command": np.reshape(commands, (-1, 1))})


def training_scores(
    law: mr.ControlLaw | UserLaw,
    building: mr.Building,
    damper: mr.Device,
    motions: Sequence[mr.GroundMotion],
    hardware: mr.Hardware,
) -> NDArray[np.float64]:
    """Mean of the four ratios to i = 0 over the motions, of each candidate, shape (n_candidates,)."""
    weight = building.total_mass * STANDARD_GRAVITY

    def criteria(law: mr.ControlLaw | UserLaw) -> NDArray[np.float64]:
        """Shape (n_criteria, n_candidates, n_motions)."""
        responses = mr.simulate_loop(building, [damper], law, motions, hardware)
        found = values(responses, weight=weight)
        return np.stack([found[name].reshape(-1, len(motions)) for name in SCORE])

    scores = (criteria(law) / criteria(constant_commands([0.0]))).mean(axis=(0, 2))
    return np.where(np.isfinite(scores), scores, np.inf)


def best_constant(
    building: mr.Building,
    damper: mr.Device,
    motions: Sequence[mr.GroundMotion],
    hardware: mr.Hardware,
) -> mr.ControlLaw:
    """The constant command with the least score on the motions, of 17 levels up to the largest one."""
    levels = np.linspace(0.0, damper.largest_command, N_LEVELS)
    scores = training_scores(constant_commands(levels), building, damper, motions, hardware)
    return constant_commands([levels[int(scores.argmin())]])
