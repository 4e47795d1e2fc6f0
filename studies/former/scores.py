"""The score of a law: four criteria of its runs, and the constant commands that it is compared with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

import mrwork as mr
from mrwork.closed_loop import SCORE, Scales, UserLaw, values
from studies.former.arrays import Floats

PEAKS = ("peak_drift", "peak_acceleration")
TITLES = dict(zip(SCORE, ("peak drift", "peak acc.", "rms drift", "rms acc."), strict=True))
"""Headings of the criteria."""


def constant_commands(commands: ArrayLike) -> mr.ControlLaw:
    """A passive law with a candidate for each command [A or V]."""
    return mr.ControlLaw(name="passive", gains={"command": np.reshape(commands, (-1, 1))})


def criteria(
    building: mr.Building,
    devices: Sequence[mr.Device],
    law: mr.ControlLaw | UserLaw,
    motions: Sequence[mr.GroundMotion],
    hardware: mr.Hardware,
    *,
    nominal: mr.Building | None = None,
    threads: int = 0,
    names: Sequence[str] = SCORE,
) -> Floats:
    """Criteria of each candidate under each motion, shape (n_candidates, n_motions, n_names): those of the score."""
    responses = mr.simulate_loop(building, devices, law, motions, hardware, nominal=nominal, threads=threads)
    judged = values(responses, Scales.of(building))
    return np.stack([judged[name].reshape(-1, len(motions)) for name in names], axis=-1)
