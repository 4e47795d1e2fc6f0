"""Formulas of a user in JAX, from their tapes: equations of a damper, and a control law."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mrwork.base.recording import operations_on
from mrwork.base.tape import Tape
from mrwork.dampers.own_equations import OwnEquations
from mrwork.twins.loop_laws import Gains, Measurement


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


Place = tuple[Hashable, int]
"""An array by its name, and an entry of its last axis."""


def walked(tape: Tape, arrays: dict[Hashable, Array], inputs: Sequence[Place]) -> Array:
    """Results of a tape whose inputs are these entries of arrays, (..., n_ends); `arrays` gets what is computed.

    Equal operations that need none of each other are done at once: of thousands of numbers alone XLA makes a program
    for minutes.
    """
    arrays |= {"constant": jnp.array(tape.constants), "table": jnp.array(tape.table)}
    places = [*inputs, *(("constant", entry) for entry in range(len(tape.constants)))]
    slots, levels, groups = dict(enumerate(places)), dict[Hashable, int](), dict[Any, list[list[Place]]]()
    for name, to, of in tape.entries:
        operands = (
            [slots[each] for each in of]
            if name not in _WITH_NUMBER
            else [("table", each) if place == 1 else slots[each] for place, each in enumerate(of)]
        )
        level = 1 + max(levels.get(source, 0) for source, _ in operands)
        group = groups.setdefault((level, _WITH_NUMBER.get(name, name)), [])
        slots[to] = (level, _WITH_NUMBER.get(name, name)), len(group)
        group.append(operands)
        levels[slots[to][0]] = level
    for key in sorted(groups):
        arrays[key] = _OPERATIONS[key[1]](
            *(_entries(arrays, column) for column in zip(*groups[key], strict=True))
        )
    return _entries(arrays, [slots[end] for end in tape.ends])


def _entries(arrays: Mapping[Hashable, Array], places: Sequence[Place]) -> Array:
    """Entries of arrays beside each other, taken in slices, whose derivatives are cheap."""
    parts, first = list[Array](), 0
    while first < len(places):
        (name, start), last, step = places[first], first, 1
        if first + 1 < len(places) and places[first + 1][0] == name:
            step = places[first + 1][1] - start
            while last + 1 < len(places) and places[last + 1] == (name, start + (last + 1 - first) * step):
                last += 1
        count, array = last + 1 - first, arrays[name]
        if count > 1 and step < 1:
            # Equal or falling places: one entry many times, or the slice the other way round.
            end = start + (count - 1) * step
            parts.append(
                array[..., end : start + 1 : -step][..., ::-1]
                if step
                else array[..., start : start + 1].repeat(count, -1)
            )
        else:
            parts.append(array[..., start : start + (count - 1) * step + 1 : step])
        first = last + 1
    shape = jnp.broadcast_shapes(*(part.shape[:-1] for part in parts))
    return jnp.concatenate([jnp.broadcast_to(part, (*shape, part.shape[-1])) for part in parts], axis=-1)


def equations_of(own: OwnEquations) -> tuple[Callable[..., Array], Callable[..., Array] | None]:
    """Force and rate, functions of parameters, states, displacement and velocity."""

    def walked_at(tape: Tape, p: Any, state: Array, x: Array, v: Array) -> Array:
        numbers = jnp.stack(jnp.broadcast_arrays(*p, x, v), axis=-1)
        entries = (*((0, k) for k in range(len(p))), *((1, k) for k in range(state.shape[-1])))
        return walked(tape, {0: numbers, 1: state}, (*entries, (0, len(p)), (0, len(p) + 1)))

    def force(p: Any, state: Array, x: Array, v: Array) -> Array:
        return walked_at(own.force, p, state, x, v)[..., 0]

    def rate(p: Any, state: Array, x: Array, v: Array) -> Array:
        assert own.rate is not None
        return walked_at(own.rate, p, state, x, v)

    return force, None if own.rate is None else rate


@dataclass(frozen=True, slots=True, kw_only=True)
class TapeLaw:
    """A control law of a user: its tape, the name and place of each input, and the names of its settings.

    Its first inputs and ends are what it keeps, its other ends the commands. `storeys` are those whose drifts it reads.
    """

    tape: Tape
    inputs: tuple[tuple[str, int], ...]
    settings: tuple[str, ...]
    storeys: tuple[int, ...]

    def __call__(self, gains: Gains, measured: Measurement, memory: Array) -> tuple[Array, Array]:
        """Commands of a sample, (n_devices,), and what the law keeps."""
        n = measured.state.size // 2
        readings = {
            "memory": memory,
            "displacement": measured.state[:n],
            "velocity": measured.state[n:],
            "deformation": measured.deformation,
            "rate": measured.rate,
            "force": measured.force,
            "acceleration": measured.acceleration,
            "ground_acceleration": measured.ground_acceleration[None],
            "ground_velocity": measured.ground_velocity[None],
            "drift": measured.drift[np.array(self.storeys, dtype=int)],
            "time": measured.time[None],
            "setting": jnp.concatenate([jnp.zeros(0), *(gains[name] for name in self.settings)]),
        }
        # Its numbers are computed again for a derivative in reverse mode: keeping each costs more than all of them.
        walk = jax.checkpoint(partial(walked, self.tape, inputs=self.inputs), prevent_cse=False)
        ends = walk({name: readings[name] for name, _ in self.inputs})
        return ends[memory.size :], ends[: memory.size]
