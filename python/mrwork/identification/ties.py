"""Parameters that are tied to others by an expression, such as k = 2*c: its grammar and its values.

An expression has numbers, names of parameters, parentheses and `+ - * / **`, an exponent being a number. It is read as
syntax and walked; nothing is run.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import isfinite
from typing import Any
from warnings import catch_warnings

import numpy as np

from mrwork.base.arguments import AnyArray
from mrwork.base.keys import check_known
from mrwork.base.summary import list_names
from mrwork.dampers.conversions import Conversion
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError

# Characters of an expression; longer ones could be nested too deeply to be read.
_LONGEST_EXPRESSION = 200
_GRAMMAR = "give numbers, parameters, parentheses and + - * / **, as in 2*c"

_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Ties:
    """Ties of a model in an order in which each needs only parameters that are known before it.

    The parameters at `indices` equal the `expressions`, between `lower` and `upper` bounds. A candidate of which a tied
    parameter leaves its bounds cannot be simulated.
    """

    names: tuple[str, ...]
    indices: tuple[int, ...]
    expressions: tuple[str, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]

    @classmethod
    def of(cls, spec: DamperSpec, given: Mapping[str, str], box: Box) -> Ties:
        """Read the ties of a model whose parameters have the bounds of `box`."""
        for name in given:
            check_known(name, spec.names, f"a tie is of {name!r}, which the model does not have")
        used = {name: _names_in(_read_tie(name, text), name, spec.names) for name, text in given.items()}
        held = [name for name in given if spec.names.index(name) not in box.free]
        if held:
            raise SettingError(f"{held[0]} is tied and held at once; leave out its tie or its bounds")
        order: list[str] = []
        while len(order) < len(given):
            ready = [
                name for name in given if name not in order and not (used[name] & set(given)) - set(order)
            ]
            if not ready:
                rest = [name for name in given if name not in order]
                raise SettingError(
                    f"the ties of {list_names(rest)} go in a circle; tie them to other parameters"
                )
            order += ready
        indices = tuple(spec.names.index(name) for name in order)
        return cls(
            names=spec.names,
            indices=indices,
            expressions=tuple(given[name] for name in order),
            lower=tuple(box.lower[index] for index in indices),
            upper=tuple(box.upper[index] for index in indices),
        )

    def apply(self, theta: AnyArray) -> AnyArray:
        """Parameters with those that are tied, shape (..., n_params), of NumPy or JAX.

        What a candidate has for a tied one has no effect.
        """
        named = {name: theta[..., index] for index, name in enumerate(self.names)}
        for index, text in zip(self.indices, self.expressions, strict=True):
            name = self.names[index]
            with np.errstate(all="ignore"):
                named[name] = _evaluate(_read_tie(name, text), named)
        return theta.__array_namespace__().stack([*named.values()], axis=-1)

    def feasible(self, theta: AnyArray) -> AnyArray:
        """As `apply`; not a number where a tied parameter leaves its bounds."""
        tied, xp = self.apply(theta), theta.__array_namespace__()
        values = tied[..., np.array(self.indices)]
        inside = (values >= xp.asarray(self.lower)) & (values <= xp.asarray(self.upper))
        return xp.where(xp.all(inside, axis=-1)[..., None], tied, xp.nan)

    @property
    def conversion(self) -> Conversion:
        """`apply` with its derivatives by the parameters that are not tied."""
        return Conversion(self.apply)


class _StrangeSyntaxError(Exception):
    """A part of an expression that the grammar does not permit."""


def _evaluate(node: ast.expr, named: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant() if (number := _number(node)) is not None:
            return np.float64(number)
        case ast.Name(id=name):
            return named[name]
        case ast.UnaryOp(op=ast.UAdd() | ast.USub() as op, operand=inner):
            value = _evaluate(inner, named)
            return -value if isinstance(op, ast.USub) else value
        case ast.BinOp(left=left, op=ast.Pow(), right=right) if (power := _number(right)) is not None:
            return _evaluate(left, named) ** power
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            both = (_evaluate(operand, named) for operand in (left, right))
            return _BINARY[type(op)](*both)
    raise _StrangeSyntaxError(ast.unparse(node))


@cache
def _read_tie(name: str, text: str) -> ast.expr:
    """The syntax of an expression that has nothing but what the grammar permits."""
    if len(text) > _LONGEST_EXPRESSION:
        raise SettingError(
            f"the tie of {name} has {len(text)} characters; give at most {_LONGEST_EXPRESSION}"
        )
    try:
        # Python warns of some texts that are refused here.
        with catch_warnings(action="ignore"):
            tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise SettingError(f"the tie of {name} is {text!r}, which is no expression; {_GRAMMAR}") from None
    used = [node.id for node in ast.walk(tree) if isinstance(node, ast.Name)]
    try:
        # Of no candidate, which tells whether the expression can be evaluated.
        _evaluate(tree, dict.fromkeys(used, np.empty(0)))
    except _StrangeSyntaxError as strange:
        raise SettingError(
            f"the tie of {name} is {text!r}, and {str(strange)!r} is not understood; {_GRAMMAR}"
        ) from None
    return tree


def _number(node: ast.expr) -> float | None:
    """An exponent; `None` where it is no number."""
    match node:
        case ast.Constant(value=float() | int() as value) if not isinstance(value, bool):
            return float(value) if isfinite(value) else None
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            number = _number(inner)
            return None if number is None else -number
    return None


def _names_in(tree: ast.expr, tied: str, names: Sequence[str]) -> set[str]:
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    for name in sorted(used):
        check_known(name, names, f"the tie of {tied} has {name!r}, which the model does not have")
    if not used:
        raise SettingError(f"the tie of {tied} names no parameter; hold it by equal bounds instead")
    return used
