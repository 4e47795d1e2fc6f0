"""Every model written as a damper of a user: its equations, recorded, are the crate's."""

import numpy as np
import pytest
from damper_samples import noise, random_theta
from own_models import own_model

import mrwork as mr
from mrwork import _rust
from mrwork.dampers.simulation import simulate_forces, simulate_sensitivities

FRAME = mr.buildings.shear_building(name="frame", masses=[500.0, 400.0], stiffnesses=[6e5, 5e5])
SHAKE = mr.synthetic_motion(rng=1, duration=1.0, peak=0.5)


@pytest.fixture(scope="module")
def own(spec: mr.DamperSpec) -> mr.DamperSpec:
    return own_model(spec.name)


def test_force_and_rate_are_those_of_the_crate(spec: mr.DamperSpec, own: mr.DamperSpec) -> None:
    rng = np.random.default_rng(11)
    for theta in random_theta(spec, 40, rng=12):
        x, v = rng.normal(size=2) * [0.01, 0.2]
        magnitude = 10.0 ** rng.uniform(-4.0, 0.3, (6, spec.n_states))
        states = magnitude * rng.choice([-1.0, 1.0], magnitude.shape)
        for function in (_rust.rate, _rust.force):
            ours, core = (
                np.array([function(name, theta, state, x, v) for state in states])
                for name in (own.core_name, spec.core_name)
            )
            assert np.max(np.abs(ours - core), initial=0.0) <= 1e-12 * np.max(np.abs(core), initial=0.0)


def test_forces_and_derivatives_of_a_record_are_those_of_the_crate(
    spec: mr.DamperSpec, own: mr.DamperSpec
) -> None:
    history = noise().history()
    theta = np.vstack([spec.nominal, random_theta(spec, 24, rng=3)])
    ours, core = (simulate_sensitivities(each, theta, history) for each in (own, spec))
    same = (ours.substeps == core.substeps) & (core.substeps > 0)
    assert same.sum() >= 3
    force, slopes = ours.force[same], ours.jacobian[same]
    scale = np.abs(core.force[same]).max(axis=1, keepdims=True)
    assert np.all(np.abs(force - core.force[same]) <= 1e-12 * scale)
    # By the share of each parameter: what cancels in a force is rounded with it.
    error = np.linalg.norm(slopes - core.jacobian[same], axis=-1) * np.abs(theta[same])
    felt = np.linalg.norm(core.jacobian[same], axis=-1) * np.abs(theta[same])
    largest = np.maximum(np.linalg.norm(core.force[same], axis=-1), felt.max(axis=-1))
    assert np.all(error <= 1e-12 * largest[:, None])
    np.testing.assert_array_equal(simulate_forces(own, theta, history).force[same], force)


def test_a_loop_is_that_of_the_crate(spec: mr.DamperSpec, own: mr.DamperSpec) -> None:
    hardware = mr.Hardware(sample_time=1e-3, step=1e-3 / 16)
    law = mr.ControlLaw(name="passive", gains={"command": [0.0]})
    runs = [
        mr.simulate_loop(
            FRAME,
            [mr.Device(name="damper", spec=each, theta=spec.nominal, row=FRAME.storeys[0])],
            law,
            [SHAKE],
            hardware,
        )
        for each in (own, spec)
    ]
    assert runs[0].outcome.tolist() == runs[1].outcome.tolist()
    # One follows the states along the motion, the other a bound over every motion as severe.
    rounding = runs[0].steps.tolist() == runs[1].steps.tolist()
    for name, values in runs[1].numbers.items():
        if name != "energy_error":
            np.testing.assert_allclose(
                runs[0].numbers[name], values, rtol=1e-12 if rounding else 1e-2, err_msg=name
            )
