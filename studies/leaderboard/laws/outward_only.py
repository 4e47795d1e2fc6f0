"""On while the damper moves away from the middle, off on its way back: an example of a law in Python.

Authors: mrwork. Reference: none. The command on the way out is the best of eight on the training motions.
"""

from typing import Any

import numpy as np

import mrwork as mr


def design(building: Any, damper: Any, motions: Any, hardware: Any, rng: Any) -> Any:
    def criteria(law: Any) -> np.ndarray:
        """Largest drifts and accelerations, peaks and rms, shape (4, n_candidates, n_motions)."""
        found = mr.simulate_loop(building, [damper], law, motions, hardware)
        of_runs = found.peak_drift, found.peak_acceleration, found.rms_drift, found.rms_acceleration
        return np.stack([each.max(axis=1).reshape(-1, len(motions)) for each in of_runs])

    def outward(levels: np.ndarray) -> mr.closed_loop.UserLaw:
        def command(sample: mr.closed_loop.LoopSample, memory: np.ndarray) -> np.ndarray:
            is_outward = sample.deformation * sample.rate > 0.0
            return np.asarray(levels[sample.candidate, None] * is_outward)

        return mr.closed_loop.UserLaw(name="outward_only", command=command, n_candidates=len(levels))

    off = criteria(mr.ControlLaw(name="passive", gains={"command": [0.0]}))
    levels = np.linspace(0.125, 1.0, 8) * damper.largest_command
    scores = (criteria(outward(levels)) / off).mean(axis=(0, 2))
    return outward(levels[[int(np.argmin(scores))]])
