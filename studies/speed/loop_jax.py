"""The loop in jax: one run as a `lax.scan` over its steps, `vmap` over candidates and motions, jitted, in float64.

Written for XLA's processor backend: floors are scalars, which `vmap` makes arrays (vectors of five and the building's
matrices take five times as long), and candidates are innermost (with motions innermost, three times). Varied: the
vector width XLA aims at, the scan's unrolling, and how many candidates go side by side before the next follow. The
candidates are split over one XLA device per core.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from studies.former.arrays import Floats
from studies.speed.jax_peer import JaxVariant, compiled_run
from studies.speed.loop_workload import (
    LAG,
    LARGEST_COMMAND,
    N_STOREYS,
    STEP,
    LoopWorkload,
    averaged,
    chain_springs,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopJaxVariant:
    """One way to lay out and compile the loop; 0 leaves the width to XLA, or takes all candidates at once."""

    vector_bits: int = 0
    unroll: int = 1
    side_by_side: int = 0

    def describe(self) -> str:
        """In a few words, for the table."""
        width = f", {self.vector_bits}-bit vectors" if self.vector_bits else ""
        group = f", {self.side_by_side} candidates at once" if self.side_by_side else ""
        return f"vmap(scan), candidates innermost, unroll {self.unroll}{width}{group}"


VARIANTS = (
    LoopJaxVariant(),
    LoopJaxVariant(vector_bits=512),
    LoopJaxVariant(vector_bits=512, unroll=2),
    LoopJaxVariant(vector_bits=512, side_by_side=250),
)

Floor = list[Array]
_DECAY = math.exp(-0.5 * LAG * STEP)
_FLOORS = range(N_STOREYS)


def prepare(workload: LoopWorkload, variant: LoopJaxVariant) -> Callable[[], Floats]:
    """Compile `variant` for the workload's shapes; the call returns (n_motions, n_candidates, N_REDUCTIONS)."""
    one = _one_run(workload, variant.unroll)
    every = jax.vmap(jax.vmap(one, in_axes=(0, None)), in_axes=(None, 0))

    def all_runs(gains: Array, ground: Array) -> Array:
        group = variant.side_by_side
        if not group or len(gains) % group:
            return jnp.swapaxes(every(gains, ground), 0, 1)
        grouped = lax.map(lambda some: every(some, ground), gains.reshape(-1, group, gains.shape[1]))
        return jnp.swapaxes(grouped, 1, 2).reshape(len(gains), len(ground), -1)

    run = compiled_run(JaxVariant(vector_bits=variant.vector_bits), all_runs, workload.gains, workload.ground)
    return lambda: averaged(np.swapaxes(np.asarray(run()), 0, 1), workload.n_steps)


def _one_run(workload: LoopWorkload, unroll: int) -> Callable[[Array, Array], Array]:
    mass = workload.mass.tolist()
    k = (workload.stiffness / workload.mass[:, None]).tolist()
    c = (workload.damping / workload.mass[:, None]).tolist()
    springs = chain_springs(workload.stiffness).tolist()
    total_mass = float(workload.mass.sum())
    damper = workload.device.tolist()
    h, half, sixth = STEP, 0.5 * STEP, STEP / 6.0

    def pair(x: Array, v: Array, i: Array) -> Array:
        """f(x, v) - f(-x, -v) at the coil's current: twice what is odd of the model, that is all but f0."""
        c0, k0 = damper[0] + damper[1] * i, damper[2] + damper[3] * i
        alpha = damper[4] + (damper[5] + damper[6] * i) * i
        delta = damper[8] + damper[9] * i
        side = jnp.tanh(x * (1.0 / damper[10]))
        force: Array = 2.0 * (c0 * v + k0 * x + alpha * jnp.tanh(damper[7] * v + delta * side))
        return force

    def row(matrix: list[list[float]], i: int, x: Floor) -> Array:
        return _sum([matrix[i][j] * x[j] for j in range(max(0, i - 1), min(N_STOREYS, i + 2))])

    def stage(q: Floor, v: Floor, f: Array, a_g: Array) -> tuple[Floor, Array, Array, Array]:
        """Accelerations relative to the ground; power of the ground, of the structure's damping, of the device."""
        d = [row(c, i, v) for i in _FLOORS]
        a = [-(d[i] + row(k, i, q) + a_g) for i in _FLOORS]
        a[0] = a[0] - f * (1.0 / mass[0])
        p = [mass[i] * v[i] for i in _FLOORS]
        return a, -a_g * _sum(p), _sum([p[i] * d[i] for i in _FLOORS]), f * v[0]

    def run(gain: Array, ground: Array) -> Array:
        def step(carry: tuple[Floor, ...], a_g: Array) -> tuple[tuple[Floor, ...], None]:
            q, v, (i0, currents, current_squares), peaks, squares, energies = carry
            f1 = pair(q[0], v[0], i0)
            wanted = -_sum([gain[i] * (q + v)[i] for i in range(2 * N_STOREYS)])
            command = jnp.where((wanted - f1) * f1 > 0.0, LARGEST_COMMAND, 0.0)
            i1 = (i0 - command) * _DECAY + command
            i2 = (i1 - command) * _DECAY + command
            a1, *first = stage(q, v, f1, a_g[0])
            shear = total_mass * a_g[0] + _sum([mass[i] * a1[i] for i in _FLOORS])
            seen = [*q, *(a1[i] + a_g[0] for i in _FLOORS), *_drift(q), shear, f1]
            squares = [total + value * value for total, value in zip(squares, seen, strict=True)]
            seen += [q[0], v[0], i0]
            peaks = [jnp.maximum(peak, jnp.abs(value)) for peak, value in zip(peaks, seen, strict=True)]
            q2, v2 = _along(q, half, v), _along(v, half, a1)
            a2, *second = stage(q2, v2, pair(q2[0], v2[0], i1), a_g[1])
            q3, v3 = _along(q, half, v2), _along(v, half, a2)
            a3, *third = stage(q3, v3, pair(q3[0], v3[0], i1), a_g[1])
            q4, v4 = _along(q, h, v3), _along(v, h, a3)
            a4, *fourth = stage(q4, v4, pair(q4[0], v4[0], i2), a_g[2])
            q = [q[i] + sixth * (v[i] + 2.0 * v2[i] + 2.0 * v3[i] + v4[i]) for i in _FLOORS]
            v = [v[i] + sixth * (a1[i] + 2.0 * a2[i] + 2.0 * a3[i] + a4[i]) for i in _FLOORS]
            powers = zip(energies, first, second, third, fourth, strict=True)
            energies = [e + sixth * (p1 + 2.0 * p2 + 2.0 * p3 + p4) for e, p1, p2, p3, p4 in powers]
            coil = [i2, currents + i0, current_squares + i0 * i0]
            return (q, v, coil, peaks, squares, energies), None

        start = tuple([jnp.float64(0.0)] * n for n in (N_STOREYS, N_STOREYS, 3, 20, 17, 3))
        (q, v, coil, peaks, squares, energies), _ = lax.scan(step, start, ground, unroll=unroll)
        kinetic = 0.5 * _sum([mass[i] * v[i] ** 2 for i in _FLOORS])
        strain = 0.5 * _sum([spring * drift**2 for spring, drift in zip(springs, _drift(q), strict=True)])
        floors = [column for i in (0, 5, 10) for column in (*peaks[i : i + 5], *squares[i : i + 5])]
        device = [peaks[15], squares[15], peaks[16], squares[16], *peaks[17:], *coil[1:]]
        entered, lost, taken = energies
        return jnp.stack([*floors, *device, taken, entered, kinetic, strain, lost])

    return run


def _sum(terms: list[Array]) -> Array:
    return sum(terms[1:], start=terms[0])


def _drift(q: Floor) -> Floor:
    return [q[0], *(q[i] - q[i - 1] for i in _FLOORS[1:])]


def _along(x: Floor, step: float, rate: Floor) -> Floor:
    return [x[i] + step * rate[i] for i in _FLOORS]
