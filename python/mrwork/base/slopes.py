"""Derivatives of a recording by its inputs, as further operations, and the spectral radius of a matrix of them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from itertools import product
from typing import Any, Final

from mrwork.base import recording as rec
from mrwork.base.recording import Cell, Recording, put

Slopes = list[list[Any]]
"""Cells, and 0.0 where nothing depends, by end and input."""

# The radius is at most ||J^8||^(1/8), which units of the states hardly change.
_SQUARINGS: Final = 3
# So that a matrix of zeros has a size.
_LEAST: Final = 1e-300


def slopes_of(recording: Recording, ends: Sequence[int], inputs: Sequence[int]) -> Slopes:
    """Derivative of each end by each input; at a kink that of the branch which the values take.

    Parameters
    ----------
    ends, inputs
        Numbers of nodes.
    """
    order = [at for at in recording.used_by(ends) if recording.nodes[at].op not in ("const", "input")]
    columns = []
    for input_ in inputs:
        slopes: dict[int, Any] = {input_: 1.0}
        for at in order:
            slopes[at] = _slope(recording, at, slopes)
        columns.append([slopes.get(end, 0.0) for end in ends])
    return [list(row) for row in zip(*columns, strict=True)] if columns else [[] for _ in ends]


def _is_zero(a: Any) -> bool:
    return not isinstance(a, Cell) and a == 0.0


def _times(a: Any, b: Any) -> Any:
    if _is_zero(a) or _is_zero(b):
        return 0.0
    if not isinstance(a, Cell) and a == 1.0:
        return b
    return put("multiply", a, b)


def _plus(a: Any, b: Any) -> Any:
    if _is_zero(a) or _is_zero(b):
        return b if _is_zero(a) else a
    return put("add", a, b)


def _minus(a: Any) -> Any:
    return 0.0 if _is_zero(a) else put("negative", a)


def _slope(recording: Recording, at: int, slopes: dict[int, Any]) -> Any:
    """Derivative of a node, from those of its operands."""
    node = recording.nodes[at]
    moves = [slopes.get(each, 0.0) for each in node.of]
    if all(map(_is_zero, moves)):
        return 0.0
    here, of = Cell(recording, at), [Cell(recording, each) for each in node.of]
    match node.op:
        case "add" | "subtract":
            return _plus(moves[0], moves[1] if node.op == "add" else _minus(moves[1]))
        case "negative":
            return _minus(moves[0])
        case "multiply" | "multiply_add":
            both = _plus(_times(moves[0], of[1]), _times(moves[1], of[0]))
            return _plus(both, moves[2]) if node.op == "multiply_add" else both
        case "divide":
            return put("divide", _plus(moves[0], _minus(_times(moves[1], here))), of[1])
        case "absolute":
            return _times(moves[0], put("copysign", 1.0, of[0]))
        case "sqrt":
            return _times(moves[0], put("divide", 0.5, here))
        case "copysign":
            return _times(moves[0], _times(put("copysign", 1.0, of[0]), put("copysign", 1.0, of[1])))
        case "minimum":
            return rec.choose(rec.less(of[0], of[1]), moves[0], moves[1])
        case "maximum":
            return rec.choose(rec.less(of[1], of[0]), moves[0], moves[1])
        case "where":
            return put("where", of[0], moves[1], moves[2])
        case "exp":
            return _times(moves[0], here)
        case "log":
            return put("divide", moves[0], of[0])
        case "power":
            by_base = _times(moves[0], _times(of[1], put("power", of[0], put("subtract", of[1], 1.0))))
            if _is_zero(moves[1]):
                return by_base
            by_exponent = rec.choose(rec.less(0.0, of[0]), _times(here, put("log", of[0])), 0.0)
            return _plus(by_base, _times(moves[1], by_exponent))
        case "tanh":
            return _times(moves[0], put("subtract", 1.0, put("multiply", here, here)))
    # Whole numbers and conditions stay where they are.
    return 0.0


def radius_of(slopes: Slopes) -> Any:
    """A bound of the spectral radius of a square matrix of slopes."""
    n = len(slopes)
    if n == 1:
        return put("absolute", slopes[0][0])
    size = put("add", reduce(rec.larger, (put("absolute", each) for row in slopes for each in row)), _LEAST)
    powers = [[0.0 if _is_zero(each) else put("divide", each, size) for each in row] for row in slopes]
    for _ in range(_SQUARINGS):
        powers = [
            [reduce(_plus, (_times(powers[i][k], powers[k][j]) for k in range(n))) for j in range(n)]
            for i in range(n)
        ]
    norm = reduce(_plus, (_times(powers[i][j], powers[i][j]) for i, j in product(range(n), repeat=2)))
    for _ in range(1 + _SQUARINGS):
        norm = put("sqrt", norm)
    return put("multiply", size, norm)
