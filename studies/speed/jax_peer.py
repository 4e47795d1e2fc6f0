"""The workload of kernels in jax, and what all peers in jax share.

One `lax.scan` over the samples, jitted, in float64, for the whole batch at once. Varied: `vmap` of a scalar scan or
arrays of candidates in one scan, the scan's unrolling, the vector width XLA aims at (it stops at 256 bits unless set
otherwise), and whether the batch is split over one XLA device per core (XLA runs a loop of small kernels on one thread,
however many it owns).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from studies.former.arrays import Floats
from studies.speed.workload import PowerForm, Run, Workload

# The contenders must agree to 1e-9, which single precision cannot.
jax.config.update("jax_enable_x64", True)  # type: ignore[no-untyped-call] # jax leaves it unannotated


@dataclass(frozen=True, slots=True, kw_only=True)
class JaxVariant:
    """One way to lay out and compile a batch; `vector_bits` 0 leaves the width to XLA."""

    layout: Literal["simulate", "vmap", "arrays"] = "vmap"
    unroll: int = 1
    vector_bits: int = 0
    split: bool = True

    def describe(self) -> str:
        """In a few words, for the table."""
        layout = {
            "simulate": "vmap(simulate)",
            "vmap": f"vmap(scan), unroll {self.unroll}",
            "arrays": f"scan of arrays, unroll {self.unroll}",
        }
        width = f", {self.vector_bits}-bit vectors" if self.vector_bits else ""
        split = ", batch split over devices" if self.split and len(jax.devices()) > 1 else ""
        return f"{layout[self.layout]}{width}{split}"

    @property
    def options(self) -> dict[str, str | bool] | None:
        """Of XLA's compiler."""
        return {"xla_cpu_prefer_vector_width": str(self.vector_bits)} if self.vector_bits else None


def wider(variant: JaxVariant) -> JaxVariant:
    """With vectors of 512 bits."""
    return replace(variant, vector_bits=512)


def unrolled_further(variant: JaxVariant) -> JaxVariant:
    """With twice the unrolling: tried as long as it pays, for then more is only slower, and slow to compile."""
    return replace(variant, unroll=2 * variant.unroll)


def as_arrays(variant: JaxVariant) -> JaxVariant:
    """With arrays of candidates in one scan."""
    return replace(variant, layout="arrays")


def on_one_device(variant: JaxVariant) -> JaxVariant:
    """Without a split over devices, if there are several."""
    return replace(variant, split=variant.split and len(jax.devices()) == 1)


START = JaxVariant()
CHANGES = (wider, unrolled_further, unrolled_further, unrolled_further, as_arrays, on_one_device)


def prepare(workload: Workload, form: PowerForm, variant: JaxVariant) -> Run:
    """Place the inputs, compile `variant` for their shapes and return the call to be timed."""
    dt = workload.dt

    def misfit(theta: Array, stages: Array, force: Array) -> Array:
        c, k, x0, k_w, rho, sigma, n = (theta[..., j] for j in range(7))

        def rate(v: Array, w: Array) -> Array:
            speed = jnp.abs(v)
            opposing = sigma * jnp.where(w < 0, -speed, speed) - (sigma - 1.0) * v
            return rho * (v - _power(w, n, form) * opposing)

        def step(carry: tuple[Array, Array], inputs: tuple[Array, Array]) -> tuple[tuple[Array, Array], None]:
            w, total = carry
            table, measured = inputs
            v_start, v_middle, (x_end, v_end) = table[0, 1], table[1, 1], table[2]
            k1 = rate(v_start, w)
            k2 = rate(v_middle, w + 0.5 * dt * k1)
            k3 = rate(v_middle, w + 0.5 * dt * k2)
            k4 = rate(v_end, w + dt * k3)
            w = w + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            residual = c * v_end + k * (x_end - x0) + k_w * w - measured
            return (w, total + residual * residual), None

        first = c * stages[0, 0, 1] + k * (stages[0, 0, 0] - x0) - force[0]
        start = (jnp.zeros_like(c), first * first)
        (_, total), _ = lax.scan(step, start, (stages, force[1:]), unroll=variant.unroll)
        return total

    batched = jax.vmap(misfit, in_axes=(0, None, None)) if variant.layout == "vmap" else misfit
    return compiled_run(variant, batched, workload.theta, workload.stages, workload.force)


def compiled_run(
    variant: JaxVariant,
    misfits: Callable[..., Array],
    theta: Floats,
    *shared: Floats,
) -> Run:
    """Place the inputs, compile `misfits(theta, *shared)`, (n_batch,), and return the call to be timed."""
    compiled = jax.jit(misfits, compiler_options=variant.options)

    devices = jax.devices()
    if not variant.split or len(theta) % len(devices) != 0:
        devices = devices[:1]
    mesh = Mesh(np.array(devices), ("candidates",))
    rows = NamedSharding(mesh, PartitionSpec("candidates"))  # type: ignore[no-untyped-call] # jax leaves it unannotated
    whole = NamedSharding(mesh, PartitionSpec())  # type: ignore[no-untyped-call] # jax leaves it unannotated
    placed = jax.device_put(theta, rows), *(jax.device_put(array, whole) for array in shared)
    return lambda: compiled(*placed).block_until_ready()


def _power(w: Array, n: Array, form: PowerForm) -> Array:
    match form:
        case "power":
            return jnp.power(jnp.abs(w), n)
        case "square":
            return w * w
        case "exp_log":
            return jnp.exp(n * jnp.log(jnp.abs(w)))
