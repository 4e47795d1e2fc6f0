"""Periodic forces: between their samples, at random, and what a reference integration makes of them."""

from __future__ import annotations

from typing import Literal, get_args

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.interpolate import CubicSpline

from studies.former.arrays import Floats
from studies.leaderboard.benchmark_oscillator import Parameters

Interpolation = Literal["band-limited", "cubic", "linear"]
INTERPOLATIONS: tuple[Interpolation, ...] = get_args(Interpolation)


def between_samples(force: Floats, factor: int, interpolation: Interpolation) -> Floats:
    """A period, shape (n_time,), at `factor` points per sample, shape (factor n_time,)."""
    if interpolation == "band-limited":
        return factor * np.fft.irfft(np.fft.rfft(force), factor * force.size)
    samples = np.arange(force.size + 1)
    points = np.arange(factor * force.size) / factor
    closed = np.append(force, force[0])
    if interpolation == "cubic":
        return np.asarray(CubicSpline(samples, closed, bc_type="periodic")(points))
    return np.interp(points, samples, closed)


def stage_table(force: Floats, n_substeps: int, interpolation: Interpolation) -> Floats:
    """A period at the stages of every sub-step, shape (n_time, 2 n_substeps + 1)."""
    fine = between_samples(force, 2 * n_substeps, interpolation).reshape(force.size, -1)
    return np.concatenate([fine, np.roll(fine[:, :1], -1, axis=0)], axis=1)


def random_multisine(
    n_time: int, dt: float, *, band: tuple[float, float], rms: float, rng: np.random.Generator
) -> Floats:
    """A period of equal amplitudes and random phases on every line of a band [Hz], shape (n_time,)."""
    frequency = np.fft.rfftfreq(n_time, dt)
    excited = (frequency >= band[0]) & (frequency <= band[1])
    force = np.fft.irfft(excited * np.exp(2j * np.pi * rng.random(frequency.size)), n_time)
    return rms / np.std(force) * force


def newmark(p: Parameters, force: Floats, dt: float, *, factor: int = 20) -> Floats:
    """Displacement [m] over a steady period, at its samples, as the benchmark's authors integrate it.

    Newmark's constant average acceleration at `factor` steps per sample, the trapezoidal rule for z, Newton's method
    at every step. It shares no line with the model that is fitted.
    """
    fine = jnp.asarray(between_samples(force, factor, "band-limited"))
    half = fine.size // 2
    displacement = _newmark(p, jnp.concatenate([fine[-half:], fine]), dt / factor)[half:]
    return np.asarray(displacement[::factor])


@jax.jit
def _newmark(p: Parameters, force: Array, h: float) -> Array:
    def slope(v: Array, z: Array) -> Array:
        size = jnp.abs(z) ** p.nu
        return p.alpha * v - p.g * jnp.abs(v) * size * jnp.sign(z) - p.d * v * size

    def step(state: tuple[Array, ...], u: Array) -> tuple[tuple[Array, ...], Array]:
        y, v, a, z = state

        def balance(unknown: Array) -> Array:
            next_a, next_z = unknown
            next_v = v + 0.5 * h * (a + next_a)
            next_y = y + h * v + 0.25 * h**2 * (a + next_a)
            inertia = p.m * next_a + p.c * next_v + p.k * next_y + next_z - u
            return jnp.stack([inertia / p.m, next_z - z - 0.5 * h * (slope(v, z) + slope(next_v, next_z))])

        unknown = jnp.stack([a, z])
        for _ in range(4):
            J = jax.jacfwd(balance)(unknown)
            r = balance(unknown)
            determinant = J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]
            unknown -= (
                jnp.stack([J[1, 1] * r[0] - J[0, 1] * r[1], J[0, 0] * r[1] - J[1, 0] * r[0]]) / determinant
            )
        next_a, next_z = unknown
        next_v = v + 0.5 * h * (a + next_a)
        next_y = y + h * v + 0.25 * h**2 * (a + next_a)
        return (next_y, next_v, next_a, next_z), next_y

    rest = jnp.zeros(())
    first = (rest, rest, force[0] / p.m, rest)
    return jnp.concatenate([jnp.zeros(1), jax.lax.scan(step, first, force[1:])[1]])
