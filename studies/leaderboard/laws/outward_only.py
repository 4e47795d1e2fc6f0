"""On while the damper moves away from the middle, off on its way back: an example of a law in Python.

Authors: mrwork. Reference: none. The command on the way out is the best of eight on the training motions.
"""

import numpy as np
from numpy.typing import NDArray

import mrwork as mr
from mrwork.closed_loop import LoopSample, UserLaw
from studies.leaderboard.best_constant import training_scores
from studies.leaderboard.entries import Motions, Rng


def design(
    building: mr.Building, damper: mr.Device, motions: Motions, hardware: mr.Hardware, rng: Rng
) -> UserLaw:
    levels = np.linspace(0.125, 1.0, 8) * damper.largest_command

    def outward(levels: NDArray[np.float64]) -> UserLaw:
        def command(sample: LoopSample, memory: NDArray[np.float64]) -> NDArray[np.float64]:
            is_outward = sample.deformation * sample.rate > 0.0
            return levels[sample.candidate, None] * is_outward

        return UserLaw(name="outward_only", command=command, n_candidates=len(levels))

    scores = training_scores(outward(levels), building, damper, motions, hardware)
    return outward(levels[[int(np.argmin(scores))]])
