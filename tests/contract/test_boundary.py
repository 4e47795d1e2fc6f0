"""What crosses into the compiled module is checked there: refused in a sentence, never a panic or another reading.

The calls of the sweep are those that the package itself makes of a small loop, a damper and a regulator.
"""

import inspect
import pickle
from collections.abc import Callable, Iterator
from dataclasses import is_dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import own_dampers
import pytest
from damper_samples import sine
from loop_samples import devices, law_with_gains, plant_with, rd1005, sweep
from own_laws import skyhook_law

import mrwork as mr
from mrwork.closed_loop import Fault, Hardware, simulate_loop
from mrwork.closed_loop.printed_loop import printed_loop
from mrwork.dampers.simulation import (
    simulate_force,
    simulate_forces,
    simulate_sensitivities,
    stiffness_shares,
)
from mrwork.errors import SettingError

REFUSALS = (ValueError, TypeError, AttributeError, LookupError, OverflowError, MemoryError)
FUNCTIONS = {
    name: function
    for name, function in vars(mr._rust).items()
    if callable(function) and not name.startswith("_") and inspect.signature(function).parameters
}


def work() -> None:
    """Every function of the module is called that takes something."""
    plain = mr.buildings.shear_building(
        name="frame", masses=[1e3] * 3, stiffnesses=[1e6] * 3, storey_damping=[1e3] * 3, heights=[3.0] * 3
    )
    loop = devices(rd1005(), of=plain)
    simulate_loop(plain, loop, law_with_gains("predictive_rollout", plant_with(loop, plain)), [sweep(0.02)])
    own = replace(skyhook_law(), gains={"corner": [0.3], "gain": [[1.0], [2.0], [3.0]]})
    simulate_loop(plain, loop, own, [sweep(0.02)])
    law = law_with_gains("clipped_optimal", plant_with(loop, plain))
    printed = replace(printed_loop(plain, loop, law, Hardware(feedback="observer")), matrices=None)
    mr._rust.law_text(printed)
    width = sum(count for _, count in mr._rust.law_readings(printed))
    mr._rust.law_commands(printed, np.ones((2, width)))
    frame = mr.buildings.with_yielding_damper(plain, storey=2, yield_force=50.0, yield_displacement=1e-3)
    law = law_with_gains("inverse_direct", plant_with(loop, frame))
    law = replace(law, gains={"gain": np.multiply.outer([0.5, 1.0, 2.0], law.gains["gain"])})
    drawn = [replace(each, theta=np.tile(each.draws, (2, 1))) for each in loop]
    fault = Fault(channel="force", start=0.01, end=0.03)
    hardware = Hardware(feedback="observer", acceleration_noise=0.1, faults=(fault,))
    pushed = replace(sweep(0.04), forces=np.ones((3, sweep(0.04).n_time)))
    simulate_loop(frame, drawn, law, [pushed, sweep(0.03)], hardware, histories=True)
    spec, signal = mr.damper("dahl"), 1e-3 * np.sin(np.arange(8.0))
    loading = mr.Loading(dt=0.01, displacement=signal, velocity=signal, command=signal**2, command_unit="A")
    history, theta = loading.history(), np.tile(spec.nominal, (3, 1))
    mr._rust.misfits(spec.name, theta, history, signal, limits=np.full(3, np.inf))
    for simulate in (simulate_forces, simulate_sensitivities, stiffness_shares):
        simulate(spec, theta, history)
    rows = {"A": -np.eye(4), "B": np.eye(4)[:, :2], "state_weight": np.eye(4), "control_weight": np.eye(2)}
    stacks = {name: np.tile(matrix, (3, 1, 1)) for name, matrix in rows.items()}
    mr.control.regulator_gains(**stacks, scaling=np.tile(np.eye(4), (3, 1, 1)))
    for function in (mr._rust.rate, mr._rust.force):
        function(spec.name, spec.nominal, np.zeros(1), 0.0, 0.0)
    mr._rust.damper_text(spec.name, ["a", "b", "c"], [1e-3])
    mr._rust.straight_forces(spec.name, np.array(spec.nominal), signal, signal, signal, 0.01, 2)
    mr._rust.flops_per_step(spec.name, spec.nominal)
    mr._rust.fma_peak(1, 0.0)
    of_user = own_dampers.branches
    formulas = of_user.own.force, of_user.own.rate, of_user.own.relaxation
    mr._rust.register_damper(of_user.core_name, list(of_user.plain), of_user.n_states, *formulas)


def bared(value: Any) -> Any:
    """A value whose parts can be exchanged: objects of the package as their attributes."""
    if isinstance(value, (list, tuple)):
        return type(value)(bared(each) for each in value)
    if is_dataclass(value):
        found = {name: getattr(value, name) for name in dir(value) if not name.startswith("_")}
        return SimpleNamespace(**{name: bared(each) for name, each in found.items() if not callable(each)})
    return value


@pytest.fixture(scope="module")
def calls() -> dict[str, dict[str, Any]]:
    """Arguments of the last call of each function."""
    found: dict[str, dict[str, Any]] = {}

    def recording(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **given: Any) -> Any:
            bound = inspect.signature(function).bind(*args, **given)
            found[name] = {key: bared(value) for key, value in bound.arguments.items()}
            return function(*args, **given)

        return call

    with pytest.MonkeyPatch.context() as patch:
        for name, function in FUNCTIONS.items():
            patch.setattr(mr._rust, name, recording(name, function))
        work()
    assert found.keys() == FUNCTIONS.keys()
    return found


def parts(value: Any, whole: Callable[[Any], Any] = lambda part: part) -> Iterator[tuple[Any, Any]]:
    """Every part of an argument, and what makes the argument with another one in its place."""
    yield value, whole
    if isinstance(value, SimpleNamespace):
        for name, entry in vars(value).items():
            yield from parts(
                entry, lambda part, name=name: whole(SimpleNamespace(**{**vars(value), name: part}))
            )
    elif isinstance(value, (list, tuple)):
        for index, entry in enumerate(value):
            yield from parts(
                entry,
                lambda part, index=index: whole(type(value)([*value[:index], part, *value[index + 1 :]])),
            )


def refusal(name: str, arguments: dict[str, Any]) -> BaseException | None:
    """How a call is refused, `None` where it is not; a panic is no refusal."""
    try:
        FUNCTIONS[name](**arguments)
    except REFUSALS as error:
        return error
    return None


# Axes of free length: candidates, draws, floors, storeys and devices, and what the loop has yet to fit to the building.
FREE = {
    **{("Building", name): (0,) for name in ("floors", "storeys", "devices")},
    **{(name, "theta"): (0,) for name in ("Dampers", "force_histories", "sensitivities", "stiffness_shares")},
    ("Controller", "gains"): (0, 1),
    ("LawTape", "settings"): (0,),
    ("respond", "motions"): (0, 1),
    ("law_commands", "readings"): (0,),
}


def others(array: np.ndarray, free: tuple[int, ...]) -> Iterator[tuple[str, Any]]:
    """What is no array of these axes, kind and order, each with what it is."""
    for axis in set(range(array.ndim)) - set(free):
        for count in (array.shape[axis] - 1, array.shape[axis] + 1):
            if count >= 0:
                shape = (*array.shape[:axis], count, *array.shape[axis + 1 :])
                yield f"{count} on axis {axis}", np.ones(shape, dtype=array.dtype)
    if array.ndim > 1:
        yield "flat", array.ravel()
        if array.shape[0] != array.shape[-1] and len(free) < array.ndim:
            yield "transposed", np.ascontiguousarray(array.T)
    yield from (("one axis more", array[None].copy()), ("a list", array.tolist()), ("a text", "text"))
    for kind in ("f4", "i8", "?", "c16", "O", "U8"):
        if kind != array.dtype.str[1:]:
            yield kind, np.ones_like(array).astype(kind)
    pieces = [np.repeat(array, 2, axis=-1)[..., ::2], array[::-1].copy()[::-1], np.asfortranarray(array)]
    for piece in pieces:
        if not piece.flags.c_contiguous:
            yield "in pieces", piece
    if array.size:
        room = np.zeros(array.nbytes + 1, dtype=np.uint8)
        yield "unaligned", np.ndarray(array.shape, array.dtype, buffer=room.data, offset=1)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_another_array_is_refused_and_odd_numbers_and_objects_never_panic(
    name: str, calls: dict[str, dict[str, Any]]
) -> None:
    odd = [None, "text", b"", [], {}, object(), 1j, -1, 2**63, 10**30, np.nan, np.inf, -1.0, 1e300]
    for argument, value in calls[name].items():
        for part, whole in parts(value):

            def exchanged(other: Any, argument: str = argument, whole: Any = whole) -> BaseException | None:
                error = refusal(name, {**calls[name], argument: whole(other)})
                assert error is None or str(error).strip(), f"{argument}: {error!r}"
                return error

            for each in odd:
                exchanged(each)
            if isinstance(part, np.ndarray):
                for label, other in others(part, FREE.get((name, argument), ())):
                    assert isinstance(exchanged(other), (SettingError, TypeError)), f"{argument}: {label}"
                for bad in odd[-4:] if part.dtype.kind == "f" else [np.iinfo(part.dtype).max]:
                    exchanged(np.full_like(part, bad))


def test_arrays_of_as_many_numbers_are_not_read_as_others(calls: dict[str, dict[str, Any]]) -> None:
    dampers, nothing = calls["Dampers"], np.zeros((2**32, 0, 0))
    draws, n_devices, columns = dampers["theta"].shape
    with pytest.raises(SettingError, match="theta"):
        mr._rust.Dampers(**{**dampers, "theta": np.ones((1, draws * n_devices, columns))})
    with pytest.raises(SettingError, match="state"):
        mr._rust.riccati_equations("discrete", nothing, nothing, nothing, nothing)
    with pytest.raises(AttributeError, match="steps"):
        mr._rust.respond(**{**calls["respond"], "hardware": SimpleNamespace(sample_time=1e-3)})


def test_a_fault_below_the_core_is_no_mistake_of_its_caller(calls: dict[str, dict[str, Any]]) -> None:
    class Broken:
        def __getattr__(self, name: str) -> float:
            raise ValueError(f"no {name}")

    with pytest.raises(ValueError, match="no ") as told:
        mr._rust.respond(**{**calls["respond"], "hardware": Broken()})
    assert not isinstance(told.value, SettingError)


def test_wrong_columns_and_unknown_models_are_told(spec: Any, calls: dict[str, dict[str, Any]]) -> None:
    n_params = len(spec.parameters)
    for name in ("misfits", "force_histories", "force", "rate"):
        wrong = np.ones((3, n_params - 1))
        theta = wrong if calls[name]["theta"].ndim > 1 else wrong[0]
        plain = {key: value for key, value in calls[name].items() if key != "laws"}
        with pytest.raises(SettingError, match=rf"`theta` has {n_params - 1} columns.*takes {n_params}"):
            FUNCTIONS[name](**{**plain, "model": spec.name, "theta": theta})
        with pytest.raises(LookupError, match=f'no damper model is called "bouc".*{spec.name}'):
            FUNCTIONS[name](**{**plain, "model": "bouc"})


@pytest.mark.parametrize("velocity", [None, np.linspace(-1.0, 1.0, 8)])
def test_histories_pickle_and_do_not_see_later_changes_of_their_arrays(velocity: np.ndarray | None) -> None:
    displacement = np.sin(np.arange(8.0))
    history = mr._rust.LoadingHistory(0.01, displacement, velocity)
    before = history.stages(3)
    displacement[:] = 0.0
    copy = pickle.loads(pickle.dumps(history))
    assert (copy.dt, copy.n_time) == (history.dt, history.n_time)
    np.testing.assert_array_equal(history.stages(3), before)
    np.testing.assert_array_equal(copy.stages(3), before)


def test_a_simulation_that_fails_or_cannot_be_is_an_error_of_ours_with_its_remedy(spec: Any) -> None:
    with pytest.raises(mr.errors.SettingError, match="`theta` of simulate_force is nan at 0"):
        simulate_force(spec, np.full(len(spec.parameters), np.nan), sine(n_time=60))
    with pytest.raises(mr.errors.SettingError, match="sub-step factor"):
        simulate_forces(spec, spec.nominal[None], sine(n_time=60).history(), substep_factor=5)
    failures = []
    # A rate is too stiff where it is large, a time where it is short.
    for size in (1e100, 1e-100):
        try:
            simulate_force(spec, np.full(len(spec.parameters), size), sine(n_time=60))
        except mr.errors.SimulationError as failure:
            failures.append(str(failure))
    assert failures or not spec.n_states
    assert all(f"{spec.name} ended as" in failure for failure in failures)
