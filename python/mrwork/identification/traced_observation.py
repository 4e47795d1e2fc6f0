"""Observation models in JAX: the recorded force of a damper force, as `Observation.observe` has it."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mrwork.records import Observation
from mrwork.records.damper_test import SHORTEST_AVERAGE


def observe(observation: Observation, dt: float, force: Array) -> Array:
    """Recorded force for a damper force [N], shape (..., n_time), sampled every `dt` [s]."""
    if observation.delay_seconds != 0.0:
        force = _interpolated(force, np.arange(force.shape[-1]) - observation.delay_seconds / dt)
    if observation.lag_seconds > 0.0:
        force = _lagged(force, observation.lag_seconds / dt)
    if observation.lowpass_hz > 0.0:
        force = _low_passed(force, observation.lowpass_hz, dt)
    if observation.average_seconds > 0.0:
        force = _averaged(force, observation.average_seconds / dt)
    return observation.gain * force + observation.offset


def _places(force: Array, places: Any) -> tuple[Any, Any]:
    """Sample before each place of a record, held at its ends, and the share of the interval behind it."""
    last = force.shape[-1] - 1
    places = np.clip(places, 0.0, last)
    before = np.minimum(np.floor(places).astype(int), last - 1)
    return before, places - before


def _interpolated(force: Array, places: Any) -> Array:
    before, share = _places(force, places)
    delayed: Array = force[..., before] * (1.0 - share) + force[..., before + 1] * share
    return delayed


def _averaged(force: Array, samples: float) -> Array:
    """Mean over a centred window, cut off at the ends, of a force that is linear between samples."""
    if samples < SHORTEST_AVERAGE:
        return force
    steps = np.arange(force.shape[-1])
    ends = [_places(force, steps + side * 0.5 * samples) for side in (-1.0, 1.0)]
    width = (ends[1][0] + ends[1][1]) - (ends[0][0] + ends[0][1])
    means = 0.5 * (force[..., 1:] + force[..., :-1])
    integral = jnp.concatenate([jnp.zeros_like(force[..., :1]), jnp.cumsum(means, axis=-1)], axis=-1)

    def integral_at(before: Any, share: Any) -> Any:
        rise = force[..., before + 1] - force[..., before]
        return integral[..., before] + share * (force[..., before] + 0.5 * share * rise)

    average: Array = (integral_at(*ends[1]) - integral_at(*ends[0])) / width
    return average


def _lagged(force: Array, samples: float) -> Array:
    """Response of `samples y' + y = force`, from rest at its first value."""
    decay = np.exp(-1.0 / samples)
    mean = -np.expm1(-1.0 / samples) * samples
    earlier = jnp.concatenate([force[..., :1], force[..., :-1]], axis=-1)
    lagged: Array = _recursion(decay, (1.0 - mean) * force + (mean - decay) * earlier, force[..., :1])
    return lagged


def _low_passed(force: Array, corner_hz: float, dt: float) -> Array:
    """Butterworth filter of second order as two recursions of first order, by its poles."""
    from scipy.signal import butter  # slow to load and rarely needed

    if corner_hz * dt >= 0.5:
        return force
    numerator, denominator = butter(2, 2.0 * corner_hz * dt)
    padded = jnp.concatenate([force[..., :1], force[..., :1], force], axis=-1)
    driven = sum(
        weight * padded[..., 2 - back : padded.shape[-1] - back] for back, weight in enumerate(numerator)
    )
    steady = numerator.sum() * force[..., :1]
    for pole in np.roots(denominator):
        steady = steady / (1.0 - pole)
        driven = _recursion(pole, driven, steady)
    return jnp.real(driven)


def _recursion(factor: Any, driven: Any, before: Any) -> Any:
    """y of y[t] = factor y[t - 1] + driven[t], which was `before`."""
    factors = jnp.full_like(jnp.asarray(driven) + before, factor, dtype=jnp.result_type(driven, factor))

    def after(one: tuple[Array, Array], other: tuple[Array, Array]) -> tuple[Array, Array]:
        return one[0] * other[0], one[1] * other[0] + other[1]

    decays, answers = jax.lax.associative_scan(after, (factors, driven + 0.0 * factors), axis=-1)
    return answers + decays * before
