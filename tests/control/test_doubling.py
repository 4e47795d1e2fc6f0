"""Doubling solves the Riccati equations that SciPy solves, and some that it does not."""

from __future__ import annotations

import numpy as np
import pytest
from control_samples import plant, shear_frame
from sentences import Refused

from mrwork.control import (
    accelerations,
    drifts,
    lyapunov_function,
    observer_of,
    optimal_surface,
    regulator_of_outputs,
    regulator_of_state,
)


@pytest.mark.parametrize("n_storeys", [1, 2, 8, 40])
def test_every_design_is_found_for_low_and_tall_buildings(n_storeys: int) -> None:
    """Sensors of a hundred-millionth of the ground's intensity among them, on which the pencil of SciPy fails at 8."""
    for n_devices in {1, min(n_storeys, 4)}:
        system = plant(n_devices, shear_frame(n_storeys))
        undamped = np.linalg.eigvals(system.A).real.max()
        for regulator in (
            regulator_of_state(system, system.energy, 1e-9),
            regulator_of_outputs(system, drifts(system), np.full(n_storeys, 1e6), 1e-13),
            regulator_of_outputs(system, accelerations(system), np.ones(n_storeys), 1e-17),
        ):
            assert regulator.residual < 1e-9
            assert regulator.poles.real.max() < 0.0
        assert undamped < 0.0
        lyapunov_function(system)
        assert optimal_surface(system).poles.real.max() < 0.0
        for noise in (0.02, 1e-8):
            observer = observer_of(system, accelerations(system), 1e-3, noise_intensity=noise)
            decay = np.linalg.solve(
                system.scaling, (observer.Ad - observer.gain @ observer.C) @ system.scaling
            )
            assert np.abs(np.linalg.eigvals(decay)).max() < 1.0


def test_a_regulator_beyond_double_precision_is_refused(refused: Refused) -> None:
    """The roof of forty storeys, from a device at the ground, for next to nothing."""
    system = plant(1, shear_frame(40))
    weights = np.append(np.zeros(39), 1.0)
    refused(regulator_of_outputs, system, accelerations(system), weights, 1e-22)
