"""Loops for the tests of the twin: the benchmark's five storeys, and a frame of two with a damper of its own states."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

import mrwork as mr
from mrwork.dampers import PUBLISHED_SETS
from mrwork.twins.loop_stepping import LoopDevice, LoopPlant, half_steps
from studies.speed.loop_workload import LAG, LoopWorkload

STEP = 2e-3


def storeys_of(n: int) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Drifts of a chain from displacements of its floors."""
    return np.eye(n) - np.eye(n, k=-1)


def five_storeys(workload: LoopWorkload) -> tuple[LoopPlant, tuple[LoopDevice, ...]]:
    """The building of the benchmark, with its pair."""
    plant = LoopPlant.of(
        mass=np.diag(workload.mass),
        damping=workload.damping,
        stiffness=workload.stiffness,
        influence=np.ones(5),
        floors=np.eye(5),
        storeys=storeys_of(5),
    )
    (published,) = (entry for entry in PUBLISHED_SETS if entry.name == "kwok2006")
    preset = mr.damper("static_hysteretic").preset("kwok2006")
    current = preset.spec.current
    assert current is not None
    laws = dict(zip(published.values, current.laws, strict=True))
    spec = mr.damper("static_hysteretic").with_current_laws(laws, lagged=True)
    theta = jnp.array([*preset.theta, LAG])
    row = jnp.eye(5)[0]
    return plant, (LoopDevice(spec=spec, theta=theta, row=row, differential=True),)


def two_storeys() -> tuple[LoopPlant, tuple[LoopDevice, ...]]:
    """Two masses of 22.7 kg on springs of 29.7 kN/m and a Bouc-Wen damper below."""
    stiffness = 29.7e3 * np.array([[2.0, -1.0], [-1.0, 1.0]])
    plant = LoopPlant.of(
        mass=22.7 * np.eye(2),
        damping=1e-3 * stiffness,
        stiffness=stiffness,
        influence=np.ones(2),
        floors=np.eye(2),
        storeys=storeys_of(2),
    )
    spec = mr.damper("normalised_bouc_wen").with_current_laws({"c": "linear", "k_w": "linear"}, lagged=True)
    # c and k_w by the current, k, x0, rho, sigma, n, eta.
    theta = jnp.array([10.0, 10.0, 100.0, 0.0, 4.0, 8.0, 500.0, 0.8, 1.5, LAG])
    return plant, (LoopDevice(spec=spec, theta=theta, row=jnp.eye(2)[0]),)


LARGEST = 5.0


def a_ground(n_steps: int, step: float = STEP) -> Array:
    """A sweep through the frame's frequencies, 1 m/s^2."""
    time = 0.01 * np.arange(round(n_steps * step / 0.01) + 1)
    return jnp.asarray(half_steps(np.sin(2.0 * np.pi * (1.0 + 2.0 * time) * time), 0.01, step, n_steps))
