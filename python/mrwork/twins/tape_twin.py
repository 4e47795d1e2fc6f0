"""Equations of a damper of the user in JAX, from its tapes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import jax.numpy as jnp
from jax import Array, lax

from mrwork.base.tape import Tape
from mrwork.dampers.own_equations import OwnEquations


def _root(a: Array) -> Array:
    """Square root; at zero with a derivative of zero, as in the core."""
    return jnp.where(a > 0.0, jnp.sqrt(jnp.where(a > 0.0, a, 1.0)), jnp.sqrt(lax.stop_gradient(a)))


def _power(a: Array, n: Array) -> Array:
    """a^n; at zero with derivatives of zero, as in the core."""
    return jnp.where(a > 0.0, jnp.where(a > 0.0, a, 1.0) ** n, lax.stop_gradient(a) ** lax.stop_gradient(n))


_OPERATIONS: Final[Mapping[str, Callable[..., Any]]] = {
    "add": jnp.add,
    "subtract": jnp.subtract,
    "multiply": jnp.multiply,
    "divide": jnp.divide,
    "negative": jnp.negative,
    "absolute": jnp.abs,
    "sqrt": _root,
    "copysign": jnp.copysign,
    "minimum": lambda a, b: jnp.where(a < b, a, b),
    "maximum": lambda a, b: jnp.where(a > b, a, b),
    "rint": jnp.rint,
    "less": lambda a, b: jnp.where(a < b, 1.0, 0.0),
    "equal": lambda a, b: jnp.where(a == b, 1.0, 0.0),
    "where": lambda c, a, b: jnp.where(c > 0.0, a, b),
    "exp": jnp.exp,
    "log": jnp.log,
    "power": _power,
    "tanh": jnp.tanh,
    "multiply_add": lambda a, b, c: a * b + c,
}
_WITH_NUMBER: Final = {
    "add_number": "add",
    "multiply_number": "multiply",
    "multiply_number_add": "multiply_add",
}


def walked(tape: Tape, inputs: Sequence[Array]) -> list[Array]:
    """Results of a tape for its inputs, one after the other."""
    slots = dict(enumerate([*inputs, *map(jnp.float64, tape.constants)]))
    for name, to, of in tape.entries:
        operands: list[Any] = list(map(slots.get, of))
        if name in _WITH_NUMBER:
            operands[1] = tape.table[of[1]]
        slots[to] = _OPERATIONS[_WITH_NUMBER.get(name, name)](*operands)
    return [slots[end] for end in tape.ends]


def equations_of(own: OwnEquations) -> tuple[Callable[..., Array], Callable[..., Array] | None]:
    """Force and rate, functions of parameters, states, displacement and velocity."""

    def force(p: Any, state: Array, x: Array, v: Array) -> Array:
        (found,) = walked(own.force, [*p, *state, x, v])
        return found

    def rate(p: Any, state: Array, x: Array, v: Array) -> Array:
        assert own.rate is not None
        return jnp.stack(walked(own.rate, [*p, *state, x, v]))

    return force, None if own.rate is None else rate
