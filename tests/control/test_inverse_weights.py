"""Weights of a given gain: exact where the gain is optimal, of the nearest gain where it is not."""

from __future__ import annotations

import numpy as np
import pytest
from refusals import refusal

import mrwork as mr
from mrwork.control import Plant, drifts, inverse_weights, plant_of, regulator_of_outputs, regulator_of_state
from mrwork.control.laws.regulator_settings import RegulatorSettings

FRAME = mr.building("uts")


def plant(n_devices: int = 1) -> Plant:
    return plant_of(FRAME, FRAME.storeys[:n_devices])


@pytest.mark.parametrize("control_weight", [1e-7, 1e-10, 1e-13])
def test_the_gain_of_a_regulator_is_optimal_for_weights_that_are_found(control_weight: float) -> None:
    gain = regulator_of_outputs(plant(), drifts(plant()), 1.0, control_weight).gain
    found = inverse_weights(plant(), gain)
    assert found.optimal
    assert found.distance <= 1e-5
    again = regulator_of_state(plant(), found.state_weight, found.control_weight).gain
    np.testing.assert_allclose(again, found.gain, rtol=1e-6, atol=1e-6 * np.abs(gain).max())
    RegulatorSettings(state_weight=found.state_weight, control_weight=found.control_weight)


def test_two_devices_of_different_weight() -> None:
    R = np.array([1e-10, 3e-10])
    gain = regulator_of_outputs(plant(2), drifts(plant(2)), 1.0, R).gain
    found = inverse_weights(plant(2), gain, control_weight=R)
    assert found.distance <= 1e-5
    np.testing.assert_array_equal(found.control_weight, R)


def test_a_dashpot_is_optimal_and_a_spring_beside_it_is_not() -> None:
    """Feedback of the rate at the device satisfies the circle criterion; a softening spring does not."""
    gain = np.zeros((1, 10))
    gain[0, 5] = -1e4
    assert inverse_weights(plant(), gain).optimal
    gain[0, 0] = -1e5
    found = inverse_weights(plant(), gain)
    assert not found.optimal
    assert 1e-3 < found.distance < 0.1


def test_a_gain_that_cannot_be_is_refused() -> None:
    for gain, word in ((np.zeros((1, 10)), "not all zero"), (np.eye(10)[5:6] * 1e5, "not stable")):
        refusal(inverse_weights, plant(), gain, match=word)
