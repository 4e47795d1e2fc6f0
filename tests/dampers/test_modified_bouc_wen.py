"""The published prototype damper, the stiffest model in use, needs few sub-steps."""

from __future__ import annotations

import numpy as np
import pytest

from mrwork.dampers import damper
from mrwork.dampers.simulation import Loading, simulate_forces

DT = 1.0 / 3000.0
TIME = np.arange(0.0, 2.0, DT)
START = np.sin(0.5 * np.pi * np.minimum(TIME / 0.2, 1.0)) ** 2
STROKE = 0.006


def random_motion() -> np.ndarray:
    """Sinusoids of random phase up to 25 Hz, about 0.6 m/s at a stroke of 6 mm."""
    rng = np.random.default_rng(3)
    frequency = np.linspace(0.5, 25.0, 80)[:, None]
    return np.sin(2.0 * np.pi * (frequency * TIME + rng.random((80, 1)))).sum(axis=0)


MOTIONS = {
    "random": random_motion(),
    "sine": np.sin(2.0 * np.pi * 16.0 * TIME),
    "sweep": np.sin(2.0 * np.pi * (1.0 + 4.0 * TIME) * TIME),
}


@pytest.mark.parametrize("motion", MOTIONS)
def test_prototype_damper_is_resolved_to_a_thousandth_in_eight_substeps(motion: str) -> None:
    displacement = START * MOTIONS[motion]
    displacement *= STROKE / np.max(np.abs(displacement))
    history = Loading(dt=DT, displacement=displacement).history()
    assert 0.55 < history.peak_velocity < 0.75
    spec = damper("modified_bouc_wen")
    run = simulate_forces(spec, spec.nominal[None], history)
    exact = simulate_forces(spec, spec.nominal[None], history, substep_factor=64).force
    # With four sub-steps, step times relaxation rate would exceed the stability limit of 2.78.
    assert run.substeps[0] == 8
    assert np.max(np.abs(run.force - exact)) < 1e-3 * np.max(np.abs(exact))
