"""What NumPy does with arrays is recorded, with what is no number; what cannot be is told with its line."""

import itertools
import math
import random
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from mrwork import _rust
from mrwork.base.recording import MOST_OPERATIONS, NUMBERS, NotRecordedError, Recording
from mrwork.base.side_effects import effect_of, with_numpy
from mrwork.base.tape import tape_of
from mrwork.base.traced import Traced, bare, inputs

TABLE = np.array([3.0, -1.0, 4.0, 1.5])
WEIGHT = np.random.default_rng(1).normal(size=(2, 3))
PLACES = np.array([-1.0, 0.0, 0.5, 2.0])
SPECIAL = (math.nan, math.inf, -math.inf, 0.0, -0.0, 0.5, -0.5, 1.0, 2.5, -3.0, 1e-310)


def changed(x: Any) -> Any:
    y = x.copy()
    y += 1.0
    y[:, 0] = 3.0 * y[:, 1]
    y[y > 1.0] = 0.5
    y[1, 2] = y[0, 0]
    return y


def filled(x: Any) -> Any:
    y = np.zeros_like(x)
    y[:, 1] = np.abs(x[:, 1])
    return y


def shifted(x: Any) -> Any:
    y = x.copy()
    y[:, 1:] = y[:, :-1]
    return y


# Functions of x, shape (2, 3); every one of them has the bits of NumPy, and its NaN.
EXACT: dict[str, Callable[[Any], Any]] = {
    "arithmetic": lambda x: 2.0 * x - x / 3.0 + 1.0 - (-x),
    "from the other side": lambda x: 1.0 - (2.0 / x),
    "a number of NumPy": lambda x: np.float64(2.0) * x + np.array([1.0, 2.0, 3.0]),
    "magnitudes": lambda x: np.sqrt(np.abs(x)) + np.fabs(x),
    "squares": lambda x: x**2 + np.square(x),
    "whole powers": lambda x: x**0 + x**1,
    "root": lambda x: x**0.5,
    "clip": lambda x: np.clip(x, 0.0, 1.88),
    "clip of a method": lambda x: x.clip(-1.0),
    "minimum": lambda x: np.minimum(x, 1.0),
    "minimum on the left": lambda x: np.minimum(1.0, x),
    "maximum of two": lambda x: np.maximum(x[0], x[1]),
    "minimum of two": lambda x: np.minimum(x[1], x[0]),
    "of numbers only": lambda x: np.fmax(x[0], x[1]) - np.fmin(x[0], 0.5),
    "sign": lambda x: np.sign(x),
    "copysign": lambda x: np.copysign(2.0, x),
    "heaviside": lambda x: np.heaviside(x, 0.5),
    "whole numbers": lambda x: np.floor(x) + 10.0 * np.ceil(x) + 100.0 * np.rint(x),
    "towards zero": lambda x: np.trunc(x),
    "where": lambda x: np.where(x > 0.0, x, -2.0),
    "where of a number": lambda x: np.where(x, 1.0, 2.0),
    "comparisons": lambda x: (x > 0.0) * 1.0 + (x >= 0.5) * 2.0 + (x == 1.0) * 4.0 + (x != 2.5) * 8.0,
    "at most": lambda x: np.where(x <= x[::-1], 1.0, 0.0),
    "conditions": lambda x: ((x > 0.0) & (x < 1.0) | ~(x > -1.0)) * 1.0,
    "a sum of conditions is or": lambda x: ((x > 0.0) + (x > -1.0)) * 5.0,
    "a product of conditions is and": lambda x: ((x < 2.0) * (x > -1.0)) * 5.0,
    "conditions are counted": lambda x: np.sum(x > 0.0, axis=1) * 1.0,
    "logic of numbers": lambda x: np.logical_and(x, x > 0.0) * 1.0 + np.logical_not(x) * 2.0,
    "any and all": lambda x: (x > 0.0).any(axis=1) * 1.0 + np.all(x > 0.0) * 2.0,
    "finite": lambda x: np.isfinite(x) * 1.0 + np.isnan(x) * 2.0 + np.isinf(x) * 4.0,
    "no number is one": lambda x: np.nan_to_num(x, nan=7.0),
    "select": lambda x: np.select([x > 1.0, x > 0.0], [1.0, 0.5], -1.0),
    "changed in place": changed,
    "filled": filled,
    "shifted": shifted,
    "moved": lambda x: np.concatenate([x[:, :1], np.roll(x, 1, axis=1)], axis=1).T,
    "stacked": lambda x: np.stack([x[0], x[1]]) + np.hstack([x[0], x[1]]).reshape(2, 3),
    "differences": lambda x: np.diff(x, axis=1),
    "sums": lambda x: x.sum(axis=1) + np.sum(x, axis=1),
    "least": lambda x: x.min(axis=1) + np.max(x, axis=1),
    "running sums": lambda x: np.cumsum(x, axis=1),
    "place of the least": lambda x: np.argmin(np.where(np.isnan(x), 9.0, x), axis=1) * 1.0,
    "interpolated": lambda x: np.interp(x, PLACES, TABLE),
    "interpolated to the left": lambda x: np.interp(x, PLACES, TABLE, left=7.0),
    "bins": lambda x: np.digitize(x, PLACES) * 1.0 + np.searchsorted(PLACES, x) * 10.0,
    "a list of numbers": lambda x: np.stack([x[0, 0], x[1, 1]]) * 2.0,
    "rows": lambda x: np.array([1.0, 2.0])[:, None] * x,
    "unpacked": lambda x: (lambda a, b: a * b)(*x),
    "outer": lambda x: np.outer(x[0], [1.0, 2.0]),
    "whole": lambda x: np.where(np.isfinite(x), x, 0.0).astype(int) * 1.0,
    "polynomial": lambda x: np.polyval([1.0, 2.0, 3.0], x),
}
# Functions with exp, log, tanh, power or the order of a sum of their own: to rounding.
ROUNDED: dict[str, Callable[[Any], Any]] = {
    "exp": lambda x: np.exp(x),
    "log": lambda x: np.log(x),
    "other logarithms": lambda x: np.log2(x) + np.log10(x),
    "tanh": lambda x: np.tanh(x),
    "powers": lambda x: x**3 + x**-2 + np.abs(x) ** 1.7,
    "powers of what may be negative": lambda x: x**1.7 + x**0.35,
    "small powers": lambda x: np.abs(x) ** 0.35,
    "reciprocal powers": lambda x: np.abs(x) ** -0.35,
    "exponent": lambda x: np.abs(x[0]) ** np.clip(x[1], -2.0, 2.0),
    "angles": lambda x: np.sin(x) + 2.0 * np.cos(3.0 * x) + np.tan(0.5 * x),
    "angle of a point": lambda x: np.arctan2(x[0], x[1]) + np.arctan(x[0]),
    "angles of sines": lambda x: np.arcsin(x) + 2.0 * np.arccos(x),
    "mean": lambda x: x.mean(axis=1) + np.mean(x),
    "matrix": lambda x: WEIGHT @ np.nan_to_num(x.T, nan=0.0, posinf=9.0, neginf=-9.0),
    "dot": lambda x: np.dot(x, TABLE[:3]) + x @ TABLE[:3],
    "einsum": lambda x: np.einsum("ij,kj->ik", x, WEIGHT),
    "hypotenuse": lambda x: np.hypot(x, 2.0),
    "norm": lambda x: np.linalg.norm(x, axis=1),
}


def recorded(function: Callable[[Any], Any], numbers: np.ndarray[Any, Any]) -> Any:
    recording = Recording()
    cells = np.asarray(bare(function(inputs(recording, "x", numbers.shape))), dtype=object)
    ends = [recording.cell(cell).at for cell in cells.ravel()]
    found = recording.values({("x", place): value for place, value in enumerate(numbers.ravel())}, ends)
    return np.array(found, dtype=float).reshape(cells.shape)


@pytest.mark.parametrize("name", [*EXACT, *ROUNDED])
def test_a_recording_has_the_numbers_of_numpy(name: str) -> None:
    rng = np.random.default_rng(2)
    draws = [
        *rng.normal(size=(30, 2, 3)),
        *np.array([*itertools.product(SPECIAL, SPECIAL)])[:, [0, 1, 0, 1, 0, 1]].reshape(-1, 2, 3),
    ]
    function = EXACT.get(name) or ROUNDED[name]
    for x in draws:
        with np.errstate(all="ignore"):
            expected = np.asarray(function(x.copy()), dtype=float)
        found = recorded(function, x)
        assert found.shape == expected.shape
        if name in EXACT:
            np.testing.assert_array_equal(found, expected)
        else:
            np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-300)


def test_numbers_of_the_loop_choose_a_row_of_a_table() -> None:
    def looked_up(x: Any) -> Any:
        place = np.digitize(x, PLACES[1:])
        return (
            np.choose(place, TABLE) + np.take(np.stack([x[0], x[1], x[0], x[1]]), place[:, 0] - 1, axis=0)[0]
        )

    for x in np.random.default_rng(3).normal(size=(30, 2, 3)):
        np.testing.assert_array_equal(recorded(looked_up, x), looked_up(x))


def test_a_place_that_is_not_in_a_table_is_no_number() -> None:
    # NumPy raises an IndexError, and a law then has no command.
    found = recorded(lambda x: np.take(x[0], np.rint(x[0]).astype(int)), np.array([[2.0, 7.0, -1.0, -5.0]]))
    np.testing.assert_array_equal(found, [-1.0, math.nan, -5.0, math.nan])
    found = recorded(lambda x: np.choose(np.rint(x).astype(int), TABLE), np.array([[3.0, 4.0, -1.0]]))
    np.testing.assert_array_equal(found, [[1.5, math.nan, math.nan]])


@examples(60)
@given(st.lists(st.sampled_from(sorted(EXACT)), min_size=1, max_size=4), st.integers(0, 10_000))
def test_functions_after_each_other_are_recorded(names: list[str], seed: int) -> None:
    kept = [name for name in names if EXACT[name](np.ones((2, 3))).shape == (2, 3)]

    def chain(x: Any) -> Any:
        for name in kept:
            x = EXACT[name](x)
        return x * 1.0

    x = np.random.default_rng(seed).normal(size=(2, 3))
    with np.errstate(all="ignore"):
        np.testing.assert_array_equal(recorded(chain, x), chain(x))


def test_operations_are_those_of_the_core() -> None:
    of_numbers = {"add_number": 2, "multiply_number": 2, "multiply_number_add": 3}
    core = dict(_rust.tape_operations())
    assert core.keys() - of_numbers.keys() == NUMBERS.keys()
    assert {name: core[name] for name in of_numbers} == of_numbers
    for name, arity in core.items():
        if name in NUMBERS:
            assert np.isfinite(NUMBERS[name](*[1.0] * arity))


def test_a_tape_has_slots_for_what_is_still_needed() -> None:
    recording = Recording()
    x = inputs(recording, "x", (50,))
    total = np.sum(2.0 * np.abs(x) + 1.0)
    tape = tape_of(recording, [cell.at for cell in x.cells], [total.cells[()].at])
    assert len(tape.entries) == 199
    assert tape.table == (2.0, 1.0)
    assert tape.n_slots <= 102
    assert tape.n_inputs == 50
    assert {re.sub(r"\d+", "", line) for line in tape.lines} == {"line "}


def late(x: Any) -> Any:
    if x[0, 0] > 1.0:
        return x
    return 2.0 * x


# What to write instead, beside file and line.
REFUSED: dict[str, tuple[Callable[[Any], Any], str]] = {
    "if": (late, "np.where"),
    "max": (lambda x: max(0.0, x[0, 0]), "np.maximum"),
    "and": (lambda x: (x[0, 0] > 0.0) and x, "np.where"),
    "float": (lambda x: float(x[0, 0]), "write the function of np"),
    "math": (lambda x: math.exp(x[0, 0]), "write the function of np"),
    "int": (lambda x: TABLE[int(x[0, 0])], "np.trunc or np.floor"),
    "round": (lambda x: round(x[0, 0]), "np.rint"),
    "an index": (lambda x: TABLE[np.argmin(x)], r"np\.choose"),
    "a place": (lambda x: range(4)[np.argmin(x)], r"np\.choose"),
    "an array that is filled": (lambda x: np.asarray(x), r"np\.zeros_like"),
    "a list": (lambda x: np.array([x[0, 0], 1.0]), r"np\.stack"),
    "another function": (lambda x: np.cbrt(x), r"np\.cbrt is none of the operations of the core"),
    "percentile": (lambda x: np.percentile(x, 50), "asks for values|none of the operations"),
    "a size": (lambda x: x[x > 0.0], r"np\.where\(condition, x, other\)"),
    "where without choices": (lambda x: np.where(x > 0.0), r"np\.where\(condition, a, b\)"),
    "a difference of conditions": (lambda x: (x > 0.0) - (x > 1.0), "logical_not"),
    "digits": (lambda x: round(x[0, 0], 2), "np.rint"),
    "a general norm": (lambda x: np.linalg.norm(x, 1), "write out"),
    "an index that is no whole number": (lambda x: np.take(x[0], np.rint(x)), "astype"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_recorded_is_told_with_its_line(name: str) -> None:
    function, remedy = REFUSED[name]
    with pytest.raises(NotRecordedError, match=rf"^.*test_recording\.py, line \d+: .*({remedy})"):
        recorded(function, np.ones((2, 3)))


def test_a_formula_that_is_too_long_is_told_with_its_longest_line() -> None:
    def long(x: Any) -> Any:
        for _ in range(MOST_OPERATIONS):
            x = x * 1.5 + 0.5
        return x

    with pytest.raises(NotRecordedError, match=r"operations, of which [\d,]+ in line \d+, where .* 20,000"):
        recorded(long, np.ones((2, 3)))


def test_a_recording_is_another_one_with_each_random_number() -> None:
    made = []
    for function in (lambda x: x * random.random(), lambda x: x * 0.5):
        recordings = [Recording(), Recording()]
        for recording in recordings:
            function(inputs(recording, "x", (1,)))
        made.append(recordings[0].same_as(recordings[1]))
        assert recordings[0].alike(recordings[1])
    assert made == [False, True]


SEEN: list[Any] = []
LAST = [0.0]
COUNT = 0


def appends(x: Any) -> Any:
    SEEN.append(x)
    return x


def stores(x: Any) -> Any:
    LAST[0] = x
    return x


def stores_by_another_name(x: Any) -> Any:
    last = LAST
    last[0] = x
    return x


def counts(x: Any) -> Any:
    global COUNT
    COUNT += 1
    return x


def prints(x: Any) -> Any:
    print(x)
    return x


def helper(x: Any) -> Any:
    return stores(x)


class Keeps:
    """An object that keeps what it has seen."""

    def law(self, x: Any) -> Any:
        self.last = x
        return x


def collects(x: Any) -> Any:
    rows = []
    for k in range(3):
        y = 2.0 * x[:, k]
        rows.append(y)
    x[:, 0] = 0.0
    return np.stack(rows)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (appends, "calls SEEN.append"),
        (stores, "changes LAST from outside"),
        (stores_by_another_name, "changes last from outside"),
        (counts, "changes COUNT"),
        (prints, "calls print"),
        (helper, "changes LAST from outside"),
        (Keeps().law, "changes self from outside"),
    ],
)
def test_an_effect_beside_the_result_is_found_in_the_text(function: Any, words: str) -> None:
    assert re.search(rf"test_recording\.py, line \d+: it {words}", effect_of(function) or "")


@pytest.mark.parametrize("function", [collects, late, EXACT["changed in place"], EXACT["clip"]])
def test_what_a_function_does_with_its_own_is_no_effect(function: Any) -> None:
    assert effect_of(function) is None


TYPED = """
def law(x):
    y = x * GAIN
    y[0, 0] = OTHER
    return np.where(y > 0.0, y, 0.0)
def inner(x):
    return [k * x for k in range(3)]
"""
DOES_MORE = {
    "SEEN.append(x)": "calls something",
    "print(x)": "calls something",
    "global COUNT; COUNT += 1": "changes COUNT",
    "LAST[0] = x": "may be that",
    "x.last = LAST": "may be that",
}


def test_a_function_typed_at_a_prompt_is_recorded() -> None:
    """It has no text; its instructions say whether it does more than its result."""
    names: dict[str, Any] = {"np": np, "GAIN": 2.0, "OTHER": 3, "SEEN": [], "LAST": [0.0]}
    exec(compile(TYPED, "<stdin>", "exec"), names)
    x = np.random.default_rng(0).normal(size=(2, 3))
    for name in ("law", "inner"):
        assert effect_of(names[name]) is None
    np.testing.assert_array_equal(recorded(names["law"], x), names["law"](x))
    for statement, words in DOES_MORE.items():
        exec(compile(f"def law(x):\n    {statement}\n    return x\n", "<stdin>", "exec"), names)
        assert re.search(rf"<stdin>, line 2: it .*{words}", effect_of(names["law"]) or ""), statement


def test_text_that_says_jnp_is_recorded_with_numpy() -> None:
    jnp = pytest.importorskip("jax.numpy")
    names = {"jnp": jnp}
    exec(
        "def inner(x):\n    return jnp.tanh(x)\n\ndef law(x):\n    return jnp.where(x > 0.0, inner(x), 0.0)\n",
        names,
    )
    x = np.array([[0.5, -0.5, 2.0]])
    found = recorded(with_numpy(names["law"]), x)
    np.testing.assert_allclose(found, np.where(x > 0.0, np.tanh(x), 0.0), rtol=1e-15)
    assert isinstance(inputs(Recording(), "x", (2,)), Traced)
