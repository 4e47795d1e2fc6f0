"""A candidate's bits do not depend on its neighbours, the block, the threads or the instruction set."""

from dataclasses import replace

import numpy as np
import pytest
from damper_samples import noise, random_theta, sine

import mrwork as mr
from mrwork.dampers.simulation import Outcome, simulate_forces, simulate_misfits

# Around every width of a block: 1, 8, 16, 32 and 48 lanes; the largest batch is two blocks of the widest. The record is
# longer than the 256 samples between two looks at lost lanes.
BATCH_SIZES = (1, 2, 7, 8, 9, 16, 17, 32, 33, 48, 49)
N_BATCH = max(BATCH_SIZES)
N_TIME = 260
MOST_SUBSTEPS = 16


@pytest.fixture(scope="module")
def theta(spec, history):
    """Candidates whose sub-steps differ, in random order, with the nominal one among them."""
    candidates = np.vstack([spec.nominal, random_theta(spec, 3 * N_BATCH, rng=21)])
    # More than a few sub-steps run the same lines more often, and lanes without vectors are slow.
    return candidates[simulate_forces(spec, candidates, history).substeps <= MOST_SUBSTEPS][:N_BATCH]


@pytest.fixture(scope="module")
def history():
    motion = noise()
    return replace(motion, displacement=motion.displacement[:N_TIME]).history()


@pytest.fixture(scope="module")
def measured(spec, history):
    return simulate_forces(spec, spec.nominal[None], history).force[0] * 0.9


def assert_same_bits(left, right):
    np.testing.assert_array_equal(np.asarray(left).view(np.uint64), np.asarray(right).view(np.uint64))


# Squared errors and forces of the first instruction set in which a model has run.
OF_ROWS: dict[str, np.ndarray] = {}
OF_BATCH: dict[str, np.ndarray] = {}


def test_batch_is_the_loop_over_its_rows(spec, theta, history, instruction_set):
    batch = simulate_forces(spec, theta, history)
    alone = [simulate_forces(spec, row[None], history) for row in theta]
    if spec.n_states > 0:
        assert len(set(batch.substeps)) > 2
    assert np.sum(batch.outcome == Outcome.FINISHED) > 0.8 * N_BATCH
    assert_same_bits(batch.force, np.vstack([run.force for run in alone]))
    assert_same_bits(batch.force, OF_BATCH.setdefault(spec.name, batch.force))
    np.testing.assert_array_equal(batch.outcome, np.concatenate([run.outcome for run in alone]))
    np.testing.assert_array_equal(batch.substeps, np.concatenate([run.substeps for run in alone]))


def test_misfit_has_the_same_bits_in_every_batch_size(spec, theta, history, measured, instruction_set):
    def squared_error(rows):
        return simulate_misfits(spec, rows, history, measured).squared_error

    alone = np.concatenate([squared_error(row[None]) for row in theta])
    assert_same_bits(alone, OF_ROWS.setdefault(spec.name, alone))
    for size in BATCH_SIZES:
        assert_same_bits(squared_error(theta[:size]), alone[:size])
        assert_same_bits(squared_error(theta[-size:]), alone[-size:])


@pytest.mark.parametrize("name", ["normalised_bouc_wen", "bouc_wen"])
def test_square_loops_have_the_same_bits_in_wide_packs(name, instruction_set):
    """Where all candidates have n = 2 they run in wider packs; one with another exponent takes them back."""
    square = mr.damper(name)
    n = square.names.index("n")
    motion = sine().history()
    rows = square.nominal * np.random.default_rng(24).uniform(0.98, 1.0, (N_BATCH, len(square.nominal)))
    rows[:, n] = 2.0
    mixed = np.vstack([rows, rows[:1]])
    mixed[-1, n] = 1.9
    found = simulate_forces(square, rows, motion)
    assert len(set(found.substeps)) == 1
    assert_same_bits(
        found.force, np.vstack([simulate_forces(square, row[None], motion).force for row in rows])
    )
    assert_same_bits(simulate_forces(square, mixed, motion).force[:-1], found.force)


def test_threads_give_the_same_bits(spec, history, measured):
    # Enough steps (200 000) that the second thread is worth waking, also for a model without sub-steps.
    theta = random_theta(spec, 1000, rng=22)
    one = simulate_misfits(spec, theta, history, measured, threads=1)
    several = simulate_misfits(spec, theta, history, measured, threads=3)
    assert_same_bits(several.squared_error, one.squared_error)
    np.testing.assert_array_equal(several.outcome, one.outcome)


@pytest.mark.parametrize("first", [0, 137, N_TIME - 1])
def test_misfit_is_the_sum_of_squares_of_the_force_history(spec, theta, history, measured, first):
    misfits = simulate_misfits(spec, theta, history, measured, first=first)
    force = simulate_forces(spec, theta, history).force
    finished = misfits.outcome == Outcome.FINISHED
    expected = np.sum((force - measured)[:, first:] ** 2, axis=1)
    # 260 additions of non-negative numbers: at most 260 roundings of 1.1e-16 each.
    np.testing.assert_allclose(misfits.squared_error[finished], expected[finished], rtol=1e-13)


def test_substep_factor_multiplies_the_substeps_of_each_candidate(spec, theta):
    history = sine(n_time=50).history()
    once = simulate_forces(spec, theta, history)
    four = simulate_forces(spec, theta, history, substep_factor=4)
    both = (once.outcome == Outcome.FINISHED) & (four.outcome == Outcome.FINISHED)
    assert np.any(both)
    np.testing.assert_array_equal(four.substeps[both], 4 * once.substeps[both])


def test_a_failed_row_leaves_its_neighbours_alone(spec, theta, history, measured):
    clean = simulate_misfits(spec, theta, history, measured)
    broken = theta.copy()
    broken[::5] = np.nan
    broken[1::5] = np.inf
    mixed = simulate_misfits(spec, broken, history, measured)
    forces = simulate_forces(spec, broken, history)
    untouched = np.arange(N_BATCH) % 5 > 1
    assert_same_bits(mixed.squared_error[untouched], clean.squared_error[untouched])
    assert_same_bits(forces.force[untouched], simulate_forces(spec, theta, history).force[untouched])
    failed = ~untouched
    assert np.all(np.isin(mixed.outcome[failed], [Outcome.DIVERGED, Outcome.UNRESOLVED]))
    assert np.all(np.isposinf(mixed.squared_error[failed]))
    assert np.all(np.isposinf(forces.force[failed]))


def test_empty_batch_has_empty_results(spec, history, measured):
    nothing = np.empty((0, len(spec.parameters)))
    assert simulate_misfits(spec, nothing, history, measured).squared_error.shape == (0,)
    assert simulate_forces(spec, nothing, history).force.shape == (0, history.n_time)
