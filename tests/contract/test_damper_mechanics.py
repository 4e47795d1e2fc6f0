"""Mechanics of every damper for all parameters: it stays at rest, mirrors, dissipates and never returns a NaN."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from damper_samples import DT, random_theta, scaled_box, sine, sweep, without_offsets

from mrwork import _rust
from mrwork.dampers.simulation import Loading, Outcome, simulate_forces, simulate_misfits
from mrwork.identification.equivalent import identifiable_form

CORNERS = 64


def test_rest_is_rest(spec):
    theta = without_offsets(spec, np.vstack([spec.nominal, random_theta(spec, 20, rng=31)]))
    at_rest = np.zeros(spec.n_states)
    for row in theta:
        assert np.all(_rust.rate(spec.name, row, at_rest, 0.0, 0.0) == 0.0)
        assert _rust.force(spec.name, row, at_rest, 0.0, 0.0) == 0.0
    still = Loading(dt=DT, displacement=np.zeros(50)).history()
    run = simulate_forces(spec, theta, still)
    # Some relax too fast for this step even at rest.
    finished = run.outcome == Outcome.FINISHED
    assert np.sum(finished) > 0.8 * len(theta)
    assert np.all(run.force[finished] == 0.0)


def test_states_stand_still_while_the_damper_does_unless_it_relaxes(spec):
    # Rate independence of hysteresis at zero speed: holding a stroke does not relax the force.
    rng = np.random.default_rng(32)
    for row in random_theta(spec, 20, rng=33):
        state = rng.uniform(-0.9, 0.9, spec.n_states)
        moves = _rust.rate(spec.name, row, state, 0.004, 0.0) != 0.0
        assert np.any(moves) if spec.relaxes else not np.any(moves)


def test_odd_models_mirror(spec, motion):
    theta = without_offsets(spec, np.vstack([spec.nominal, random_theta(spec, 30, rng=34)]))
    velocity = None if motion.velocity is None else -motion.velocity
    mirrored = replace(motion, displacement=-motion.displacement, velocity=velocity)
    ahead = simulate_forces(spec, theta, motion.history())
    back = simulate_forces(spec, theta, mirrored.history())
    finished = ahead.outcome == Outcome.FINISHED
    np.testing.assert_array_equal(back.outcome, ahead.outcome)
    assert np.sum(finished) > 0.7 * len(theta)
    if spec.odd:
        np.testing.assert_array_equal(back.force[finished], -ahead.force[finished])
    else:
        assert np.any(back.force[finished] != -ahead.force[finished])


@pytest.mark.parametrize("frequency", [0.5, 2.5, 10.0])
def test_settled_loop_dissipates(spec, frequency):
    # Four cycles of 400 samples from mid-stroke; the last one is the settled loop. Over a whole period the
    # trapezoidal rule is a plain sum, and the elastic part of the force cancels in it to rounding.
    per_cycle = 400
    motion = sine(frequency=frequency, dt=1.0 / (frequency * per_cycle), n_time=4 * per_cycle + 1)
    theta = np.vstack([spec.nominal, random_theta(spec, 200, rng=35)])
    run = simulate_forces(spec, theta, motion.history())
    finished = run.outcome == Outcome.FINISHED
    assert np.mean(finished) > 0.8
    cycle = slice(3 * per_cycle, 4 * per_cycle)
    power = run.force[finished, cycle] * motion.velocity[cycle]
    assert np.all(power.sum(axis=1) >= -1e-12 * np.abs(power).sum(axis=1))
    assert power[0].sum() > 0.1 * np.abs(power[0]).sum()


def corners(spec, lower, upper):
    """All corners of a box, or a seeded choice of them where there are too many."""
    faces = np.array([lower, upper]).T
    chosen = np.array(list(itertools.product((0, 1), repeat=len(faces))))
    if len(chosen) > CORNERS:
        chosen = np.random.default_rng(36).permutation(chosen)[:CORNERS]
    return np.take_along_axis(faces[None], chosen[:, :, None], axis=2)[:, :, 0]


def test_corners_of_the_admissible_box_fail_by_name_or_not_at_all(spec):
    lower = [parameter.lower for parameter in spec.parameters]
    upper = [parameter.upper for parameter in spec.parameters]
    assert_outcomes_are_consistent(spec, corners(spec, lower, upper))


def test_most_corners_of_the_scaled_box_finish(spec):
    form = identifiable_form(spec, {})
    box = scaled_box(form.spec)
    outcome = assert_outcomes_are_consistent(spec, form.to_model(corners(form.spec, box.lower, box.upper)))
    assert np.mean(outcome == Outcome.FINISHED) > 0.5


def assert_outcomes_are_consistent(spec, theta):
    motion = sweep()
    history = Loading(dt=motion.dt, displacement=motion.displacement[:150]).history()
    nominal = simulate_forces(spec, spec.nominal[None], history).force[0]
    misfits = simulate_misfits(spec, theta, history, nominal)
    forces = simulate_forces(spec, theta, history)
    assert np.all(np.isin(misfits.outcome, list(Outcome)))
    assert not np.any(np.isnan(misfits.squared_error))
    assert not np.any(np.isnan(forces.force))
    np.testing.assert_array_equal(np.isfinite(misfits.squared_error), misfits.outcome == Outcome.FINISHED)
    np.testing.assert_array_equal(np.isfinite(forces.force).all(axis=1), forces.outcome == Outcome.FINISHED)
    unresolved = misfits.outcome == Outcome.UNRESOLVED
    np.testing.assert_array_equal(unresolved, forces.outcome == Outcome.UNRESOLVED)
    np.testing.assert_array_equal(unresolved, misfits.substeps == 0)
    # A force may be finite and its square not; the other way round would be an error.
    assert not np.any((misfits.outcome == Outcome.FINISHED) & (forces.outcome != Outcome.FINISHED))
    return misfits.outcome
