"""The hysteretic oscillator of the benchmark, run freely in JAX and fitted to displacement from force.

    m y'' + c y' + k y + z = u,   z' = alpha y' - g |y'| |z|^(nu-1) z - d y' |z|^nu

With the benchmark's beta, gamma, delta: g = beta gamma and d = beta delta, all that data can settle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax import Array

from mrwork.twins import power
from studies.former.arrays import Floats


class Parameters(NamedTuple):
    """m [kg], c [N s/m], k and alpha [N/m], g and d [m^-1 N^(1-nu)], nu."""

    m: float
    c: float
    k: float
    alpha: float
    g: float
    d: float
    nu: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Scales:
    """Sizes that make the unknowns of a fit comparable, from the linear fit: of force [N] and displacement [m].

    g and d are fitted times z_ref^(nu-1), so that nu can move without either.
    """

    linear: tuple[float, float, float]
    displacement: float

    @property
    def hysteretic(self) -> float:
        """Size of z [N]."""
        return self.linear[2] * self.displacement

    def parameters(self, unknowns: Array) -> Parameters:
        """From dimensionless unknowns, shape (7,): m, c, k, alpha, g, d over their scales, and nu."""
        m, c, K = self.linear
        rounding = self.hysteretic ** (1.0 - unknowns[6]) / self.displacement
        sizes = jnp.stack([*map(jnp.asarray, (m, c, K, K)), rounding, rounding, jnp.asarray(1.0)])
        return Parameters(*(sizes * unknowns))


class Period(NamedTuple):
    """One steady period: force [N] at the stages, shape (n_time, 2 n_substeps + 1), displacement [m], shape (n_time,).

    `noise` is the standard deviation [m] of the displacement, `dt` the sampling step [s].
    """

    stages: Array
    displacement: Array
    noise: float
    dt: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Minimum:
    """Where a descent ended: unknowns, shape (7,), and root mean square of the residuals over the noise."""

    unknowns: Array
    misfit: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """Parameters with their standard errors, which hold where the noise is white."""

    parameters: Parameters
    standard_errors: Parameters
    minimum: Minimum


@jax.jit
def free_run(p: Parameters, stages: Array, dt: float) -> Array:
    """Displacement [m] from rest at every sample, shape (n_time,), by classical Runge-Kutta.

    Parameters
    ----------
    stages
        Force [N] at the start, middle and end of every sub-step, shape (n_time, 2 n_substeps + 1).
    dt
        Sampling step [s].
    """
    n_substeps = (stages.shape[1] - 1) // 2
    h = dt / n_substeps

    def rate(state: Array, u: Array) -> Array:
        y, v, z = state
        curve = power(jnp.abs(z), p.nu)
        hysteretic = p.alpha * v - curve * (p.g * jnp.abs(v) * jnp.sign(z) + p.d * v)
        return jnp.stack([v, (u - p.c * v - p.k * y - z) / p.m, hysteretic])

    def substep(state: Array, u: Array) -> tuple[Array, Array]:
        first = rate(state, u[0])
        second = rate(state + 0.5 * h * first, u[1])
        third = rate(state + 0.5 * h * second, u[1])
        fourth = rate(state + h * third, u[2])
        return state + h / 6.0 * (first + 2.0 * (second + third) + fourth), state[0]

    triples = jnp.stack([stages[:, :-1:2], stages[:, 1::2], stages[:, 2::2]], axis=2).reshape(-1, 3)
    return jax.lax.scan(substep, jnp.zeros(3), triples)[1][::n_substeps]


def steady_period(p: Parameters, stages: Array, dt: float) -> Array:
    """Displacement [m] over a period of a periodic force whose stages are given, after half a period from rest."""
    half = stages.shape[0] // 2
    return free_run(p, jnp.concatenate([stages[-half:], stages]), dt)[half:]


def linear_fit(force: Floats, displacement: Floats, dt: float) -> tuple[float, float, float]:
    """Mass, damping and stiffness of the linear oscillator nearest to a steady period, over the excited lines."""
    omega = 2.0 * np.pi * np.fft.rfftfreq(force.size, dt)
    U, Y = np.fft.rfft(force), np.fft.rfft(displacement)
    lines = np.abs(U) > 1e-3 * np.abs(U).max()
    columns = np.stack([-(omega**2), 1j * omega, np.ones_like(omega)], axis=1)[lines] * Y[lines, None]
    both = np.concatenate([columns.real, columns.imag])
    m, c, K = np.linalg.lstsq(both, np.concatenate([U[lines].real, U[lines].imag]))[0]
    return float(m), float(c), float(K)


def screened_minima(
    period: Period, scales: Scales, *, rng: np.random.Generator, n_screened: int = 64, n_descents: int = 3
) -> tuple[Minimum, ...]:
    """Least-squares minima of the free run from random starts, lowest misfit first.

    The linear part starts at the linear fit. The hysteretic share of the stiffness and the shape are drawn at random,
    and a descent begins at the draws with the smallest misfits.
    """
    share = rng.uniform(0.1, 0.9, n_screened)
    starts = jnp.stack(
        [
            jnp.ones(n_screened),
            jnp.ones(n_screened),
            1.0 - share,
            share,
            rng.uniform(0.0, 2.0, n_screened),
            rng.uniform(-2.0, 2.0, n_screened),
            rng.uniform(1.0, 2.0, n_screened),
        ],
        axis=1,
    )
    misfits = jax.jit(jax.vmap(partial(_misfit, scales), in_axes=(0, None)))(starts, period)
    order = jnp.argsort(jnp.where(jnp.isfinite(misfits), misfits, jnp.inf))
    minima = [descend(period, scales, starts[index]) for index in order[:n_descents]]
    return tuple(sorted(minima, key=lambda minimum: minimum.misfit))


def descend(period: Period, scales: Scales, start: Array) -> Minimum:
    """The minimum that Levenberg and Marquardt's method reaches from `start`, shape (7,)."""
    solution = optx.least_squares(
        _residuals(scales),
        optx.LevenbergMarquardt(rtol=1e-6, atol=1e-6),
        start,
        args=period,
        options={"jac": "fwd"},
        max_steps=100,
    )
    return Minimum(unknowns=solution.value, misfit=float(_misfit(scales, solution.value, period)))


def fitted(period: Period, scales: Scales, minimum: Minimum) -> Fitted:
    """Parameters of a minimum and their standard errors."""
    slope = np.asarray(jax.jit(jax.jacfwd(_residuals(scales)))(minimum.unknowns, period))
    to_physical = np.stack([np.asarray(row) for row in jax.jacfwd(scales.parameters)(minimum.unknowns)])
    covariance = to_physical @ np.linalg.inv(slope.T @ slope) @ to_physical.T
    return Fitted(
        parameters=Parameters(*map(float, scales.parameters(minimum.unknowns))),
        standard_errors=Parameters(*map(float, np.sqrt(np.diag(covariance)))),
        minimum=minimum,
    )


@cache
def _residuals(scales: Scales) -> Callable[[Array, Period], Array]:
    """The residuals over the noise; one function per scales, so that JAX compiles it once."""

    @jax.jit
    def residuals(unknowns: Array, period: Period) -> Array:
        free = steady_period(scales.parameters(unknowns), period.stages, period.dt)
        return (free - period.displacement) / period.noise

    return residuals


def _misfit(scales: Scales, unknowns: Array, period: Period) -> Array:
    return jnp.sqrt(jnp.mean(_residuals(scales)(unknowns, period) ** 2))
