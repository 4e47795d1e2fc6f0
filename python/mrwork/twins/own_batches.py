"""Batches of a damper of the user under a loading history, by JAX, with the stepping rule of the Rust core.

The sub-steps of a candidate follow from its relaxation, where the user gives one, or else from the spectral radius of
the rate in the states along its own motion: it is simulated again with more of them until they suffice. Motions,
batches and records are padded to powers of two, and sub-steps are counted at run time, so that few shapes are compiled.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple, TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

from mrwork import _rust
from mrwork.base.values import Floats
from mrwork.dampers.spec import DamperSpec
from mrwork.twins.models import begin, parameters_at, twin_of

T = TypeVar("T")
Counts = NDArray[np.uint32]

# Largest product of a step and the fastest relaxation, as RESOLUTION of `integrate.rs`.
RESOLUTION = 1.4
# Commands at which a relaxation is asked for, as COMMAND_LEVELS of `loading.rs`.
_LEVELS = 9
# The spectral radius is at most ||J^8||^(1/8), which units of the states hardly change.
_SQUARINGS = 3
# A run that is not finite is tried again with so many times the sub-steps.
FINER = 4
# Fewest rows of a batch, and samples of a record, that are compiled apart.
_FEWEST_ROWS, _FEWEST_SAMPLES = 8, 1024
# Candidates whose sub-steps are remembered.
_MOST_COUNTS = 2000
# Most numbers of the states, forces and derivatives of a call.
_MOST_NUMBERS = 3e7


def stiffness(spec: DamperSpec, theta: Floats, history: _rust.LoadingHistory, *, most: int) -> Floats:
    """Sub-steps that each row of `theta`, shape (n_batch, n_params), wants, not rounded; infinite beyond `most`."""
    if twin_of(spec).relaxation is not None or not spec.n_states:
        return _relaxation(spec, theta, history)
    _, wanted, _ = _resolved(spec, theta, history, most)
    return wanted


def forces(
    spec: DamperSpec, theta: Floats, history: _rust.LoadingHistory, factor: int, *, most: int
) -> tuple[Floats, Counts]:
    """Forces [N], shape (n_batch, n_time), and sub-steps of each row; 0 where it wants more than `most`."""
    force, _, substeps = _resolved(spec, theta, history, most)
    if factor > 1:
        substeps = substeps * np.uint32(factor)
        for count, rows in _groups(substeps):
            force[rows] = _run(spec, theta[rows], history, count)[0]
    force[substeps == 0] = np.inf
    return force, substeps


def sensitivities(
    spec: DamperSpec,
    theta: Floats,
    history: _rust.LoadingHistory,
    columns: Sequence[int] | None,
    factor: int,
    *,
    most: int,
) -> tuple[Floats, Floats, Counts]:
    """Forces and sub-steps as `forces`, and derivatives in columns of `theta`, (n_batch, n_columns, n_time)."""
    chosen = list(range(theta.shape[1])) if columns is None else list(columns)
    directions = np.eye(theta.shape[1])[chosen]
    # A candidate is mostly simulated alone before its derivatives are wanted.
    known = [_last_counts(spec, history).get(row.tobytes()) for row in theta]
    substeps = _resolved(spec, theta, history, most)[2] if None in known else np.array(known, dtype=np.uint32)
    substeps = substeps * np.uint32(factor)
    force = np.full((len(theta), history.n_time), np.inf)
    slopes = np.full((len(theta), len(chosen), history.n_time), np.inf)
    for count, rows in _groups(substeps):
        force[rows], slopes[rows] = _run(spec, theta[rows], history, count, directions)
    failed = ~(np.isfinite(force).all(axis=1) & np.isfinite(slopes).all(axis=(1, 2)))
    force[failed], slopes[failed] = np.inf, np.inf
    return force, slopes, substeps


def _resolved(
    spec: DamperSpec, theta: Floats, history: _rust.LoadingHistory, most: int
) -> tuple[Floats, Floats, Counts]:
    """Force of each row, what it wants, and its sub-steps; rows that want more than `most` have none."""
    force = np.full((len(theta), history.n_time), np.inf)
    given = twin_of(spec).relaxation is not None or not spec.n_states
    wanted = _relaxation(spec, theta, history) if given else np.ones(len(theta))
    substeps = _counts(wanted, most)
    open_rows = np.flatnonzero(substeps)
    while open_rows.size:
        again = []
        for count, places in _groups(substeps[open_rows]):
            rows = open_rows[places]
            force[rows], bound = _run(spec, theta[rows], history, count, bounded=not given)
            if given:
                continue
            finite = np.isfinite(force[rows]).all(axis=1)
            wants = np.where(finite, bound * history.dt / RESOLUTION, float(FINER * count))
            # What is not a number at rest is none with any step.
            wants[~np.isfinite(force[rows, 0])] = count
            wants[~finite & (count >= most)] = count
            wanted[rows] = wants
            finer = _counts(wants, most)
            more = finer > count
            substeps[rows[more | (finer == 0)]] = finer[more | (finer == 0)]
            again.append(rows[more])
        open_rows = np.concatenate([np.empty(0, dtype=np.intp), *again])
    wanted[substeps == 0] = np.inf
    force[substeps == 0] = np.inf
    counts = _last_counts(spec, history)
    if len(counts) > _MOST_COUNTS:
        counts.clear()
    counts.update((row.tobytes(), int(count)) for row, count in zip(theta, substeps, strict=True))
    return force, wanted, substeps


@lru_cache(maxsize=64)
def _last_counts(spec: DamperSpec, history: _rust.LoadingHistory) -> dict[bytes, int]:
    """Sub-steps of candidates that were simulated lately, by their bytes."""
    return {}


def _counts(wanted: Floats, most: int) -> Counts:
    """The power of two that is at least what is wanted; 0 beyond `most`, and where it is not a number."""
    with np.errstate(invalid="ignore", divide="ignore"):
        counts = np.exp2(np.ceil(np.log2(np.maximum(wanted, 1.0))))
        return np.where(counts <= most, counts, 0.0).astype(np.uint32)


def _groups(substeps: Counts) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Each number of sub-steps, and the rows that have it; those without any are left out."""
    for count in np.unique(substeps[substeps > 0]):
        yield int(count), np.flatnonzero(substeps == count)


def _run(
    spec: DamperSpec,
    theta: Floats,
    history: _rust.LoadingHistory,
    substeps: int,
    directions: Floats | None = None,
    *,
    bounded: bool = False,
) -> tuple[Floats, Floats]:
    """Forces of rows, and their derivatives in these directions, or the bound of each row [1/s], zero if not wanted."""
    begin()
    motions, command = _motions(history, substeps)
    n_kept = power_of_two(history.n_time, _FEWEST_SAMPLES)
    each = n_kept * (spec.n_states + 2) * (1 if directions is None else 1 + len(directions))
    at_once = max(_FEWEST_ROWS, 1 << int(np.log2(max(_MOST_NUMBERS / each, 1.0))))
    parts = []
    for start in range(0, len(theta), at_once):
        rows = theta[start : start + at_once]
        padding = power_of_two(len(rows), _FEWEST_ROWS) - len(rows)
        padded = np.concatenate([rows, np.repeat(rows[-1:], padding, axis=0)])
        given = _Rows(padded, motions, command, history.dt, history.n_time, substeps)
        call: Callable[..., tuple[Array, Array]] = (
            partial(_forces, bounded=bounded)
            if directions is None
            else partial(_slopes, directions=directions)
        )
        result = interruptible(partial(call, given, spec=spec, n_kept=n_kept))
        parts.append([np.asarray(each)[: len(rows)] for each in result])
    force, second = (np.concatenate(each) for each in zip(*parts, strict=True))
    return force[:, : history.n_time], second if directions is None else second[..., : history.n_time]


def _relaxation(spec: DamperSpec, theta: Floats, history: _rust.LoadingHistory) -> Floats:
    """Sub-steps that the relaxation of the user wants, shape (n_batch,); zero for a damper without states."""
    if not spec.n_states:
        return np.zeros(len(theta))
    begin()
    motions, command = _motions(history, 1)
    padding = power_of_two(len(theta), _FEWEST_ROWS) - len(theta)
    padded = np.concatenate([theta, np.repeat(theta[-1:], padding, axis=0)])
    levels = np.linspace(command.min(), command.max(), _LEVELS if len(command) > 1 else 1)
    bound = np.asarray(interruptible(partial(_fastest, padded, motions, levels, spec=spec)))
    return np.asarray(bound[: len(theta)] * history.dt / RESOLUTION)


def power_of_two(count: int, least: int) -> int:
    """The power of two that is at least a count and at least the `least`."""
    return 1 << (max(count, least) - 1).bit_length()


@lru_cache(maxsize=128)
def _motions(history: _rust.LoadingHistory, substeps: int) -> tuple[Array, Floats]:
    """Displacement and velocity every half step, (n_half, 2), and the command at samples, both padded; NaN if none.

    Motions are padded to powers of four, as fine ones cost nothing but their place.
    """
    stages = history.stages(substeps)
    motions = np.concatenate([stages[:, :-1].reshape(-1, 2), stages[-1:, -1]])
    missing = 4 ** math.ceil(math.log(max(len(motions), 4 * _FEWEST_SAMPLES), 4)) - len(motions)
    motions = np.concatenate([motions, np.repeat(motions[-1:], missing, axis=0)])
    command = history.command
    if command is None or np.ptp(command) == 0.0:
        return jnp.asarray(motions), np.full(1, np.nan if command is None else command[0])
    missing = power_of_two(len(command), _FEWEST_SAMPLES) - len(command)
    return jnp.asarray(motions), np.concatenate([command, np.repeat(command[-1:], missing)])


@partial(jax.jit, static_argnames="spec")
def _fastest(theta: Array, motions: Array, levels: Array, *, spec: DamperSpec) -> Array:
    relaxation = twin_of(spec).relaxation
    assert relaxation is not None

    def at_level(row: Array, level: Array) -> Array:
        p = parameters_at(spec, row, level)
        return jnp.max(jax.vmap(lambda motion: relaxation(p, motion[0], motion[1]))(motions))

    return jnp.max(jax.vmap(jax.vmap(at_level, in_axes=(None, 0)), in_axes=(0, None))(theta, levels), axis=1)


class _Rows(NamedTuple):
    """Candidates, (n_batch, n_params), and what they are simulated under; arrays of NumPy or JAX."""

    theta: Any
    motions: Any
    command: Any
    dt: Any
    n_time: Any
    substeps: Any


def _kept(rows: _Rows, *, spec: DamperSpec, n_kept: int) -> tuple[Array, Array | None]:
    """States at the samples, (n_kept, n_batch, n_states), and what the coils receive, (n_kept, n_batch) or `None`."""
    theta, motions, command, dt, n_time, substeps = rows
    n_batch = len(theta)
    varies = len(command) > 1
    lagged = varies and spec.current is not None and spec.current.lagged
    if not (spec.n_states or lagged):
        received = jnp.broadcast_to(command[:, None], (n_kept, n_batch)) if varies else None
        return jnp.zeros((n_kept, n_batch, 0)), received
    h = dt / substeps
    rate = jax.vmap(twin_of(spec).rate, in_axes=(0, 0, None, None))
    steady = None if varies else _parameters(spec, theta, jnp.broadcast_to(command, (n_batch,)))

    def interval(k: Array, carry: tuple[Array, ...]) -> tuple[Array, ...]:
        state, at_coil, states, received = carry
        states, received = states.at[k].set(state), received.at[k].set(at_coil) if varies else received
        held = command[k] if varies else command[0]

        def at(time: Array) -> Any:
            if steady is not None:
                return steady
            left = jnp.exp(-theta[:, -1] * time) if lagged else 0.0
            return _parameters(spec, theta, held + (at_coil - held) * left)

        def substep(j: Any, state: Array) -> Any:
            place = 2 * (k * substeps + j)
            (x0, v0), (x1, v1), (x2, v2) = motions[place], motions[place + 1], motions[place + 2]
            middle = at((j + 0.5) * h)
            first = rate(at(j * h), state, x0, v0)
            second = rate(middle, state + 0.5 * h * first, x1, v1)
            third = rate(middle, state + 0.5 * h * second, x1, v1)
            fourth = rate(at((j + 1.0) * h), state + h * third, x2, v2)
            return state + h / 6.0 * (first + 2.0 * (second + third) + fourth)

        if spec.n_states:
            state = lax.fori_loop(0, substeps, substep, state)
        left = jnp.exp(-theta[:, -1] * dt) if lagged else 0.0
        # Without a lag the coil has the command at once, also that of the next sample.
        after = (
            held + (at_coil - held) * left
            if lagged
            else jnp.broadcast_to(command[k + 1] if varies else held, (n_batch,))
        )
        return state, after, states, received

    start = (
        jnp.zeros((n_batch, spec.n_states)),
        jnp.broadcast_to(command[0], (n_batch,)),
        jnp.zeros((n_kept, n_batch, spec.n_states)),
        jnp.zeros((n_kept if varies else 0, n_batch)),
    )
    state, at_coil, states, received = lax.fori_loop(0, n_time - 1, interval, start)
    states = states.at[n_time - 1].set(state)
    return states, received.at[n_time - 1].set(at_coil) if varies else None


def _parameters(spec: DamperSpec, theta: Array, received: Array) -> Any:
    return jax.vmap(partial(parameters_at, spec))(theta, received)


def radius_of(rate: Callable[..., Array], p: Any, state: Array, x: Array, v: Array) -> Array:
    """Bound of the spectral radius of the rate in the states [1/s]."""
    slope = jax.jacfwd(lambda state: rate(p, state, x, v))(state)
    if len(state) == 1:
        return jnp.abs(slope[0, 0])
    # So that powers do not overflow.
    size = jnp.max(jnp.abs(slope)) + 1e-300
    power = slope / size
    for _ in range(_SQUARINGS):
        power = power @ power
    largest: Array = size * jnp.linalg.norm(power) ** (0.5**_SQUARINGS)
    return largest


def _force_and_bound(rows: _Rows, *, spec: DamperSpec, n_kept: int, bounded: bool) -> tuple[Array, Array]:
    twin, theta, motions = twin_of(spec), rows.theta, rows.motions
    states, received = _kept(rows, spec=spec, n_kept=n_kept)
    samples = motions[jnp.minimum(2 * rows.substeps * jnp.arange(n_kept), len(motions) - 1)]
    steady = (
        _parameters(spec, theta, jnp.broadcast_to(rows.command[0], (len(theta),)))
        if received is None
        else None
    )

    def everywhere(equation: Callable[..., Array]) -> Array:
        """An equation at all samples of all rows, shape (n_kept, n_batch)."""
        of_rows = jax.vmap(equation, in_axes=(0, 0, None, None))

        def at_sample(state: Array, motion: Array, at_coil: Array | None) -> Array:
            p = steady if at_coil is None else _parameters(spec, theta, at_coil)
            return of_rows(p, state, motion[0], motion[1])

        result: Array = jax.vmap(at_sample)(states, samples, received)
        return result

    force = everywhere(twin.force).T
    if not bounded:
        return force, jnp.zeros(len(theta))

    counted = jnp.arange(n_kept)[:, None] < rows.n_time
    return force, jnp.max(jnp.where(counted, everywhere(partial(radius_of, twin.rate)), 0.0), axis=0)


_forces = partial(jax.jit, static_argnames=("spec", "n_kept", "bounded"))(_force_and_bound)


@partial(jax.jit, static_argnames=("spec", "n_kept"))
def _slopes(rows: _Rows, *, directions: Array, spec: DamperSpec, n_kept: int) -> tuple[Array, Array]:
    def force(theta: Array) -> Array:
        return _force_and_bound(rows._replace(theta=theta), spec=spec, n_kept=n_kept, bounded=False)[0]

    def along(direction: Array) -> tuple[Array, Array]:
        return jax.jvp(force, (rows.theta,), (jnp.broadcast_to(direction, rows.theta.shape),))

    return jax.vmap(along, out_axes=(None, 1))(directions)


def interruptible(call: Callable[[], T]) -> T:
    """Do what cannot be interrupted on another thread, so that the main one answers Ctrl-C at once."""
    if threading.current_thread() is not threading.main_thread():
        return call()
    ended: list[tuple[T | None, BaseException | None]] = []

    def end() -> None:
        try:
            # What is still computed by XLA would be waited for elsewhere.
            done: T = jax.block_until_ready(call())  # type: ignore[no-untyped-call] # jax leaves it unannotated
            ended.append((done, None))
        except BaseException as error:
            ended.append((None, error))

    thread = threading.Thread(target=end, daemon=True)
    thread.start()
    thread.join()
    result, error = ended[0]
    if error is not None:
        raise error
    return cast("T", result)
