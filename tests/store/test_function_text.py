"""The text of a function of a user changes with the code and the values that it uses, and with nothing else."""

# The cells that are compiled below inherit it.
from __future__ import annotations

import linecache
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mrwork.store.user_python import function_text, run_text, text_to_compare

pytestmark = pytest.mark.contract

CELL = """
import numpy as np
from math import sqrt
GAIN, TABLE, NAMES, OTHER = 2.0, np.array([1.0, 3.0]), {"a": [1, None]}, object()

def half(x: Other) -> Other:
    return x / 2.0

def unused(x):
    return OTHER

def law(sample: Other, memory, *, gain=GAIN):
    OTHER: Other = half(gain)
    def inner(x):
        return x + OTHER + TABLE[1] + len(NAMES)
    return inner(sqrt(sample)) + sum(np.abs(unused) for unused in TABLE)
"""


def law_of(text: str) -> Callable[..., Any]:
    """The function `law` of a cell of a notebook, which Python finds by the name of its file."""
    cell = f"<cell {len(linecache.cache)}>"
    linecache.cache[cell] = len(text), None, text.splitlines(keepends=True), cell
    names: dict[str, Any] = {}
    exec(compile(text, cell, "exec"), names)
    made: Callable[..., Any] = names["law"]
    return made


def test_a_text_alone_computes_what_its_function_computes() -> None:
    law = law_of(CELL)
    text = function_text(law, what="", remedy="")
    assert run_text(text, "law").law(4.0, None) == law(4.0, None)
    assert "unused(x)" not in text
    assert "object" not in text


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("/ 2.0", "/ 3.0"),  # a helper
        ("= 2.0, np", "= 2.5, np"),  # a default
        ("[1.0, 3.0]", "[1.0, 4.0]"),
        ("[1, None]", "[2, None]"),
        ("TABLE[1]", "TABLE[0]"),
        ("from math", "from cmath"),
    ],
)
def test_what_it_uses_tells_functions_apart(before: str, after: str) -> None:
    assert text_to_compare(law_of(CELL)) != text_to_compare(law_of(CELL.replace(before, after)))


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("return OTHER", "return None"),  # a function that nothing calls
        ("object()", "{}"),  # hidden by a local variable
        ("import numpy as np\n", "import numpy as np\nMORE = 1.0\n"),
    ],
)
def test_what_it_does_not_use_changes_nothing(before: str, after: str) -> None:
    assert text_to_compare(law_of(CELL)) == text_to_compare(law_of(CELL.replace(before, after)))


def test_values_of_now_and_of_closures_count() -> None:
    def law_with(gain: Any) -> Callable[..., Any]:
        def law(sample: Any, memory: Any) -> Any:
            return gain * sample

        return law

    one, other, same = (text_to_compare(law_with(gain)) for gain in (1.0, np.float64(2.0), 1.0))
    assert one == same != other
    law = law_of(CELL)
    before = text_to_compare(law)
    law.__globals__["TABLE"] = np.array([5.0, 6.0])
    assert text_to_compare(law) != before


def test_what_no_text_states_equals_nothing() -> None:
    law = law_of(
        CELL.replace("half(gain)", "half(gain), Other").replace("object()", "object()\nOther = object()")
    )
    assert text_to_compare(law) != text_to_compare(law)
    assert text_to_compare(len) != text_to_compare(len)
