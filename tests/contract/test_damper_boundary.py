"""What crosses into Rust is checked there: a wrong call is refused in a sentence, never a crash."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from damper_samples import DT, sine

from mrwork import _rust
from mrwork.dampers.simulation import Loading, simulate_force, simulate_forces, simulate_misfits
from mrwork.errors import SettingError, SimulationError

N_TIME = 60


@pytest.fixture
def history():
    return sine(n_time=N_TIME).history()


@pytest.fixture
def theta(spec):
    return np.tile(spec.nominal, (3, 1))


@pytest.fixture
def measured():
    return np.zeros(N_TIME)


def batch_calls(name, history, measured):
    """Both batch functions, as functions of the parameters alone."""
    return (
        lambda theta, **settings: _rust.misfits(name, theta, history, measured, **settings),
        lambda theta, **settings: _rust.force_histories(name, theta, history, **settings),
    )


def test_wrong_number_of_columns_names_the_right_one(spec, theta, history, measured):
    n_params = len(spec.parameters)
    for wrong in (theta[:, 1:].copy(), np.hstack([theta, theta]), theta[:, :0].copy()):
        for call in batch_calls(spec.name, history, measured):
            with pytest.raises(ValueError, match=rf"`theta` has {wrong.shape[1]} columns.*takes {n_params}"):
                call(wrong)
        with pytest.raises(ValueError, match="columns"):
            _rust.force(spec.name, wrong[0], np.zeros(spec.n_states), 0.0, 0.0)
        with pytest.raises(ValueError, match="columns"):
            _rust.rate(spec.name, wrong[0], np.zeros(spec.n_states), 0.0, 0.0)


def test_wrong_number_of_limits_is_refused(spec, theta, history, measured):
    with pytest.raises(ValueError, match="2 limits were given for 3 candidates"):
        _rust.misfits(spec.name, theta, history, measured, limits=np.full(2, np.inf))


def test_wrong_number_of_states_is_refused(spec):
    state = np.zeros(spec.n_states + 1)
    sentence = f"`state` has {spec.n_states + 1} entries, the model has {spec.n_states}"
    with pytest.raises(ValueError, match=sentence):
        _rust.force(spec.name, spec.nominal, state, 0.0, 0.0)


def test_arrays_in_pieces_are_refused(spec, theta, history, measured):
    for call in batch_calls(spec.name, history, measured):
        for pieces in (np.asfortranarray(theta), np.tile(theta, (2, 1))[::2]):
            with pytest.raises(ValueError, match="`theta` must be C-contiguous"):
                call(pieces)
    with pytest.raises(ValueError, match="`force` must be C-contiguous"):
        _rust.misfits(spec.name, theta, history, np.zeros(2 * N_TIME)[::2])
    with pytest.raises(ValueError, match="`displacement` must be C-contiguous"):
        _rust.LoadingHistory(DT, np.zeros(2 * N_TIME)[::2])


@pytest.mark.parametrize("dtype", [np.float32, np.int64, np.complex128, object])
def test_wrong_dtypes_are_refused(spec, theta, history, measured, dtype):
    for call in batch_calls(spec.name, history, measured):
        with pytest.raises(TypeError):
            call(theta.astype(dtype))
    with pytest.raises(TypeError):
        _rust.misfits(spec.name, theta, history, measured.astype(dtype))
    with pytest.raises(TypeError):
        _rust.LoadingHistory(DT, measured.astype(dtype))


def test_wrong_number_of_dimensions_is_refused(spec, history, measured):
    for call in batch_calls(spec.name, history, measured):
        with pytest.raises(TypeError):
            call(spec.nominal)
    with pytest.raises(TypeError):
        _rust.LoadingHistory(DT, measured[None])


def test_unknown_models_are_refused_with_those_that_exist(spec, theta, history, measured):
    for call in batch_calls("bouc", history, measured):
        with pytest.raises(LookupError, match=rf"no damper model is called \"bouc\".*{spec.name}"):
            call(theta)


def test_force_of_another_length_is_refused(spec, theta, history):
    for length in (0, N_TIME - 1, N_TIME + 1):
        with pytest.raises(ValueError, match=f"`force` has {length} samples, .* has {N_TIME}"):
            _rust.misfits(spec.name, theta, history, np.zeros(length))


def test_a_window_without_samples_is_refused(spec, theta, history, measured):
    # A misfit over nothing would be zero, the best there is.
    for first in (N_TIME, N_TIME + 5):
        with pytest.raises(ValueError, match="first"):
            _rust.misfits(spec.name, theta, history, measured, first=first)


@pytest.mark.parametrize("factor", [0, 3, 128])
def test_substep_factors_that_are_no_power_of_two_are_refused(spec, theta, history, measured, factor):
    for call in batch_calls(spec.name, history, measured):
        with pytest.raises(ValueError, match=f"sub-step factor is {factor}, it must be a power of two"):
            call(theta, substep_factor=factor)


@pytest.mark.parametrize("dt", [0.0, -1e-3, np.nan, np.inf])
def test_sampling_steps_that_are_no_step_are_refused(dt, measured):
    with pytest.raises(ValueError, match="sampling step"):
        _rust.LoadingHistory(dt, measured)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_motions_that_are_not_finite_are_refused_with_the_sample(bad, measured):
    broken = measured.copy()
    broken[17] = bad
    with pytest.raises(ValueError, match="`displacement` is not finite at sample 17"):
        _rust.LoadingHistory(DT, broken)
    with pytest.raises(ValueError, match="`velocity` is not finite at sample 17"):
        _rust.LoadingHistory(DT, measured, broken)


def test_motions_too_short_or_of_different_length_are_refused():
    with pytest.raises(ValueError, match="has 3 samples, a cubic spline takes at least 4"):
        _rust.LoadingHistory(DT, np.zeros(3))
    with pytest.raises(ValueError, match="`velocity` has 5 samples, the loading history has 6"):
        _rust.LoadingHistory(DT, np.zeros(6), np.zeros(5))


def test_no_stages_are_refused(history):
    with pytest.raises(ValueError, match="`substeps` is 0"):
        history.stages(0)


def test_unknown_instruction_sets_are_refused(spec, theta, history, measured, monkeypatch):
    monkeypatch.setenv("MRWORK_INSTRUCTION_SET", "abacus")
    for call in batch_calls(spec.name, history, measured):
        with pytest.raises(ValueError, match=r"_SET is \"abacus\", this machine has .*plain"):
            call(theta)


def test_an_empty_choice_of_the_instruction_set_is_none(spec, theta, history, measured, monkeypatch):
    monkeypatch.setenv("MRWORK_INSTRUCTION_SET", "")
    for call in batch_calls(spec.name, history, measured):
        call(theta)


def test_an_instruction_set_that_is_no_text_is_refused(monkeypatch):
    monkeypatch.setenv("MRWORK_INSTRUCTION_SET", "\udcff")
    with pytest.raises(ValueError, match=r"_SET is .*, this machine has .*plain"):
        _rust.instruction_set()


@pytest.mark.parametrize("with_velocity", [True, False])
def test_histories_pickle(spec, theta, with_velocity):
    motion = sine(n_time=N_TIME)
    velocity = motion.velocity * 1.01 if with_velocity else None
    history = Loading(dt=DT, displacement=motion.displacement, velocity=velocity).history()
    copy = pickle.loads(pickle.dumps(history))
    assert (copy.dt, copy.n_time) == (history.dt, history.n_time)
    np.testing.assert_array_equal(copy.stages(3), history.stages(3))
    expected = simulate_forces(spec, theta, history).force
    np.testing.assert_array_equal(simulate_forces(spec, theta, copy).force, expected)


def test_history_does_not_see_later_changes_of_its_arrays(spec, theta):
    displacement = sine(n_time=N_TIME).displacement.copy()
    history = _rust.LoadingHistory(DT, displacement)
    before = simulate_forces(spec, theta, history).force
    displacement[:] = 0.0
    np.testing.assert_array_equal(simulate_forces(spec, theta, history).force, before)


def test_the_facade_raises_errors_of_its_own(spec, theta, history, measured):
    with pytest.raises(SettingError, match=r"`theta` has shape .*see `spec.names`"):
        simulate_forces(spec, theta[:, 1:], history)
    with pytest.raises(SettingError, match="sub-step factor"):
        simulate_misfits(spec, theta, history, measured, substep_factor=5)
    with pytest.raises(SettingError, match="sampling step"):
        Loading(dt=0.0, displacement=measured).history()
    with pytest.raises(SettingError, match="`theta` of simulate_force is nan at 0"):
        simulate_force(spec, np.full(len(spec.parameters), np.nan), sine(n_time=N_TIME))


def test_a_single_simulation_that_fails_is_an_error_with_its_remedy(spec):
    if not spec.n_states:
        pytest.skip("without states nothing diverges")
    failures = []
    # A rate is too stiff where it is large, a time where it is short.
    for size in (1e100, 1e-100):
        try:
            simulate_force(spec, np.full(len(spec.parameters), size), sine(n_time=N_TIME))
        except SimulationError as failure:
            failures.append(str(failure))
    assert failures
    assert all(f"{spec.name} ended as" in each for each in failures)
