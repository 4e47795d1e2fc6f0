"""What entries of the dampers' table share: the recorded force of a model, from motion and command alone."""

from __future__ import annotations

from collections.abc import Callable

from numpy.typing import ArrayLike

import mrwork as mr
from studies.common.arrays import Floats

Predict = Callable[[mr.DamperTest], Floats]
"""Gives the force of a test, as its rig would record it [N], shape (n_time,)."""


def recorded_force(spec: mr.DamperSpec, theta: ArrayLike, test: mr.DamperTest) -> Floats:
    """Free-run simulation of a test: the force of the damper as its rig would record it [N], shape (n_time,)."""
    unit = None if spec.current is None else spec.current.unit
    loading = mr.Loading(
        dt=test.dt,
        displacement=test.displacement,
        velocity=test.velocity,
        command=test.command_in(unit),
        command_unit=unit,
    )
    return test.observation.observe(mr.simulate_force(spec, theta, loading), test.dt)
