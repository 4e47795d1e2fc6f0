"""Dampers of users in batches: those that are models of the package written again have their forces."""

from functools import partial
from typing import Any

import jax
import numpy as np
import own_dampers
import pytest

import mrwork as mr
from mrwork.base.values import Floats
from mrwork.dampers.parameters import Lag
from mrwork.dampers.simulation import (
    Outcome,
    simulate_forces,
    simulate_misfits,
    simulate_sensitivities,
    stiffness_shares,
)

TIME = np.arange(0.0, 1.0, 0.002)
MOTION = 0.01 * np.sin(2.0 * np.pi * 2.0 * TIME)
HISTORY = mr.Loading(dt=0.002, displacement=MOTION).history()


def candidates(spec: mr.DamperSpec, count: int, seed: int = 0) -> Floats:
    """Parameters in the middle of their ranges; half a loop is reversible, so that its bound is that of the sample."""
    unit = np.random.default_rng(seed).uniform(0.35, 0.65, (count, len(spec.names)))
    theta = np.asarray(mr.Box.of(spec).theta_from_unit(unit))
    if "sigma" in spec.names:
        theta[:, spec.names.index("sigma")] = 0.5
    return theta


PAIRS = [(own_dampers.guo, own_dampers.GUO), (own_dampers.bounded_loop, own_dampers.LOOP)]


@pytest.mark.parametrize(("own", "model"), PAIRS)
def test_forces_and_derivatives_are_those_of_the_core(own: mr.DamperSpec, model: mr.DamperSpec) -> None:
    theta = candidates(model, 11)
    ours, core = simulate_forces(own, theta, HISTORY), simulate_forces(model, theta, HISTORY)
    assert (ours.substeps == core.substeps).all()
    np.testing.assert_allclose(ours.force, core.force, rtol=0.0, atol=1e-12 * np.abs(core.force).max())
    columns = [0, 3]
    slopes = simulate_sensitivities(own, theta[:3], HISTORY, columns=columns)
    expected = simulate_sensitivities(model, theta[:3], HISTORY, columns=columns)
    scale = np.abs(expected.jacobian).max(axis=-1, keepdims=True)
    assert (np.abs(slopes.jacobian - expected.jacobian) <= 1e-12 * scale).all()
    np.testing.assert_allclose(slopes.force, ours.force[:3], rtol=1e-12)


@pytest.mark.parametrize("lag", ["one_rate", "two_rates"])
def test_a_command_that_varies_reaches_the_coil_as_in_the_core(lag: Lag) -> None:
    command = np.where(TIME % 0.3 < 0.15, 0.2, 1.0)
    history = mr.Loading(dt=0.002, displacement=MOTION, command=command, command_unit="A").history()
    laws = {"k_w": "linear", "c": "log_linear:0,1"}
    own, model = (
        spec.with_current_laws(laws, lag=lag) for spec in (own_dampers.bounded_loop, own_dampers.LOOP)
    )
    rates = [40.0, 12.0][: own.n_rates]
    theta = np.array([[400.0, 900.0, 800.0, 0.01, 300.0, 700.0, 900.0, 0.5, 1.5, *rates]])
    ours, core = simulate_forces(own, theta, history), simulate_forces(model, theta, history)
    assert (ours.substeps == core.substeps).all()
    np.testing.assert_allclose(ours.force, core.force, rtol=0.0, atol=1e-12 * np.abs(core.force).max())
    slope, expected = (simulate_sensitivities(spec, theta, history).jacobian for spec in (own, model))
    assert (np.abs(slope - expected) <= 1e-12 * np.abs(expected).max(axis=-1, keepdims=True)).all()


def test_the_spectral_radius_resolves_a_loop() -> None:
    theta = candidates(own_dampers.LOOP, 20)
    ours, core = (simulate_forces(spec, theta, HISTORY) for spec in (own_dampers.loop, own_dampers.LOOP))
    resolved = simulate_forces(own_dampers.LOOP, theta, HISTORY, substep_factor=8).force
    assert (ours.substeps <= core.substeps).all()
    assert len(np.unique(ours.substeps)) > 1
    scale = np.abs(resolved).max(axis=1, keepdims=True)
    assert (np.abs(ours.force - resolved) <= 2e-3 * scale).all()
    # Alone or beside others, and with the same steps once more.
    for threads in (1, 2):
        again = simulate_forces(own_dampers.loop, theta, HISTORY, threads=threads)
        np.testing.assert_array_equal(again.force, ours.force)
    for row in range(len(theta)):
        alone = simulate_forces(own_dampers.loop, theta[row : row + 1], HISTORY).force[0]
        np.testing.assert_array_equal(alone, ours.force[row])
    finer = simulate_forces(own_dampers.loop, theta[:2], HISTORY, substep_factor=2)
    assert (finer.substeps == 2 * ours.substeps[:2]).all()


def test_misfits_are_infinite_for_what_is_too_stiff_or_not_a_number() -> None:
    theta = candidates(own_dampers.LOOP, 3)
    theta[1, own_dampers.LOOP.names.index("rho")] = 1e7
    theta[2, own_dampers.LOOP.names.index("k")] = np.nan
    force = np.zeros(len(TIME))
    for spec in (own_dampers.loop, own_dampers.bounded_loop):
        found = simulate_misfits(spec, theta, HISTORY, force, first=10)
        assert [Outcome(each) for each in found.outcome] == [
            Outcome.FINISHED, Outcome.UNRESOLVED, Outcome.DIVERGED,
        ]  # fmt: skip
        assert list(np.isfinite(found.squared_error)) == [True, False, False]
        shares = stiffness_shares(spec, theta[:2], HISTORY)
        assert shares[0] <= 1.0 < shares[1]


def corner_force(p: Any, state: Floats, displacement: Floats, velocity: Floats) -> Floats:
    """Not a number where the damper is pulled far with little damping."""
    return p.c * velocity + np.sqrt(p.c - 1e3 * np.abs(displacement)) - np.sqrt(p.c)


def test_a_corner_that_is_not_a_number_leaves_its_neighbours_alone() -> None:
    corner = mr.own_damper("corner", parameters={"c": ("N s/m", 1.0, 100.0, 1000.0)}, force=corner_force)
    found = simulate_forces(corner, [[5.0], [50.0]], HISTORY)
    assert list(found.outcome) == [Outcome.DIVERGED, Outcome.FINISHED]


def test_states_that_the_core_has_more_room_for_stay_apart() -> None:
    """Three of them, beside the twin of the same formulas in JAX."""
    spec = own_dampers.branches
    found = simulate_sensitivities(spec, candidates(spec, 4), HISTORY)
    twin, record = mr.jax.twin(spec), mr.jax.twin(spec).record(mr.Loading(dt=0.002, displacement=MOTION))
    for row, (theta, steps) in enumerate(zip(candidates(spec, 4), found.substeps, strict=True)):
        force = np.asarray(twin.simulate(theta, record, int(steps)))
        np.testing.assert_allclose(found.force[row], force, rtol=0.0, atol=1e-12 * np.abs(force).max())
        slopes = np.asarray(jax.jacfwd(partial(twin.simulate, record=record, substeps=int(steps)))(theta)).T
        scale = np.abs(slopes).max(axis=1, keepdims=True)
        assert (np.abs(found.jacobian[row] - slopes) <= 1e-12 * scale).all()
