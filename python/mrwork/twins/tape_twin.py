"""Equations of a damper of the user in JAX, from its tapes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import jax.numpy as jnp
from jax import Array, lax

from mrwork.base.recording import operations_on
from mrwork.base.tape import Tape
from mrwork.dampers.own_equations import OwnEquations


def _root(a: Array) -> Array:
    """Square root; at zero with a derivative of zero, as in the core."""
    return jnp.where(a > 0.0, jnp.sqrt(jnp.where(a > 0.0, a, 1.0)), jnp.sqrt(lax.stop_gradient(a)))


def _power(a: Array, n: Array) -> Array:
    """a^n; at zero with derivatives of zero, as in the core."""
    return jnp.where(a > 0.0, jnp.where(a > 0.0, a, 1.0) ** n, lax.stop_gradient(a) ** lax.stop_gradient(n))


_OPERATIONS: Final = operations_on(jnp) | {"sqrt": _root, "power": _power}
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
