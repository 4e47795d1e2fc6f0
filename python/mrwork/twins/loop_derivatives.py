"""The score of a loop with prescribed commands, with its derivatives in every one of them.

It is the mean of the ratios of peak drift, peak absolute acceleration, rms drift and rms
absolute acceleration to their values at i = 0. Peaks and the largest of several places are replaced by a norm of
exponent `power`, which is smooth and tends to the maximum from above as the exponent grows.

The run is a chain of stretches of equal length, the last one padded with steps of weight zero. The state at the start
of each stretch is kept, and the steps inside are computed again for the derivatives: the memory is that of one stretch,
and functions are compiled once for motions of any length.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import ArrayLike, NDArray

from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.spec import DamperSpec
from mrwork.twins.loop_stepping import (
    Devices,
    LoopDevice,
    LoopPlant,
    LoopState,
    StepGround,
    at_rest,
    pulls_of,
    stage_values,
    step,
)
from mrwork.twins.models import on_processor


class PlacedDamper(Protocol):
    """A damper across a storey: `mrwork.buildings.matrices.Device`, of whose draws the first counts."""

    @property
    def spec(self) -> DamperSpec:
        """Model."""

    @property
    def draws(self) -> Floats:
        """Parameters, shape (n_draws, n_params)."""

    @property
    def row(self) -> ArrayLike:
        """Row of the elongation, shape (n,)."""

    @property
    def count(self) -> float:
        """Number in parallel."""

    @property
    def differential(self) -> bool:
        """Whether as many act in the opposite direction."""


def devices_of(dampers: Sequence[PlacedDamper]) -> Devices:
    """The devices of a run, from those of NumPy arrays."""
    return tuple(
        LoopDevice(
            spec=each.spec,
            theta=jnp.asarray(each.draws[0]),
            row=jnp.asarray(each.row, dtype=jnp.float64),
            count=each.count,
            differential=each.differential,
        )
        for each in dampers
    )


# Steps of a stretch.
_STRETCH = 256


class CriteriaAtRest(NamedTuple):
    """Criteria at i = 0, by which those of a run are divided: drifts [m] and absolute accelerations [m/s^2]."""

    peak_drift: float
    peak_acceleration: float
    rms_drift: float
    rms_acceleration: float


class _Sums(NamedTuple):
    """Sums over the steps, in units of the criteria at i = 0: powers over all places, squares and peaks of each."""

    drift_power: Array
    acceleration_power: Array
    drift_square: Array
    acceleration_square: Array
    drift_peak: Array
    acceleration_peak: Array


class _Carry(NamedTuple):
    motion: LoopState
    received: Array
    sums: _Sums


class _Fixed(NamedTuple):
    """Equal for all steps."""

    plant: LoopPlant
    devices: Devices
    step_time: float
    scales: CriteriaAtRest
    power: float


class _Inputs(NamedTuple):
    """Inputs of each step: commands of the devices, ground acceleration, and 1, or 0 for padding."""

    command: Array
    ground: StepGround
    weight: Array


@array_dataclass()
class PrescribedLoop:
    """A building with devices under one ground motion [m/s^2], for commands that are constant over intervals.

    `stretches` are ground and weight of their steps, `places` the interval of each step, shape (n_steps,), in
    ascending order.
    """

    plant: LoopPlant
    devices: Devices
    step_time: float
    places: NDArray[np.intp]
    scales: CriteriaAtRest
    stretches: tuple[tuple[StepGround, Array], ...]

    @on_processor()
    def ratios(self, commands: Floats) -> Floats:
        """Criteria of a run over those at i = 0; `commands` (n_intervals, n_devices), the coils start at the first."""
        sums = self._carries(self._fix(2.0), commands)[-1].sums
        squares = (sums.drift_square, sums.acceleration_square)
        rms = [float(np.sqrt(np.max(np.asarray(each)) / self.places.size)) for each in squares]
        return np.array([float(sums.drift_peak), float(sums.acceleration_peak), *rms])

    @on_processor()
    def score_and_gradient(self, commands: Floats, power: float) -> tuple[float, Floats]:
        """Smooth score, and its derivatives with respect to the commands, in their shape."""
        fixed = self._fix(power)
        carries = self._carries(fixed, commands)
        score, rate = _score_and_rate(carries[-1].sums, float(self.places.size), power)
        pull = jax.tree.map(jnp.zeros_like, carries[-1])._replace(sums=rate)
        gradients = []
        for carry, inputs in zip(reversed(carries[:-1]), reversed(self._inputs(commands)), strict=True):
            pull, gradient = _pull_back(fixed, carry, inputs, pull)
            gradients.append(np.asarray(gradient))
        by_step = np.concatenate(gradients[::-1])[: self.places.size]
        # The coils start at the first command.
        by_command: Floats = np.stack(
            [np.bincount(self.places, weights=column, minlength=len(commands)) for column in by_step.T],
            axis=1,
        )
        by_command[0] += np.asarray(pull.received)
        return float(score), by_command

    def _fix(self, power: float) -> _Fixed:
        return _Fixed(self.plant, self.devices, self.step_time, self.scales, power)

    def _inputs(self, commands: Floats) -> list[_Inputs]:
        by_step = np.asarray(commands, dtype=np.float64)[self.places]
        return [
            _Inputs(jnp.asarray(_pad_stretch(by_step[start : start + _STRETCH])), ground, weight)
            for start, (ground, weight) in zip(
                range(0, self.places.size, _STRETCH), self.stretches, strict=True
            )
        ]

    def _carries(self, fixed: _Fixed, commands: Floats) -> list[_Carry]:
        """State and sums at the start of each stretch, and at the end of the run."""
        n_floors, n_storeys = self.plant.floors.shape[0], self.plant.storeys.shape[0]
        zero = jnp.float64(0.0)
        sums = _Sums(zero, zero, jnp.zeros(n_storeys), jnp.zeros(n_floors), zero, zero)
        carries = [_Carry(at_rest(self.plant, self.devices), jnp.asarray(commands[0]), sums)]
        for inputs in self._inputs(commands):
            carries.append(_advance(fixed, carries[-1], inputs))
        return carries


@on_processor()
def prescribed_loop(
    *,
    matrices: Mapping[str, Floats],
    dampers: Sequence[PlacedDamper],
    acceleration: Floats,
    dt: float,
    duration: float,
    step_time: float,
    interval: float,
    delay: float,
    scales: CriteriaAtRest,
) -> PrescribedLoop:
    """The loop under a ground motion [m/s^2] every `dt` [s], from NumPy arrays; the first command has no delay [s]."""
    n_steps = max(1, math.floor(duration / step_time * (1.0 + 1e-12)))
    times = np.maximum(np.arange(n_steps) * step_time - delay, 0.0)
    ground = stage_values(acceleration, dt, step_time, n_steps)
    stretches = []
    for start in range(0, n_steps, _STRETCH):
        here = [_pad_stretch(each[start : start + _STRETCH]) for each in ground.T]
        weight = jnp.asarray(_pad_stretch(np.ones(min(_STRETCH, n_steps - start))))
        stretches.append((StepGround(*map(jnp.asarray, here)), weight))
    return PrescribedLoop(
        plant=LoopPlant.of(**matrices),
        devices=devices_of(dampers),
        step_time=step_time,
        places=np.floor(times / interval + 1e-9).astype(np.intp),
        scales=scales,
        stretches=tuple(stretches),
    )


def _pad_stretch(values: Floats) -> Floats:
    """Values of a stretch, with zeros after the last step."""
    missing = _STRETCH - len(values)
    return np.concatenate([values, np.zeros((missing, *values.shape[1:]))]) if missing else values


def _stretch(fixed: _Fixed, carry: _Carry, inputs: _Inputs) -> _Carry:
    plant, devices, step_time, scales, power = fixed
    pulls = pulls_of(plant, devices)
    lagged = jnp.array([device.lagged for device in devices])

    def advance(carry: _Carry, at: _Inputs) -> tuple[_Carry, None]:
        current = jnp.where(lagged, carry.received, at.command)
        after, received, start = step(
            plant, devices, pulls, carry.motion, current, at.command, at.ground, step_time
        )
        drift = plant.storeys @ carry.motion.q
        acceleration = plant.floors @ start.rate.v + at.ground.start
        sums, weight = carry.sums, at.weight
        drift_share, acceleration_share = drift / scales.peak_drift, acceleration / scales.peak_acceleration
        return _Carry(
            after,
            received,
            _Sums(
                sums.drift_power + weight * _power_sum(drift_share, power),
                sums.acceleration_power + weight * _power_sum(acceleration_share, power),
                sums.drift_square + weight * jnp.square(drift / scales.rms_drift),
                sums.acceleration_square + weight * jnp.square(acceleration / scales.rms_acceleration),
                jnp.maximum(sums.drift_peak, weight * jnp.abs(drift_share).max()),
                jnp.maximum(sums.acceleration_peak, weight * jnp.abs(acceleration_share).max()),
            ),
        ), None

    last, _ = lax.scan(advance, carry, inputs)
    return last


def _power_sum(shares: Array, power: float) -> Array:
    """Sum of |share|^power, with finite derivatives at zero."""
    square = jnp.square(shares)
    large = square > 1e-12
    return jnp.sum(jnp.where(large, jnp.where(large, square, 1.0) ** (0.5 * power), 0.0))


_advance = jax.jit(_stretch)


@jax.jit
def _pull_back(fixed: _Fixed, carry: _Carry, inputs: _Inputs, pull: _Carry) -> tuple[_Carry, Array]:
    """Derivatives with respect to the state at the start of a stretch and its commands, from those at its end."""
    _, back = jax.vjp(
        lambda start, command: _stretch(fixed, start, inputs._replace(command=command)), carry, inputs.command
    )
    pulled: tuple[_Carry, Array] = back(pull)
    return pulled


@jax.jit
@jax.value_and_grad
def _score_and_rate(sums: _Sums, n_steps: float, power: float) -> Array:
    def norm(values: Array) -> Array:
        return jnp.sum(values**power) ** (1.0 / power)

    ratios = (
        sums.drift_power ** (1.0 / power),
        sums.acceleration_power ** (1.0 / power),
        norm(jnp.sqrt(sums.drift_square / n_steps)),
        norm(jnp.sqrt(sums.acceleration_square / n_steps)),
    )
    score: Array = sum(ratios, start=jnp.float64(0.0)) / len(ratios)
    return score
