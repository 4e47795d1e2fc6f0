"""Ground acceleration in integration steps, as `ground_motion.rs` has it, of NumPy arrays or of JAX."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array

# Part of a step below which the interval of a record is finer, as FINER of `ground_motion.rs`.
_FINER = 0.999


def stage_values(acceleration: Any, dt: float, step: float, n_steps: int) -> Any:
    """Ground acceleration at start, middle and end of each step, (n_steps, 3) [m/s^2].

    A record finer than the step acts as the line `M0 - b/2, M0, M0 + b/2` with `b = 6 M0 - 12 M1`, which has the mean
    M0 of the acceleration and the mean M1 of `(1 - s) a` over the step, s from 0 to 1: see `ground_motion.rs`.
    """
    module: Any = jnp if isinstance(acceleration, Array) else np
    if dt >= _FINER * step:
        halves = half_steps(acceleration, dt, step, n_steps)
        return module.stack([halves[:-1:2], halves[1::2], halves[2::2]], axis=1)
    samples, length = np.arange(acceleration.size), step / dt
    edges = length * np.arange(n_steps + 1)
    places = np.union1d(edges, samples[samples < edges[-1]])
    values = module.interp(places, samples, acceleration)
    number = np.searchsorted(edges, places[:-1], side="right") - 1
    # The ground is still after the last sample.
    share = np.diff(places) / length * (places[1:] <= samples[-1])
    left = [(edges[number + 1] - ends) / length for ends in (places[:-1], places[1:])]
    first, last = share * values[:-1], share * values[1:]
    options: dict[str, int] = {"length": n_steps} if module is jnp else {"minlength": n_steps}
    mean = module.bincount(number, 0.5 * (first + last), **options)
    moment = first * (2.0 * left[0] + left[1]) + last * (left[0] + 2.0 * left[1])
    half = 3.0 * mean - module.bincount(number, moment, **options)
    return module.stack([mean - half, mean, mean + half], axis=1)


def at_samples(acceleration: Any, dt: float, sample_time: float, step: float, n_samples: int) -> Any:
    """Acceleration of the ground, as its sensor reads it, and velocity, at samples and the end, (n_samples + 1, 3).

    A sensor reads of a record finer than the `step` of the hardware the mean over the step before.
    """
    module: Any = jnp if isinstance(acceleration, Array) else np
    time, last = sample_time * np.arange(n_samples + 1), acceleration.size - 1
    pairs = acceleration[1:] + acceleration[:-1]
    summed = module.concatenate([np.zeros(1), module.cumsum(0.5 * dt * pairs)])

    def velocity(at: Any) -> Any:
        place = at / dt
        index = np.minimum(place.astype(int), last)
        share = np.where(index < last, place - index, 0.0)
        start, end = acceleration[index], acceleration[np.minimum(index + 1, last)]
        return summed[index] + 0.5 * dt * share * (2.0 * start + share * (end - start))

    now, record = velocity(time), half_steps(acceleration, dt, 2.0 * sample_time, n_samples)[: n_samples + 1]
    reading = (now - velocity(np.maximum(time - step, 0.0))) / step if dt < _FINER * step else record
    return module.stack([record, reading, now], axis=1)


def half_steps(acceleration: Any, dt: float, step: float, n_steps: int) -> Any:
    """Ground acceleration every half step, (2 n_steps + 1,) [m/s^2]: linear between samples, zero after the last."""
    module: Any = jnp if isinstance(acceleration, Array) else np
    # In units of samples, so that a step that divides the sampling step hits every sample exactly.
    places = np.arange(2 * n_steps + 1) * (0.5 * step / dt)
    places = np.where(np.abs(places - np.rint(places)) < 1e-9, np.rint(places), places)
    return module.interp(places, np.arange(acceleration.size), acceleration, right=0.0)
