"""Twins by model: finding one, simulating it, and the cache of compiled functions."""

from __future__ import annotations

import os
import platform
from collections import namedtuple
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

from mrwork.dampers.parameters import CurrentLaws, interpolate, law_named
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import LibraryError, SettingError, UnknownNameError
from mrwork.twins.equations import EQUATIONS, Equation  # also sets double precision


@dataclass(frozen=True, slots=True, kw_only=True)
class Twin:
    """A damper model in JAX: its equations, functions of parameters, state (n_states,), displacement and velocity.

    `Theta` is the NamedTuple of the parameters in spec order, `rate` gives the time derivative of the states, shape
    (n_states,), and `force` the force [N].
    """

    Theta: Any
    rate: Equation
    force: Equation


@cache
def twin_of(spec: DamperSpec) -> Twin:
    """Return the twin of a model: its equations, with the parameters of the spec."""
    if spec.current is not None:
        return twin_of(damper(spec.name))
    if spec.name not in EQUATIONS:
        raise UnknownNameError(
            f"{spec.name} has no JAX twin; write its equations in mrwork/twins/equations.py"
        )
    rate, force = EQUATIONS[spec.name]
    return Twin(Theta=namedtuple("Theta", spec.names), rate=rate, force=force)


def parameters_at(spec: DamperSpec, theta: Array, received: Array) -> Any:
    """Parameters of the plain model, as `Theta` of the twin, for a command received by the coil; see `CurrentLaws`."""
    columns = iter(theta[index] for index in range(len(spec.parameters)))
    if spec.current is None:
        return twin_of(spec).Theta(*columns)
    values = []
    for parameter, law in zip(spec.plain, spec.current.laws, strict=True):
        kind = law_named(law)
        value, *further = islice(columns, kind.n_coefficients)
        if kind.nodes:
            at_nodes = jnp.stack([value, *further])
            log = parameter.scale == "log" and kind.takes_logarithms
            value = interpolate(kind.nodes, at_nodes, received, log=log, xp=jnp)
        elif kind.is_exponential:
            factor, exponent = further
            value = value + factor * jnp.exp(exponent * received)
        else:
            for power, coefficient in enumerate(further, start=1):
                value = value + coefficient * received**power
        values.append(jnp.clip(value, parameter.lower, parameter.upper) if further else value)
    return twin_of(spec).Theta(*values)


def simulate(
    spec: DamperSpec, theta: Array, stages: Array, dt: Array | float, command: Array | float = 0.0
) -> Array:
    """Simulate the force of a damper from rest, with the stepping rule of the Rust core.

    Parameters
    ----------
    theta
        Parameters in spec order, shape (n_params,).
    stages
        Displacement [m] and velocity [m/s] at the stage times, shape (n_time - 1, 2 substeps + 1, 2),
        from `_rust.LoadingHistory.stages`.
    dt
        Sampling step [s].
    command
        Command [A or V], one number, or shape (n_time,) with each sample held until the next. The lag starts settled.

    Returns
    -------
    Array
        Force [N], shape (n_time,).
    """
    twin = twin_of(spec)
    substeps = (stages.shape[1] - 1) // 2
    samples = jnp.concatenate([stages[:, 0, :], stages[-1:, -1, :]])
    command = jnp.asarray(command, dtype=jnp.float64)
    at_samples, at_steps = None, None
    if spec.current is not None and command.ndim > 0:
        at_samples, at_steps = _receive_command(spec.current, theta, command, dt, substeps)
    else:
        steady = parameters_at(spec, theta, command)

    def parameters(received: Array | None) -> Any:
        return steady if received is None else parameters_at(spec, theta, received)

    def force(state: Array, motion: Array, received: Array | None) -> Array:
        return twin.force(parameters(received), state, motion[0], motion[1])

    if spec.n_states == 0:
        return jax.vmap(force)(jnp.zeros((len(samples), 0)), samples, at_samples)
    h = dt / substeps

    def substep(state: Array, motions: Array, received: Array | None) -> Array:
        start, middle, end = (parameters(None if received is None else received[stage]) for stage in range(3))
        first = twin.rate(start, state, motions[0, 0], motions[0, 1])
        second = twin.rate(middle, state + 0.5 * h * first, motions[1, 0], motions[1, 1])
        third = twin.rate(middle, state + 0.5 * h * second, motions[1, 0], motions[1, 1])
        fourth = twin.rate(end, state + h * third, motions[2, 0], motions[2, 1])
        return state + h / 6.0 * (first + 2.0 * (second + third) + fourth)

    def record(state: Array, step: tuple[Array, Array | None]) -> tuple[Array, Array]:
        return substep(state, *step), state

    # One scan over all sub-steps, with motion and received command at start, middle and end of each.
    motions = jnp.stack([stages[:, :-1:2], stages[:, 1::2], stages[:, 2::2]], axis=2)
    last, states = jax.lax.scan(record, jnp.zeros(spec.n_states), (motions.reshape(-1, 3, 2), at_steps))
    states = jnp.concatenate([states[::substeps], last[None]])
    return jax.vmap(force)(states, samples, at_samples)


def _receive_command(
    current: CurrentLaws, theta: Array, command: Array, dt: Array | float, substeps: int
) -> tuple[Array, Array]:
    """Command received by the coil at the samples, shape (n_time,), and at three points of each step, (n_steps, 3)."""
    if not current.lagged:
        return command, jnp.repeat(command[:-1], 3 * substeps).reshape(-1, 3)
    left = jnp.exp(-theta[-1] * dt / (2 * substeps) * jnp.arange(2 * substeps + 1))

    def interval(received: Array, held: Array) -> tuple[Array, Array]:
        inside = held + (received - held) * left
        return inside[-1], inside

    last, inside = jax.lax.scan(interval, command[0], command[:-1])
    steps = jnp.stack([inside[:, :-1:2], inside[:, 1::2], inside[:, 2::2]], axis=2)
    return jnp.append(inside[:, 0], last), steps.reshape(-1, 3)


# Environment variable; "off" disables the cache.
_SWITCH = "MRWORK_COMPILATION_CACHE"
# Shortest compilation time of a cached function [s].
_WORTH_KEEPING = 0.1
# The process that has used JAX: this one, or the one that it was forked from.
_process: int | None = None


def begin() -> None:
    """Prepare JAX in this process: called before every computation on a twin."""
    global _process  # one JAX for each process
    if _process is None:
        try:
            jax.devices()
        except RuntimeError as error:
            reason = str(error).partition("\n")[0]
            raise LibraryError(
                f"JAX does not start on this machine ({reason}); unset JAX_PLATFORMS, or set it to cpu"
            ) from None
        _process = os.getpid()
        keep_compiled()
    elif _process != os.getpid():
        raise SettingError(
            "this process was forked from one that has used JAX, where no computation with JAX can end; start "
            'processes by multiprocessing.get_context("spawn")'
        )


@cache
def keep_compiled() -> None:
    """Enable the compilation cache of JAX in the cache folder of the user, $XDG_CACHE_HOME or ~/.cache.

    A cache folder already configured in JAX, also by JAX_COMPILATION_CACHE_DIR, is not changed by the switch.
    If the folder is not writable, there is no cache.
    """
    if jax.config.values["jax_compilation_cache_dir"] is not None:
        return
    if os.environ.get(_SWITCH) == "off":
        return
    folder = _folder()
    if folder is None:
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))  # type: ignore[no-untyped-call] # as above
    if "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS" not in os.environ:
        jax.config.update("jax_persistent_cache_min_compile_time_secs", _WORTH_KEEPING)  # type: ignore[no-untyped-call] # as above


def _folder() -> Path | None:
    try:
        above = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        # Machines that share a home folder may have different processors, and compiled functions need not run on both.
        folder = above / "mrwork" / "twins" / (platform.node() or "here")
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # nowhere to write, or no home
        return None
    return folder if os.access(folder, os.W_OK) else None
