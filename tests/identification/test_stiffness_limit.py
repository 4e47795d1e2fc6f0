"""Local minimisations where the loop of the tests is sharper than their step resolves."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from mrwork.dampers import damper
from mrwork.dampers.simulation import Loading, simulate_force, stiffness_shares
from mrwork.identification import Objective, find_minima, identifiable_form
from mrwork.identification.minimise.levenberg_marquardt import nearest_below_stiffness
from mrwork.records import DamperTest
from mrwork.records.reading import synthetic_test

MODEL = damper("normalised_modified_bouc_wen")
TRUE = {
    "c0": 900.0,
    "k0": 300.0,
    "c1": 15e3,
    "k1": 900.0,
    "x0": 0.0,
    "k_w": 130.0,
    "rho": 4e4,
    "sigma": 100.0,
    "n": 1.0,
}
COARSE = 16


def parameters(**others: float) -> np.ndarray:
    return np.array([{**TRUE, **others}[name] for name in MODEL.names])


@cache
def slow_test() -> DamperTest:
    """A test at 0.1 Hz and a step of 0.04 s, which resolves loops to a seventh of the sharpness of this one."""
    dt = 0.0025
    time = dt * np.arange(12_800)
    displacement = 0.025 * np.sin(0.2 * np.pi * time)
    velocity = 0.005 * np.pi * np.cos(0.2 * np.pi * time)
    force = simulate_force(
        MODEL, parameters(), Loading(dt=dt, displacement=displacement, velocity=velocity), substep_factor=64
    )
    return replace(
        synthetic_test("spencer1997"),
        name="slow",
        dt=COARSE * dt,
        displacement=displacement[::COARSE],
        velocity=velocity[::COARSE],
        force=force[::COARSE],
        n_settle=100,
    )


def test_a_minimisation_slides_along_the_limit_of_stiffness() -> None:
    form = identifiable_form(MODEL, {})
    objective = Objective.of(form.spec, (slow_test(),))
    starts = parameters(rho=4e4, sigma=8.0, c0=1500.0)[None]
    found = find_minima(objective, form.box, starts, max_iterations=60)
    (share,) = stiffness_shares(MODEL, found.theta, objective.histories[0])
    # At a minimisation that stops where it meets the limit, c0 is 1228 N s/m and the misfit 0.0044.
    assert 0.9 < share < 1.0
    assert found.misfit[0] < 5e-4
    np.testing.assert_allclose(found.theta[0, MODEL.names.index("c0")], TRUE["c0"], rtol=0.01)


def test_a_point_little_above_the_limit_is_moved_just_below_it_and_others_stay() -> None:
    form = identifiable_form(MODEL, {})
    objective = Objective.of(form.spec, (slow_test(),))
    below, far_above = parameters(rho=4e3, sigma=8.0), parameters(rho=4e5, sigma=800.0)
    (share,) = stiffness_shares(form.spec, below[None], objective.histories[0])
    above = parameters(rho=4e3 * 1.5 / share, sigma=8.0)
    assert objective(np.array([above]))[0] == np.inf
    moved = nearest_below_stiffness(objective.compared, form.box, np.array([below, above, far_above]))
    np.testing.assert_array_equal(moved[[0, 2]], [below, far_above])
    assert np.isfinite(objective(moved[:2])).all()
    assert 0.9 < stiffness_shares(form.spec, moved[1:2], objective.histories[0])[0] <= 1.0
