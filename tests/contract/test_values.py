"""Every data class that holds arrays is equal by value, and its copies are as read-only as the original.

The classes are found by walking over the package: a new one is covered by being written.
"""

import copy
import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import Any, get_args, get_origin, get_type_hints

import loop_samples
import numpy as np
import posterior_samples
import pytest
import study_samples
from numpy.typing import NDArray
from test_errors import classes_of_the_package

import mrwork as mr
from mrwork.base.hints import resolved
from mrwork.base.values import array_dataclass


def is_of_arrays(hint: Any) -> bool:
    """Whether a value of an annotation is an array or contains some; a function of arrays is none."""
    if get_origin(hint) is Callable or str(get_origin(hint)) == "<class 'collections.abc.Callable'>":
        return False
    hint = resolved(hint)
    return get_origin(hint) is np.ndarray or hint is np.ndarray or any(map(is_of_arrays, get_args(hint)))


def array_fields(kind: Any) -> list[str]:
    try:
        hints = get_type_hints(kind)
    except (NameError, TypeError):
        # Names that are imported for the type checker only.
        hints = {}
    return [
        each.name
        for each in fields(kind)
        if (
            is_of_arrays(hints[each.name])
            if hints
            else "Array" in str(each.type) or "Floats" in str(each.type)
        )
    ]


def is_frozen(kind: Any) -> bool:
    return bool(kind.__dataclass_params__.frozen)


# A function of JAX is itself alone: JAX keeps what it compiles by the function.
KINDS = [
    kind
    for kind in filter(is_dataclass, classes_of_the_package())
    if is_frozen(kind) and array_fields(kind) and "__call__" not in vars(kind)
]
EQUAL = vars(array_dataclass()(type("Any", (), {})))["__eq__"]


def filled(kind: Any) -> Any:
    """An object of a class with an array, with a NaN, in each field that holds arrays; of no other meaning."""
    made = object.__new__(kind)
    held = array_fields(kind)
    for number, each in enumerate(fields(kind)):
        array = np.array([number, np.nan, 1.0])
        object.__setattr__(made, each.name, array if each.name in held else each.name)
    return made


def copies(value: Any) -> tuple[Any, ...]:
    return pickle.loads(pickle.dumps(value)), copy.deepcopy(value), copy.copy(value)


def test_the_walk_finds_what_the_package_has() -> None:
    assert {"DamperTest", "Building", "Responses", "Fit"} <= {kind.__name__ for kind in KINDS}
    assert len(KINDS) > 50


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_a_class_with_arrays_is_equal_by_value(kind: type) -> None:
    assert vars(kind)["__eq__"] is EQUAL, f"{kind.__name__} holds arrays and wants @array_dataclass"
    value = filled(kind)
    for each in copies(value):
        assert each == value
        assert type(each) is kind
    with pytest.raises(TypeError, match="unhashable"):
        hash(value)


SAMPLES: dict[str, Callable[[], Any]] = {
    "test": posterior_samples.small_test,
    "fit": posterior_samples.small_fit,
    "loading": lambda: mr.Loading(dt=0.01, displacement=np.arange(4.0), velocity=np.ones(4)),
    "motion": loop_samples.sweep,
    "building": loop_samples.five_storeys,
    "devices": lambda: loop_samples.devices(loop_samples.friction())[0],
    "runs": lambda: study_samples.results().quantities,
    "history": lambda: study_samples.history(1.0, 2),
}


@pytest.mark.parametrize("name", SAMPLES)
def test_values_of_use_survive_copies(name: str) -> None:
    value = SAMPLES[name]()
    for each in copies(value):
        assert each == value
        assert each is not value


def test_values_that_differ_are_not_equal() -> None:
    test = posterior_samples.small_test()
    force = test.force.copy()
    force[3] += 1.0
    for other in (replace(test, force=force), replace(test, name="other"), "a test"):
        assert other != test


@array_dataclass()
class Measured:
    """A number and an array."""

    level: float
    samples: NDArray[np.float64]


def test_nan_equals_nan() -> None:
    with_nan = Measured(level=float("nan"), samples=np.array([1.0, np.nan]))
    assert with_nan != replace(with_nan, samples=np.array([1.0, 2.0]))
    for each in copies(with_nan):
        assert each == with_nan


def tower(n_storeys: int) -> mr.Building:
    return mr.buildings.shear_building(name="tower", masses=[1.0] * n_storeys, stiffnesses=[1.0] * n_storeys)


@pytest.mark.parametrize(
    ("made", "name"),
    [
        (lambda given: mr.GroundMotion(name="a", dt=0.01, acceleration=given), "acceleration"),
        (lambda given: mr.Loading(dt=0.01, displacement=given), "displacement"),
        (lambda given: mr.Loading(dt=0.01, displacement=np.zeros(150), command=given), "command"),
        (lambda given: replace(posterior_samples.small_test(), force=given), "force"),
        (lambda given: replace(tower(150), influence=given), "influence"),
        (lambda given: replace(loop_samples.devices(loop_samples.rd1005())[0], row=given), "row"),
    ],
)
def test_what_the_caller_writes_into_an_array_afterwards_changes_no_object(
    made: Callable[[NDArray[np.float64]], object], name: str
) -> None:
    given = np.linspace(0.0, 1.0, 150)
    found = made(given)
    given[:] = 7.0
    np.testing.assert_array_equal(getattr(found, name), np.linspace(0.0, 1.0, 150))
    with pytest.raises(ValueError, match="read-only"):
        getattr(found, name)[0] = 1.0


def test_a_test_from_another_process_is_repaired_with_its_remarks() -> None:
    time = np.arange(400) / 200.0
    late = 0.1 * np.cos(10.0 * (time - 0.01))
    test = mr.test_from_arrays(time, 0.01 * np.sin(10.0 * time), 500.0 * np.sin(10.0 * time), velocity=late)
    told = {remark.code for remark in test.remarks}
    code = (
        "import pickle, sys; test = pickle.load(sys.stdin.buffer)\n"
        "import mrwork as mr\n"
        "print(*(each.code for each in mr.records.repair(test, ['velocity'])[0].remarks))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], input=pickle.dumps(test), capture_output=True, check=True
    )
    left = {*done.stdout.decode().split()}
    assert "velocity_late" in told - left
    assert "repaired_velocity" in left
