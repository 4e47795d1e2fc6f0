"""Every array that crosses into Rust is checked there: another shape, dtype or layout is refused, never a panic.

The sweep reads `_rust` itself: this file is about the compiled module, below the public names.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from boundary_calls import (
    CALLS,
    DEVICES,
    NOMINAL,
    REFUSALS,
    Call,
    controller_arguments,
    curve_arguments,
    dampers_arguments,
    fault,
    hardware,
    observer_arguments,
    respond_arguments,
    riccati_arguments,
)
from sentences import Refused

from mrwork import _rust


def arrays_in(value: Any, name: str) -> Iterator[tuple[str, np.ndarray]]:
    """Every array in an argument, with its place."""
    if isinstance(value, np.ndarray):
        yield name, value
    elif isinstance(value, (list, tuple)):
        for index, entry in enumerate(value):
            yield from arrays_in(entry, f"{name}[{index}]")
    elif isinstance(value, SimpleNamespace):
        for field, entry in vars(value).items():
            yield from arrays_in(entry, f"{name}.{field}")


def with_array(value: Any, name: str, wanted: str, array: Any) -> Any:
    """The argument with the array at the place `wanted` replaced."""
    if name == wanted:
        return array
    if isinstance(value, (list, tuple)):
        entries = [with_array(entry, f"{name}[{i}]", wanted, array) for i, entry in enumerate(value)]
        return type(value)(entries)
    if isinstance(value, SimpleNamespace):
        named = vars(value).items()
        return SimpleNamespace(**{key: with_array(v, f"{name}.{key}", wanted, array) for key, v in named})
    return value


def called(call: Call, argument: str, place: str, array: Any) -> BaseException | None:
    """The refusal of the call with this array at `place`, `None` where it is accepted."""
    arguments = dict(call.arguments)
    arguments[argument] = with_array(arguments[argument], argument, place, array)
    try:
        call.function(**arguments)
    except REFUSALS as error:
        return error
    return None


CASES = [
    pytest.param(CALLS[name], argument, place, array, id=f"{name}-{place}")
    for name in CALLS
    for argument, value in CALLS[name].arguments.items()
    for place, array in arrays_in(value, argument)
]
every_array = pytest.mark.parametrize(("call", "argument", "place", "array"), CASES)


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
    }
    assert functions == set(CALLS) | without_arrays


@every_array
def test_an_axis_of_another_length_is_refused_in_one_sentence(call, argument, place, array):
    for axis in range(array.ndim):
        if axis in call.free.get(place, ()):
            continue
        # The first axis of a batch may only shrink where nothing else has its length.
        for count in (-1, 1, array.shape[axis]):
            if array.shape[axis] + count < 0 or count == 0:
                continue
            shape = list(array.shape)
            shape[axis] += count
            other = np.ones(shape, dtype=array.dtype)
            error = called(call, argument, place, other)
            assert isinstance(error, ValueError), (place, array.shape, other.shape)
            assert "\n" not in str(error)


@every_array
def test_a_transposed_array_is_refused(call, argument, place, array):
    if array.ndim < 2 or array.shape[0] == array.shape[-1] or len(call.free.get(place, ())) == array.ndim:
        return
    transposed = np.ascontiguousarray(array.T)
    assert isinstance(called(call, argument, place, transposed), ValueError), (place, array.shape)


@every_array
def test_other_dimensions_are_refused(call, argument, place, array):
    for other in (array[None].copy(), array[..., None].copy(), np.array(1.0, dtype=array.dtype)):
        assert isinstance(called(call, argument, place, other), (TypeError, ValueError)), other.shape
    if array.ndim > 1:
        assert isinstance(called(call, argument, place, array.ravel()), (TypeError, ValueError))


@every_array
def test_other_dtypes_are_refused(call, argument, place, array):
    for dtype in (np.float32, np.float16, np.int64, np.int8, np.bool_, np.complex128, object, "U8"):
        assert isinstance(called(call, argument, place, np.ones_like(array).astype(dtype)), TypeError), dtype


@every_array
def test_things_that_are_no_arrays_are_refused(call, argument, place, array):
    for other in (array.tolist(), "text", {}, 1.0):
        assert isinstance(called(call, argument, place, other), (TypeError, ValueError)), other


@every_array
def test_arrays_in_pieces_are_refused_or_give_the_same(call, argument, place, array):
    if array.size < 2 or array.dtype != np.float64:
        return
    double = np.repeat(array, 2, axis=-1)
    pieces = [double[..., ::2], array[::-1].copy()[::-1]]
    if array.ndim > 1 and min(array.shape) > 1:
        pieces.append(np.asfortranarray(array))
    for piece in pieces:
        assert np.array_equal(piece, array)
        if piece.flags.c_contiguous:
            continue
        error = called(call, argument, place, piece)
        assert isinstance(error, ValueError), place
        assert "C-contiguous" in str(error)


@every_array
def test_unaligned_arrays_are_refused(call, argument, place, array):
    if array.size:
        room = np.zeros(array.nbytes + 1, dtype=np.uint8)
        unaligned = np.ndarray(array.shape, array.dtype, buffer=room.data, offset=1)
        unaligned[...] = array
        assert isinstance(called(call, argument, place, unaligned), ValueError), place


def test_rows_without_entries_take_no_memory(refused: Refused):
    nothing = np.zeros((2**32, 0, 0))
    refused(_rust.riccati_equations, "discrete", nothing, nothing, nothing, nothing)


@pytest.mark.parametrize("threads", [2**61, 2**63, 2**64 - 1])
def test_any_number_of_threads_is_taken(threads):
    _rust.riccati_equations(**riccati_arguments(), threads=threads)


@every_array
def test_numbers_that_are_no_numbers_never_panic(call, argument, place, array):
    for bad in (np.nan, np.inf, -np.inf, 1e308, -1.0):
        if array.dtype == np.float64:
            called(call, argument, place, np.full_like(array, bad))
    if array.dtype != np.float64:
        called(call, argument, place, np.full_like(array, np.iinfo(array.dtype).max))


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


def test_a_curve_with_fewer_laws_than_parameters_is_refused(refused: Refused):
    refused(_rust.ForceCurve, **{**curve_arguments(), "laws": ["linear"]})


def test_a_peak_that_could_not_be_measured_is_refused(refused: Refused):
    for threads, seconds in ((10**6, 0.01), (1, np.nan), (1, -1.0), (1, 1e9)):
        refused(_rust.fma_peak, threads, seconds)
