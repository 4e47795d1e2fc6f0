"""The normalised Bouc-Wen damper as somebody with diffrax would write it: an ODE under an interpolated motion."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, Literal

import jax.numpy as jnp
from jax import Array

from mrwork.records import DamperTest

Solver = Literal["tsit5", "heun"]
# Of adaptive steps, about the error of the kernel's fixed ones.
_RTOL, _ATOL = 1e-6, 1e-8


def force_by_diffrax(test: DamperTest, solver: Solver, substeps: int) -> Callable[[Array], Array]:
    """Force [N], (n_time,), of theta = (c, k, x0, k_w, rho, sigma, n): f = c v + k (x - x0) + k_w w.

    w' = rho (v - sigma |v| |w|^(n-1) w + (sigma - 1) v |w|^n), by Tsitouras' method with adaptive steps, or by Heun's
    with `substeps` of a sample, forward in derivatives.
    """
    diffrax: Any = import_module("diffrax")
    time = jnp.asarray(test.dt * jnp.arange(test.n_time))
    displacement, velocity = jnp.asarray(test.displacement), jnp.asarray(test.velocity)
    motion = diffrax.CubicInterpolation(time, diffrax.backward_hermite_coefficients(time, velocity))

    def rate(t: Array, w: Array, theta: Array) -> Array:
        _, _, _, _, rho, sigma, n = theta
        v = motion.evaluate(t)
        # The power has no derivative at rest, where the loop begins.
        size = jnp.where(w == 0.0, 1.0, jnp.abs(w))
        w_n = jnp.where(w == 0.0, 0.0, size**n)
        slope: Array = rho * (v - sigma * jnp.abs(v) * jnp.sign(w) * w_n + (sigma - 1.0) * v * w_n)
        return slope

    if solver == "tsit5":
        method, step, steps = diffrax.Tsit5(), None, diffrax.PIDController(rtol=_RTOL, atol=_ATOL)
    else:
        method, step, steps = diffrax.Heun(), test.dt / substeps, diffrax.ConstantStepSize()

    def force(theta: Array) -> Array:
        c, k, x0, k_w, *_ = theta
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(rate),
            method,
            t0=time[0],
            t1=time[-1],
            dt0=step,
            y0=jnp.zeros(()),
            args=theta,
            saveat=diffrax.SaveAt(ts=time),
            stepsize_controller=steps,
            adjoint=diffrax.ForwardMode(),
            max_steps=None,
            throw=False,
        )
        found: Array = c * velocity + k * (displacement - x0) + k_w * solution.ys
        return found

    return force
