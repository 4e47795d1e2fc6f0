"""Batches of a damper of the user under a loading history, by JAX, with the stepping rule of the Rust core.

The sub-steps of a candidate follow from its relaxation, where the user gives one, or else from the spectral radius of
the rate in the states along its own motion: it is simulated again with more of them until they suffice. Batches and
records are padded to powers of two, so that few shapes are compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from mrwork import _rust
from mrwork.base.values import Floats
from mrwork.dampers.parameters import MOST_SUBSTEPS
from mrwork.dampers.spec import DamperSpec
from mrwork.store.long_call import interruptible
from mrwork.twins.models import on_processor, twin_of
from mrwork.twins.own_stepping import FINER, N_LEVELS, RESOLUTION, Rows, fastest, force_and_bound, whole_steps
from mrwork.twins.record_arrays import RecordArrays

T = TypeVar("T")
Counts = NDArray[np.uint32]

# Fewest rows of a batch, and samples of a record, that are compiled apart.
_FEWEST_ROWS, _FEWEST_SAMPLES = 8, 1024
# Candidates whose sub-steps are remembered.
_MOST_COUNTS = 2000
MOST_NUMBERS = 3e7
"""Most numbers of the states, forces and derivatives, or of the histories, of a call."""


@on_processor()
def stiffness(spec: DamperSpec, theta: Floats, history: _rust.LoadingHistory) -> Floats:
    """Sub-steps that each row of `theta`, (n_batch, n_params), wants, not rounded; infinite beyond the most."""
    wanted = _relaxation(spec, theta, history)
    return _resolved(spec, theta, history)[1] if wanted is None else wanted


@on_processor()
def forces(
    spec: DamperSpec, theta: Floats, history: _rust.LoadingHistory, factor: int
) -> tuple[Floats, Counts]:
    """Forces [N], shape (n_batch, n_time), and sub-steps of each row; 0 where it wants too many."""
    force, _, substeps = _resolved(spec, theta, history)
    if factor > 1:
        substeps = substeps * np.uint32(factor)
        for count, rows in _groups(substeps):
            force[rows] = _run(spec, theta[rows], history, count)[0]
    force[substeps == 0] = np.inf
    return force, substeps


@on_processor()
def sensitivities(
    spec: DamperSpec, theta: Floats, history: _rust.LoadingHistory, columns: Sequence[int] | None
) -> tuple[Floats, Floats, Counts]:
    """Forces and sub-steps as `forces`, and derivatives in columns of `theta`, (n_batch, n_columns, n_time)."""
    chosen = list(range(theta.shape[1])) if columns is None else list(columns)
    directions = np.eye(theta.shape[1])[chosen]
    # A candidate is mostly simulated alone before its derivatives are wanted.
    steps = [_last_counts(spec, history).get(row.tobytes()) for row in theta]
    substeps = _resolved(spec, theta, history)[2] if None in steps else np.array(steps, dtype=np.uint32)
    force = np.full((len(theta), history.n_time), np.inf)
    slopes = np.full((len(theta), len(chosen), history.n_time), np.inf)
    for count, rows in _groups(substeps):
        force[rows], slopes[rows] = _run(spec, theta[rows], history, count, directions)
    failed = ~(np.isfinite(force).all(axis=1) & np.isfinite(slopes).all(axis=(1, 2)))
    force[failed], slopes[failed] = np.inf, np.inf
    return force, slopes, substeps


def _resolved(
    spec: DamperSpec, theta: Floats, history: _rust.LoadingHistory
) -> tuple[Floats, Floats, Counts]:
    """Force of each row, sub-steps that it needs, and sub-steps that it gets: 0 where it needs too many."""
    force = np.full((len(theta), history.n_time), np.inf)
    relaxation = _relaxation(spec, theta, history)
    wanted = np.ones(len(theta)) if relaxation is None else relaxation
    substeps = whole_steps(wanted, MOST_SUBSTEPS).astype(np.uint32)
    open_rows = np.flatnonzero(substeps)
    while open_rows.size:
        again = []
        for count, places in _groups(substeps[open_rows]):
            rows = open_rows[places]
            force[rows], bound = _run(spec, theta[rows], history, count, bounded=relaxation is None)
            if relaxation is not None:
                continue
            finite = np.isfinite(force[rows]).all(axis=1)
            wants = np.where(finite, bound * history.dt / RESOLUTION, float(FINER * count))
            # NaN at rest stays NaN however fine the step.
            wants[~np.isfinite(force[rows, 0])] = count
            wants[~finite & (count >= MOST_SUBSTEPS)] = count
            wanted[rows] = wants
            finer = whole_steps(wants, MOST_SUBSTEPS)
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


def _groups(substeps: Counts) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Each number of sub-steps with its rows; rows without sub-steps are left out."""
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
    n_kept = power_of_two(history.n_time, _FEWEST_SAMPLES)
    record = _record(history, n_kept)
    row_size = n_kept * (spec.n_states + 2) * (1 if directions is None else 1 + len(directions))
    at_once = max(_FEWEST_ROWS, 1 << int(np.log2(max(MOST_NUMBERS / row_size, 1.0))))
    parts = []
    for start in range(0, len(theta), at_once):
        rows = theta[start : start + at_once]
        batch = Rows(_padded(rows), record, history.n_time, substeps)
        call: Callable[..., tuple[Array, Array]] = (
            partial(_forces, bounded=bounded)
            if directions is None
            else partial(_slopes, directions=directions)
        )
        result = computed(partial(call, batch, spec=spec, n_kept=n_kept))
        parts.append([np.asarray(array)[: len(rows)] for array in result])
    force, second = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return force[:, : history.n_time], second if directions is None else second[..., : history.n_time]


def _relaxation(spec: DamperSpec, theta: Floats, history: _rust.LoadingHistory) -> Floats | None:
    """Sub-steps that the relaxation of the user wants, (n_batch,); zero without states, `None` without a relaxation."""
    # Refuses equations that are not trusted, also where an equal damper was compiled while they were.
    relaxation = twin_of(spec).relaxation
    if not spec.n_states:
        return np.zeros(len(theta))
    if relaxation is None:
        return None
    record = _record(history, power_of_two(history.n_time, _FEWEST_SAMPLES))
    command = np.asarray(record.command)
    levels = np.linspace(command.min(), command.max(), N_LEVELS if len(command) > 1 else 1)
    batch = Rows(_padded(theta), record, history.n_time, 1)
    bound = np.asarray(computed(partial(_fastest, batch, levels, spec=spec)))
    return np.asarray(bound[: len(theta)] * history.dt / RESOLUTION)


def _padded(rows: Floats) -> Floats:
    """The rows, the last of them repeated up to a power of two."""
    padding = power_of_two(len(rows), _FEWEST_ROWS) - len(rows)
    return np.concatenate([rows, np.repeat(rows[-1:], padding, axis=0)])


def power_of_two(count: int, least: int) -> int:
    """The least power of two that is neither below `count` nor below `least`."""
    return 1 << (max(count, least) - 1).bit_length()


@lru_cache(maxsize=128)
def _record(history: _rust.LoadingHistory, n_kept: int) -> RecordArrays:
    return RecordArrays.of(history).padded(n_kept)


_forces = partial(jax.jit, static_argnames=("spec", "n_kept", "bounded"))(force_and_bound)
_fastest = partial(jax.jit, static_argnames="spec")(fastest)


@partial(jax.jit, static_argnames=("spec", "n_kept"))
def _slopes(rows: Rows, *, directions: Array, spec: DamperSpec, n_kept: int) -> tuple[Array, Array]:
    def force(theta: Array) -> Array:
        return force_and_bound(rows._replace(theta=theta), spec=spec, n_kept=n_kept, bounded=False)[0]

    def along(direction: Array) -> tuple[Array, Array]:
        return jax.jvp(force, (rows.theta,), (jnp.broadcast_to(direction, rows.theta.shape),))

    return jax.vmap(along, out_axes=(None, 1))(directions)


def computed(call: Callable[[], T]) -> T:
    """What XLA comes to, which is waited for where Ctrl-C is answered."""

    @on_processor()
    def ended() -> T:
        done: T = jax.block_until_ready(call())  # type: ignore[no-untyped-call] # jax leaves it unannotated
        return done

    return interruptible(ended)
