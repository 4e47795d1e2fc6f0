"""Optimal passive: the best constant command on the training motions, of 17 up to the largest one.

Authors: mrwork. Reference: none. It is the reference of the ratios of this table, too.
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

    off = criteria(mr.ControlLaw(name="passive", gains={"command": [0.0]}))
    levels = np.linspace(0.0, damper.largest_command, 17)
    scores = criteria(mr.ControlLaw(name="passive", gains={"command": levels[:, None]})) / off
    return mr.ControlLaw(name="passive", gains={"command": [levels[scores.mean(axis=(0, 2)).argmin()]]})
