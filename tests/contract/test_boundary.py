"""Every array that crosses into Rust is checked there: another shape, dtype or layout is refused, never a panic.

The sweep reads `_rust` itself: this file is about the compiled module, below the public names.
"""

from __future__ import annotations

import pickle
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from boundary_calls import (
    CALLS,
    DEVICES,
    MODEL,
    N_TIME,
    NOMINAL,
    REFUSALS,
    Call,
    Place,
    controller_arguments,
    dampers_arguments,
    fault,
    hardware,
    leaves,
    observer_arguments,
    respond_arguments,
    riccati_arguments,
    unaligned,
    with_part,
)
from damper_samples import sine
from sentences import Refused

from mrwork import _rust
from mrwork.dampers import damper
from mrwork.dampers.simulation import Loading, simulate_force, simulate_forces, simulate_misfits
from mrwork.errors import SettingError, SimulationError


class Case(NamedTuple):
    """An array in an argument of a call."""

    call: Call
    argument: str
    place: Place
    array: np.ndarray

    @property
    def free(self) -> tuple[int, ...]:
        """Axes of any length."""
        return self.call.free.get(self.argument, ())

    def refusal(self, array: Any) -> BaseException | None:
        """The refusal of the call with another array, `None` where it is accepted."""
        arguments = dict(self.call.arguments)
        arguments[self.argument] = with_part(arguments[self.argument], self.place, array)
        try:
            self.call.function(**arguments)
        except REFUSALS as error:
            return error
        return None


CASES = [
    pytest.param(Case(CALLS[name], argument, place, part), id="-".join(map(str, (name, argument, *place))))
    for name in CALLS
    for argument, value in CALLS[name].arguments.items()
    for place, part in leaves(value)
    if isinstance(part, np.ndarray)
]
every_array = pytest.mark.parametrize("case", CASES)


@pytest.mark.parametrize("name", CALLS)
def test_the_calls_of_this_sweep_are_accepted(name):
    CALLS[name].function(**CALLS[name].arguments)


def test_the_sweep_knows_every_function_that_takes_an_array():
    functions = {name for name in dir(_rust) if callable(getattr(_rust, name)) and not name.startswith("_")}
    without_arrays = {
        # Of objects that are made by calls of this sweep.
        "LoopModel",
        "control_laws",
        "current_laws",
        "damper_specs",
        "fma_peak",
        "history_signals",
        "instruction_set",
        "instruction_sets",
        "run_quantities",
        "xla_handler",
    }
    assert functions == set(CALLS) | without_arrays


@every_array
def test_an_axis_of_another_length_is_refused_in_one_sentence(case):
    array = case.array
    for axis in range(array.ndim):
        if axis in case.free:
            continue
        # The first axis of a batch may only shrink where nothing else has its length.
        for count in (-1, 1, array.shape[axis]):
            if array.shape[axis] + count < 0 or count == 0:
                continue
            shape = list(array.shape)
            shape[axis] += count
            error = case.refusal(np.ones(shape, dtype=array.dtype))
            assert isinstance(error, ValueError), shape
            assert "\n" not in str(error)


@every_array
def test_a_transposed_array_is_refused(case):
    array = case.array
    if array.ndim < 2 or array.shape[0] == array.shape[-1] or len(case.free) == array.ndim:
        return
    assert isinstance(case.refusal(np.ascontiguousarray(array.T)), ValueError)


@every_array
def test_what_is_no_array_of_its_dimensions_and_dtype_is_refused(case):
    array = case.array
    others = [array[None].copy(), array[..., None].copy(), np.array(1.0, dtype=array.dtype)]
    others += [array.tolist(), "text", {}, 1.0, *([array.ravel()] if array.ndim > 1 else [])]
    for other in others:
        assert isinstance(case.refusal(other), (TypeError, ValueError)), other
    for dtype in (np.float32, np.float16, np.int64, np.int8, np.bool_, np.complex128, object, "U8"):
        assert isinstance(case.refusal(np.ones_like(array).astype(dtype)), TypeError), dtype


@every_array
def test_arrays_in_pieces_are_refused_or_give_the_same(case):
    array = case.array
    if array.size < 2 or array.dtype != np.float64:
        return
    pieces = [np.repeat(array, 2, axis=-1)[..., ::2], array[::-1].copy()[::-1]]
    if array.ndim > 1 and min(array.shape) > 1:
        pieces.append(np.asfortranarray(array))
    for piece in pieces:
        assert np.array_equal(piece, array)
        if piece.flags.c_contiguous:
            continue
        error = case.refusal(piece)
        assert isinstance(error, ValueError)
        assert "C-contiguous" in str(error)


@every_array
def test_unaligned_arrays_are_refused(case):
    if case.array.size:
        assert isinstance(case.refusal(unaligned(case.array)), ValueError)


@every_array
def test_numbers_that_are_no_numbers_never_panic(case):
    array = case.array
    real = array.dtype == np.float64
    for bad in (np.nan, np.inf, -np.inf, 1e308, -1.0) if real else (np.iinfo(array.dtype).max,):
        case.refusal(np.full_like(array, bad))


def test_rows_without_entries_take_no_memory(refused: Refused):
    nothing = np.zeros((2**32, 0, 0))
    refused(_rust.riccati_equations, "discrete", nothing, nothing, nothing, nothing)


@pytest.mark.parametrize("threads", [2**61, 2**63, 2**64 - 1])
def test_any_number_of_threads_is_taken(threads):
    _rust.riccati_equations(**riccati_arguments(), threads=threads)


def test_runs_of_another_width_are_refused_with_the_right_one(refused: Refused):
    for columns in (3, 4, 6, 0):
        # An array of too few columns made the module panic, one of too many lost its last.
        runs = np.zeros((4, columns), dtype=np.uint32)
        refused(_rust.respond, **{**respond_arguments(), "runs": runs})


def test_theta_of_another_shape_is_not_read_as_other_draws(refused: Refused):
    # (1, 4, columns) holds as many numbers as two draws of two devices.
    theta = np.tile(NOMINAL, (1, 4, 1))
    refused(_rust.Dampers, **{**dampers_arguments(), "theta": theta})


def test_a_column_major_theta_is_not_read_as_transposed(refused: Refused):
    refused(
        _rust.Dampers, **{**dampers_arguments(), "theta": np.asfortranarray(dampers_arguments()["theta"])}
    )


def test_gains_of_another_width_than_the_loop_takes_are_refused(refused: Refused):
    controller = _rust.Controller(**{**controller_arguments(), "gains": np.ones((3, 7))})
    refused(_rust.respond, **{**respond_arguments(), "controller": controller})


def test_an_observer_of_another_building_is_refused(refused: Refused):
    other = {
        "transition": np.eye(4),
        "input": np.ones((4, DEVICES)),
        "gain": np.ones((4, 3)),
        "output": np.ones((3, 4)),
    }
    observer = _rust.Observer(**{**observer_arguments(), **other})
    refused(_rust.respond, **{**respond_arguments(), "observer": observer})


def test_settings_are_read_by_name_and_a_missing_one_is_named(refused: Refused):
    given = hardware()
    del given.delay_steps
    with pytest.raises(AttributeError, match="delay_steps"):
        _rust.respond(**{**respond_arguments(), "hardware": given})
    refused(_rust.respond, **{**respond_arguments(), "hardware": hardware(sample_time="1 ms")})


def test_streams_fewer_than_runs_do_not_drop_runs(refused: Refused):
    refused(_rust.respond, **{**respond_arguments(), "streams": np.arange(3, dtype=np.uint64)})


def test_no_draws_are_refused(refused: Refused):
    theta = np.empty((0, DEVICES, len(NOMINAL)))
    dampers = _rust.Dampers(**{**dampers_arguments(), "theta": theta})
    refused(_rust.respond, **{**respond_arguments(), "dampers": dampers})
    nothing = {"dampers": dampers, "runs": np.empty((0, 5), np.uint32), "streams": np.empty(0, np.uint64)}
    summary, *_ = _rust.respond(**{**respond_arguments(), **nothing})
    assert summary.shape[0] == 0


def respond_with(**changes: Any) -> None:
    """Respond with changed arguments of the call, the dampers, the controller or the hardware."""
    groups = {
        "dampers": (dampers_arguments(), _rust.Dampers),
        "controller": (controller_arguments(), _rust.Controller),
        "hardware": (vars(hardware()), SimpleNamespace),
    }
    arguments = respond_arguments()
    for name, (own, made) in groups.items():
        theirs = {key: value for key, value in changes.items() if key in own}
        if theirs:
            arguments[name] = made(**{**own, **theirs})
    _rust.respond(**{**arguments, **{key: value for key, value in changes.items() if key in KNOWN}})


KNOWN = {*respond_arguments(), "step_factor", "threads"}


def test_settings_that_make_no_sense_are_refused(refused: Refused):
    for wrong in (
        {"sample_time": 0.0},
        {"sample_time": np.nan},
        {"sample_time": -1.0},
        {"sample_time": 1e-300},
        {"steps": 0},
        {"steps": 2**32 - 1},
        {"steps": -1},
        {"delay_steps": 2**63},
        {"step_factor": 0},
        {"step_factor": 1000},
        {"threads": -1},
        {"counts": []},
        {"counts": [1.0] * 3},
        {"differential": [False]},
        {"ranges": [[0.0, 1.0]]},
        {"ranges": [[1.0, 0.0], [0.0, 1.0]]},
        {"ranges": [[0.0], [1.0]]},
        {"force_noise": "much"},
        {"force_noise": None},
        {"sampled_faults": [fault(index=9)]},
        {"sampled_faults": [fault(channel="coil")]},
        {"sampled_faults": [fault(start=-1)]},
        {"tables": [np.ones(3)]},
        {"motions": []},
        {"motions": [(0.01, np.ones(1))]},
        {"model": "none"},
        {"law": "none"},
        {"law": "fuzzy"},
        {"curve": None},
        {"laws": ["linear"]},
        {"laws": ["spline"] * len(NOMINAL)},
    ):
        refused(respond_with, **wrong)


def test_a_peak_that_could_not_be_measured_is_refused(refused: Refused):
    for threads, seconds in ((10**6, 0.01), (1, np.nan), (1, -1.0), (1, 1e9)):
        refused(_rust.fma_peak, threads, seconds)


# Calls of a damper


def damper_call(name: str, **changes: Any) -> None:
    CALLS[name].function(**{**CALLS[name].arguments, **changes})


def test_calls_of_a_damper_that_make_no_sense_are_refused(refused: Refused):
    history = CALLS["misfits"].arguments["loading"]
    for name, wrong in (
        ("misfits", {"limits": np.full(2, np.inf)}),
        ("misfits", {"force": np.zeros(0)}),
        ("misfits", {"force": np.zeros(N_TIME - 1)}),
        ("misfits", {"force": np.zeros(2 * N_TIME)[::2]}),
        # A misfit over nothing would be zero, the best there is.
        ("misfits", {"first": N_TIME}),
        ("misfits", {"first": N_TIME + 5}),
        ("force", {"state": np.zeros(1)}),
        *(
            (name, {"substep_factor": factor})
            for name in ("misfits", "force_histories")
            for factor in (0, 3, 128)
        ),
        *(("LoadingHistory", {"dt": dt}) for dt in (0.0, -1e-3, np.nan, np.inf)),
        *(
            ("LoadingHistory", {signal: np.append(np.zeros(N_TIME - 1), bad)})
            for signal in ("displacement", "velocity")
            for bad in (np.nan, np.inf, -np.inf)
        ),
        ("LoadingHistory", {"displacement": np.zeros(3)}),
        ("LoadingHistory", {"velocity": np.zeros(N_TIME + 1)}),
    ):
        refused(damper_call, name, **wrong)
    refused(history.stages, 0)


def test_wrong_number_of_columns_names_the_right_one(spec):
    n_params = len(spec.parameters)
    for wrong in (np.ones((3, n_params - 1)), np.ones((3, 2 * n_params)), np.ones((3, 0))):
        for name, theta in (
            ("misfits", wrong),
            ("force_histories", wrong),
            ("force", wrong[0]),
            ("rate", wrong[0]),
        ):
            with pytest.raises(ValueError, match=rf"`theta` has {wrong.shape[1]} columns.*takes {n_params}"):
                damper_call(name, model=spec.name, theta=theta)


@pytest.mark.parametrize("name", ["misfits", "force_histories", "force"])
def test_unknown_models_are_refused_with_those_that_exist(spec, name):
    with pytest.raises(LookupError, match=rf"no damper model is called \"bouc\".*{spec.name}"):
        damper_call(name, model="bouc")


@pytest.mark.parametrize("value", ["abacus", "\udcff"])
def test_unknown_instruction_sets_are_refused_and_an_empty_one_is_none(monkeypatch, value):
    monkeypatch.setenv("MRWORK_INSTRUCTION_SET", value)
    for call in (
        _rust.instruction_set,
        lambda: damper_call("misfits"),
        lambda: damper_call("force_histories"),
    ):
        with pytest.raises(ValueError, match=r"_SET is .*, this machine has .*plain"):
            call()
    monkeypatch.setenv("MRWORK_INSTRUCTION_SET", "")
    damper_call("misfits")


@pytest.mark.parametrize("velocity", [None, np.linspace(-1.0, 1.0, N_TIME)])
def test_histories_pickle_and_do_not_see_later_changes_of_their_arrays(velocity):
    displacement = np.sin(np.arange(N_TIME))
    history = _rust.LoadingHistory(0.01, displacement, velocity)
    before = history.stages(3)
    displacement[:] = 0.0
    copy = pickle.loads(pickle.dumps(history))
    assert (copy.dt, copy.n_time) == (history.dt, history.n_time)
    np.testing.assert_array_equal(history.stages(3), before)
    np.testing.assert_array_equal(copy.stages(3), before)


def test_the_facade_raises_errors_of_its_own():
    # The sentence of Rust, in an error of ours; of one's own shape it is said before.
    spec, loading = damper(MODEL), Loading(dt=0.01, displacement=np.sin(np.arange(N_TIME)))
    with pytest.raises(SettingError, match=r"`theta` has shape .*see `spec.names`"):
        simulate_forces(spec, NOMINAL[None, 1:], loading.history())
    with pytest.raises(SettingError, match="sub-step factor"):
        simulate_misfits(spec, NOMINAL[None], loading.history(), np.zeros(N_TIME), substep_factor=5)
    with pytest.raises(SettingError, match="sampling step"):
        Loading(dt=0.0, displacement=loading.displacement).history()
    with pytest.raises(SettingError, match="`theta` of simulate_force is nan at 0"):
        simulate_force(spec, np.full(len(NOMINAL), np.nan), loading)


def test_a_single_simulation_that_fails_is_an_error_with_its_remedy(spec):
    if not spec.n_states:
        pytest.skip("without states nothing diverges")
    failures = []
    # A rate is too stiff where it is large, a time where it is short.
    for size in (1e100, 1e-100):
        try:
            simulate_force(spec, np.full(len(spec.parameters), size), sine(n_time=60))
        except SimulationError as failure:
            failures.append(str(failure))
    assert failures
    assert all(f"{spec.name} ended as" in failure for failure in failures)
