"""The records of this study: a damper under a motion that swells and ebbs at 2.5 Hz, simulated, with white noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import mrwork as mr
from mrwork.records import DamperTest
from studies.former.arrays import Floats

# Step [s], and deviation of the noise [N].
DT, NOISE_N = 1e-3, 8.0
_AMPLITUDE, _FREQUENCY, _SWELL = 0.015, 2.5, 0.3


def record(model: str, n_time: int) -> DamperTest:
    """A test of the nominal damper, `n_time` samples `DT` apart, whose motion is known exactly."""
    time = DT * np.arange(n_time)
    omega, slow = 2.0 * np.pi * _FREQUENCY, 2.0 * np.pi * _SWELL
    swell, swelling = 0.6 + 0.4 * np.sin(slow * time), 0.4 * slow * np.cos(slow * time)
    displacement = _AMPLITUDE * swell * np.sin(omega * time)
    velocity = _AMPLITUDE * (swelling * np.sin(omega * time) + omega * swell * np.cos(omega * time))
    spec = mr.damper(model)
    motion = mr.Loading(dt=DT, displacement=displacement, velocity=velocity)
    noise = NOISE_N * np.random.default_rng(0).standard_normal(n_time)
    test = mr.test_from_arrays(
        name=f"{model}, {n_time} samples",
        time=time,
        displacement=displacement,
        velocity=velocity,
        force=mr.simulate(spec, spec.nominal, motion) + noise,
        synthetic=True,
    )
    # It was simulated from rest, so its first samples are as good as others.
    return replace(test, n_settle=0)


def near_nominal(model: str, count: int) -> Floats:
    """Candidates about the nominal damper, shape (count, n_params); one alone has the shape (n_params,)."""
    theta = np.array(mr.damper(model).nominal)
    factors = np.random.default_rng(1).uniform(0.98, 1.0, (count, len(theta)))
    return theta * (factors if count > 1 else factors[0])
