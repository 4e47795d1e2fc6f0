"""What a function does with its numbers, written down as operations of the core.

A `Recording` is a graph of scalar operations. A `Cell` is a number of it that is known only when the graph is computed.
Arithmetic of a cell with a number puts one more operation into the graph, in the order and with the roundings in which
NumPy would do it. Where an operation of the core loses what is not a number, and NumPy's does not, the graph has the
operations that keep it.
"""

from __future__ import annotations

import math
import struct
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import ModuleType
from typing import Any, Final

import numpy as np

from mrwork.base.values import Floats

MOST_OPERATIONS: Final = 20_000
"""Most operations of a formula."""
_MOST_FACTORS = 16
_OWN = ("mrwork.base.", "mrwork.closed_loop.", "mrwork.dampers.", "mrwork.twins.")


def operations_on(xp: ModuleType) -> dict[str, Callable[..., Any]]:
    """Operations of a recording by name, on arrays of NumPy or JAX."""
    return {
        "add": xp.add,
        "subtract": xp.subtract,
        "multiply": xp.multiply,
        "divide": xp.divide,
        "negative": xp.negative,
        "absolute": xp.absolute,
        "sqrt": xp.sqrt,
        "copysign": xp.copysign,
        "minimum": lambda a, b: xp.where(a < b, a, b),
        "maximum": lambda a, b: xp.where(a > b, a, b),
        "rint": xp.rint,
        "less": lambda a, b: xp.where(a < b, 1.0, 0.0),
        "equal": lambda a, b: xp.where(a == b, 1.0, 0.0),
        "where": lambda c, a, b: xp.where(c > 0.0, a, b),
        "exp": xp.exp,
        "log": xp.log,
        "power": xp.power,
        "tanh": xp.tanh,
        "multiply_add": lambda a, b, c: a * b + c,
    }


NUMBERS: Final = operations_on(np)
"""Operations of a recording by name, on arrays of NumPy.

In the core `multiply_add` is rounded once, and `power` has no number for a base below zero and counts a subnormal one
as zero."""


class NotRecordedError(Exception):
    """A function does what no recording holds; the text says what and what to write instead, after file and line."""

    def __init__(self, sentence: str, place: str | None = None) -> None:
        self.sentence, self.place = sentence, place_of_user() if place is None else place
        super().__init__(f"{self.place}: {sentence}" if self.place else sentence)

    def __reduce__(self) -> tuple[Any, ...]:
        """The error again where it was made, and not where it is unpickled."""
        return type(self), (self.sentence, self.place), vars(self)


@dataclass(frozen=True, slots=True)
class Node:
    """An operation of a recording: its name, its operands by their numbers, and the line of the user that made it.

    A node `const` has its value in place of operands, a node `input` its name and place.
    """

    op: str
    of: tuple[Any, ...]
    line: str


class Cell:
    """A number of a recording; a truth is 1 where a condition holds, else 0."""

    __slots__ = ("at", "is_truth", "recording")

    def __init__(self, recording: Recording, at: int, *, is_truth: bool = False) -> None:
        self.recording, self.at, self.is_truth = recording, at, is_truth

    # Functions of NumPy that move cells, as cumsum and einsum, ask for these.
    def __add__(self, other: Any) -> Any:
        return put("add", self, other)

    def __radd__(self, other: Any) -> Any:
        return put("add", other, self)

    def __sub__(self, other: Any) -> Any:
        return put("subtract", self, other)

    def __rsub__(self, other: Any) -> Any:
        return put("subtract", other, self)

    def __mul__(self, other: Any) -> Any:
        return put("multiply", self, other)

    def __rmul__(self, other: Any) -> Any:
        return put("multiply", other, self)


class Recording:
    """A graph of operations, each after its operands."""

    __slots__ = ("_known", "nodes")

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._known: dict[tuple[Any, ...], int] = {}

    def input(self, name: str, place: int) -> Cell:
        """An input by its name and its place in that."""
        return self._put("input", (name, place))

    def cell(self, value: Any) -> Cell:
        """A number as a cell; each number has a node of its own, so that a recording of other numbers is alike."""
        if isinstance(value, Cell):
            return value
        self.nodes.append(Node("const", (float(value),), ""))
        return Cell(self, len(self.nodes) - 1)

    def operation(self, op: str, *of: Any) -> Cell:
        """A cell with what an operation makes of cells and numbers; one that is there already is taken again."""
        return self._put(op, tuple(self.cell(each).at for each in of))

    def _put(self, op: str, of: tuple[Any, ...]) -> Cell:
        key = (op, *of)
        if (at := self._known.get(key)) is None:
            at = self._known[key] = len(self.nodes)
            self.nodes.append(Node(op, of, line_of_user()))
            if len(self.nodes) > 2 * MOST_OPERATIONS:
                raise NotRecordedError(self._too_long(), "")
        return Cell(self, at, is_truth=op in ("less", "equal"))

    def _too_long(self) -> str:
        lines = Counter(node.line for node in self.nodes if node.op not in ("const", "input"))
        (line, most), *_ = lines.most_common(1)
        return (
            f"more than {lines.total():,} operations, of which {most:,} in {line}, where a formula has at most "
            f"{MOST_OPERATIONS:,}; make it shorter"
        )

    def same_as(self, other: Recording) -> bool:
        """Whether another recording has the same operations with the same numbers."""
        return self.alike(other) and all(
            struct.pack("d", mine.of[0]) == struct.pack("d", its.of[0])
            for mine, its in zip(self.nodes, other.nodes, strict=True)
            if mine.op == "const"
        )

    def alike(self, other: Recording) -> bool:
        """Whether another recording has the same operations, perhaps with other numbers."""
        return len(self.nodes) == len(other.nodes) and all(
            mine.op == its.op and (mine.op == "const" or mine.of == its.of)
            for mine, its in zip(self.nodes, other.nodes, strict=True)
        )

    def values(self, inputs: dict[tuple[str, int], Any], ends: Sequence[int]) -> list[Any]:
        """The ends for inputs, numbers or arrays of one shape each."""
        found: dict[int, Any] = {}
        with np.errstate(all="ignore"):
            for at in self.used_by(ends):
                node = self.nodes[at]
                if node.op == "const":
                    found[at] = np.float64(node.of[0])
                elif node.op == "input":
                    found[at] = inputs[node.of]
                else:
                    found[at] = NUMBERS[node.op](*(found[each] for each in node.of))
        return [found[end] for end in ends]

    def used_by(self, ends: Iterable[int]) -> list[int]:
        """Nodes that the ends are made of, each after its operands."""
        used, left = set[int](), list(ends)
        while left:
            at = left.pop()
            if at in used:
                continue
            used.add(at)
            if self.nodes[at].op not in ("const", "input"):
                left.extend(self.nodes[at].of)
        return sorted(used)


# ---- where the user is: in no module of this package and of a library


def _frame_of_user() -> Any:
    frame: Any = sys._getframe(1)
    while frame is not None and _is_installed(frame.f_globals.get("__name__", ""), frame.f_code.co_filename):
        frame = frame.f_back
    return frame


@lru_cache(maxsize=4096)
def _is_installed(module: str, file: str) -> bool:
    """Whether it is of this package or of a library; asked for ten frames of every operation."""
    return module.startswith(_OWN) or "-packages" in file


def line_of_user() -> str:
    """The line that is being recorded, as "line 7"."""
    frame = _frame_of_user()
    return "" if frame is None else f"line {frame.f_lineno}"


def place_of_user() -> str:
    """File and line that are being recorded, as "my_law.py, line 7"."""
    frame = _frame_of_user()
    return "" if frame is None else f"{frame.f_code.co_filename}, line {frame.f_lineno}"


# ---- operations on numbers that may be cells


def put(op: str, *of: Any) -> Any:
    """What an operation of the core makes of numbers, a number where all are known."""
    for each in of:
        if isinstance(each, Cell):
            return each.recording.operation(op, *of)
    with np.errstate(all="ignore"):
        return float(NUMBERS[op](*map(np.float64, of)))


def truth(a: Any) -> Any:
    """1 where a number is not zero, which what is not a number is not either."""
    if isinstance(a, Cell):
        return a if a.is_truth else negation(put("equal", a, 0.0))
    return float(bool(a))


def _as_truth(a: Any) -> Any:
    if isinstance(a, Cell):
        return Cell(a.recording, a.at, is_truth=True)
    return a


def negation(a: Any) -> Any:
    """1 - a of a truth."""
    return _as_truth(put("subtract", 1.0, a))


def both(a: Any, b: Any) -> Any:
    """Whether two numbers hold."""
    return _as_truth(put("multiply", truth(a), truth(b)))


def either(a: Any, b: Any) -> Any:
    """Whether at least one of two numbers holds."""
    return _as_truth(put("maximum", truth(a), truth(b)))


def less(a: Any, b: Any) -> Any:
    """1 where a < b."""
    return put("less", a, b)


def at_most(a: Any, b: Any) -> Any:
    """1 where a <= b."""
    return either(put("less", a, b), put("equal", a, b))


def choose(condition: Any, yes: Any, no: Any) -> Any:
    """`yes` where a condition holds, else `no`."""
    condition = truth(condition)
    if not isinstance(condition, Cell):
        return yes if condition else no
    chosen = put("where", condition, yes, no)
    return _as_truth(chosen) if all(getattr(each, "is_truth", False) for each in (yes, no)) else chosen


def where_number(a: Any, value: Any) -> Any:
    """`value`; what is not a number where `a` is not one, which a comparison would hide."""
    return put("where", put("equal", a, a), value, a) if isinstance(a, Cell) else value


def _extreme(op: str) -> Callable[[Any, Any], Any]:
    def extreme(a: Any, b: Any) -> Any:
        # The core gives the second one where either is not a number, and NumPy none.
        if not isinstance(a, Cell) and not math.isnan(a):
            return put(op, a, b)
        if not isinstance(b, Cell) and not math.isnan(b):
            return put(op, b, a)
        found = put("where", put("equal", a, a), put(op, a, b), a)
        return _as_truth(found) if getattr(a, "is_truth", False) and getattr(b, "is_truth", False) else found

    return extreme


smaller, larger = _extreme("minimum"), _extreme("maximum")


def sign(a: Any) -> Any:
    """1, 0 or -1."""
    return put("where", less(0.0, a), 1.0, put("where", less(a, 0.0), -1.0, where_number(a, 0.0)))


def heaviside(a: Any, at_zero: Any) -> Any:
    """0 below zero, 1 above."""
    return put("where", less(0.0, a), 1.0, put("where", less(a, 0.0), 0.0, where_number(a, at_zero)))


def floor(a: Any) -> Any:
    """The whole number at or below a number."""
    rounded = put("rint", a)
    return put("subtract", rounded, less(a, rounded))


def ceil(a: Any) -> Any:
    """The whole number at or above a number."""
    rounded = put("rint", a)
    return put("add", rounded, less(rounded, a))


def trunc(a: Any) -> Any:
    """The whole number towards zero."""
    return put("copysign", floor(put("absolute", a)), a)


def hypot(a: Any, b: Any) -> Any:
    """Root of the sum of two squares."""
    return put("sqrt", put("add", put("multiply", a, a), put("multiply", b, b)))


def power(a: Any, n: Any) -> Any:
    """a^n, by products where n is a whole number."""
    if not isinstance(n, Cell):
        n = float(n)
        if n == round(n) and abs(n) <= _MOST_FACTORS:
            found: Any = 1.0
            for factor in range(int(abs(n))):
                found = put("multiply", found, a) if factor else a
            return put("divide", 1.0, found) if n < 0.0 else found
        if n == 0.5:
            return put("sqrt", a)
    return put("power", a, n)


def is_finite(a: Any) -> Any:
    """1 where a number is neither infinite nor none."""
    return less(put("absolute", a), math.inf)


def is_none(a: Any) -> Any:
    """1 where a number is none."""
    return negation(put("equal", a, a))


def dot(a: Any, b: Any) -> Any:
    """Sum of products, each rounded once with the sum before it: the order of no library is promised."""
    total: Any = put("multiply", a[0], b[0]) if len(a) else 0.0
    for left, right in zip(a[1:], b[1:], strict=True):
        total = put("multiply_add", left, right, total)
    return total


def interpolated(x: Any, places: Floats, values: Sequence[Any], left: Any, right: Any) -> Any:
    """A line between neighbours at rising places, and `left` and `right` beyond them."""
    found: Any = left
    for k in range(len(places) - 1):
        slope = put("divide", put("subtract", values[k + 1], values[k]), places[k + 1] - places[k])
        line = put("add", put("multiply", slope, put("subtract", x, places[k])), values[k])
        found = put("where", less(x, places[k]), found, line)
    found = put("where", less(x, places[-1]), found, put("where", less(places[-1], x), right, values[-1]))
    return where_number(x, found)
