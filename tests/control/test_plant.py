"""The state space of a building with devices says what its equations of motion say."""

from dataclasses import replace

import numpy as np
from control_samples import plant
from refusals import refusal

import mrwork as mr
from mrwork.control import accelerations, deformations, displacements, drifts, plant_of, velocities
from mrwork.control.linear.plant import deformation_rates, stack_outputs

RNG = np.random.default_rng(6)


def test_a_force_along_the_elongation_takes_energy_out() -> None:
    """dE/dt of an undamped building at rest but for the device is -f e q', to rounding."""
    building = replace(mr.building("dyke1996"), damping=np.zeros((3, 3)))
    system = plant_of(building, building.storeys[1:2])
    s = RNG.standard_normal(6) * [1e-3, 1e-3, 1e-3, 0.1, 0.1, 0.1]
    force = np.array([300.0])
    power = s @ system.energy @ (system.A @ s + system.B @ force)
    np.testing.assert_allclose(power, -force[0] * (system.attachment @ s[3:])[0], rtol=1e-9)


def test_scaled_state_counts_energy() -> None:
    system = plant()
    s = RNG.standard_normal(6)
    z = np.linalg.solve(system.scaling, s)
    np.testing.assert_allclose(z @ z, s @ system.energy @ s, rtol=1e-12)


def test_a_building_without_a_restoring_force_is_scaled_too() -> None:
    building = mr.building("dyke1996")
    loose = replace(building, stiffness=building.stiffness - np.diag([12.0e5 - 6.84e5, 0.0, 0.0]))
    scaling = plant_of(loose, loose.storeys[:1]).scaling
    assert np.linalg.matrix_rank(scaling) == 6


def test_outputs_are_what_they_are_called() -> None:
    building = mr.building("dyke1996")
    system = plant(2)
    s, f, a_g = RNG.standard_normal(6), RNG.standard_normal(2), -0.4
    q, rate = s[:3], s[3:]
    second = (system.A @ s + system.B @ f + system.E * a_g)[3:]
    expected = {
        drifts: building.storeys @ q,
        displacements: q,
        velocities: rate,
        accelerations: second + a_g,
        deformations: building.storeys[:2] @ q,
        deformation_rates: building.storeys[:2] @ rate,
    }
    for outputs_of, values in expected.items():
        outputs = outputs_of(system)
        np.testing.assert_allclose(
            outputs.C @ s + outputs.D @ f + outputs.G * a_g, values, rtol=1e-9, atol=1e-9
        )
        assert len(outputs.names) == len(values)


def test_outputs_are_selected_by_name() -> None:
    both = stack_outputs(accelerations(plant()), deformations(plant()))
    chosen = both.select(["deformation device 1", "acceleration floor 3"])
    np.testing.assert_array_equal(chosen.C, both.C[[3, 2]])
    refusal(both.select, ["acceleration floor 4"], match="choose from acceleration floor 1")
