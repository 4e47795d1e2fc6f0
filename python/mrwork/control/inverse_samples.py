"""Training data of an inverse network: random motions, and the commands that give the wanted forces."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.simulate import Loading, simulate_force
from mrwork.units import CommandUnit
from mrwork.values import holds_arrays

Floats = NDArray[np.float64]

N_SAMPLES = 2000
# Least weight of a sample, for those at which the command hardly changes the force.
_LEAST_IMPORTANCE = 0.05
# Wanted forces beyond the range of the damper, in units of its width, as powers of ten: a regulator wants a little more
# or ten times as much.
_BEYOND = (-1.5, 1.0)
# Scale of the forces, over the largest that the damper gave.
_FORCE_MARGIN = 1.2
# Tones of the random motion lie within this factor of the middle frequency.
_N_TONES = 24
_BAND = 5.0
# Resolves the peaks of the fastest tone within 1 %.
_PER_CYCLE = 100


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class InverseSamples:
    """Inputs, shape (n, n_inputs); the right command as a share of the largest; and the weight of each sample."""

    inputs: Floats
    share: Floats
    importance: Floats


def random_loading(
    *,
    amplitude: float,
    velocity: float,
    largest_command: float,
    command_unit: CommandUnit,
    dt: float,
    n_cycles: int,
    rng: np.random.Generator,
) -> Loading:
    """A random motion with the given peaks, and a random command between 0 and the largest.

    The motion is a sum of tones with random phases, log-uniform frequencies about the f of
    `2 pi f amplitude = velocity`, and equal velocities; its time axis is scaled so that both peaks [m, m/s] are met.
    The command is the same kind of noise plus random steps, clipped to its range, where it stays a third of the time.
    """
    # Normalised time: the tones lie about 1 Hz, and the motion lasts `n_cycles` seconds.
    frequencies = _BAND ** rng.uniform(-1.0, 1.0, _N_TONES)
    phases = rng.uniform(0.0, 2.0 * np.pi, _N_TONES)

    def motion(time: Floats) -> tuple[Floats, Floats]:
        angle = 2.0 * np.pi * np.outer(time, frequencies) + phases
        return (np.sin(angle) / (2.0 * np.pi * frequencies)).sum(axis=1), np.cos(angle).sum(axis=1)

    x, v = motion(np.linspace(0.0, n_cycles, _PER_CYCLE * n_cycles))
    stretch = (velocity / amplitude) / (np.abs(v).max() / np.abs(x).max())
    time = np.arange(0.0, n_cycles, stretch * dt)
    x, v = motion(time)
    size = amplitude / np.abs(x).max()
    wander = np.sin(2.0 * np.pi * np.outer(time, 1.7 * frequencies[::2]) + phases[::2]).sum(axis=1)
    jumps = rng.uniform(-1.0, 1.0, n_cycles)[time.astype(int)]
    share = np.clip(0.5 + 0.35 * wander / wander.std() + 0.5 * jumps, 0.0, 1.0)
    return Loading(
        dt=dt,
        displacement=size * x,
        velocity=stretch * size * v,
        command=largest_command * share,
        command_unit=command_unit,
    )


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class DamperGroup:
    """`count` equal dampers in parallel; with `differential` as many act in opposition, with the same command."""

    spec: DamperSpec
    theta: Floats
    count: float = 1.0
    differential: bool = False

    def force(self, loading: Loading) -> Floats:
        """Force of all dampers together [N], shape (n_time,)."""
        one = simulate_force(self.spec, self.theta, loading)
        if self.differential:
            assert loading.velocity is not None
            opposed = replace(
                loading,
                displacement=-np.asarray(loading.displacement),
                velocity=-np.asarray(loading.velocity),
            )
            one = one - simulate_force(self.spec, self.theta, opposed)
        return np.asarray(self.count * one)


def inverse_samples(
    group: DamperGroup,
    loading: Loading,
    largest_command: float,
    n_previous: int,
    rng: np.random.Generator,
) -> tuple[InverseSamples, float]:
    """Samples with wanted forces within, above and below the range of the damper, and a scale of force [N]."""
    force = group.force(loading)
    least = group.force(replace(loading, command=0.0))
    most = group.force(replace(loading, command=largest_command))
    span = np.abs(most - least)
    usual = float(np.sqrt(np.mean(span**2)))
    if usual == 0.0:
        raise SettingError(
            f"the command does not change the force of this {group.spec.name}; there is nothing to invert"
        )
    importance = np.maximum(span / usual, _LEAST_IMPORTANCE)
    excess, lack = (10.0 ** rng.uniform(*_BEYOND, force.size) * (most - least) for _ in range(2))
    kinds = (
        (force, np.asarray(loading.command) / largest_command, 0.7),
        (most + excess, np.ones(force.size), 0.15),
        (least - lack, np.zeros(force.size), 0.15),
    )
    parts = []
    for wanted, share, portion in kinds:
        rows = rng.integers(1, force.size, round(portion * N_SAMPLES))
        inputs = network_inputs(loading, wanted, n_previous)[rows]
        parts.append((inputs, share[rows], importance[rows]))
    inputs, share, weight = (np.concatenate(each) for each in zip(*parts, strict=True))
    scale = _FORCE_MARGIN * float(np.abs(most).max())
    return InverseSamples(inputs=inputs, share=share, importance=weight), scale


def scaled_inputs(inputs: Floats, scale: Floats) -> Floats:
    """Inputs over their scales, clipped to [-1, 1]."""
    return np.asarray(np.clip(inputs / scale, -1.0, 1.0), dtype=np.float64)


def network_inputs(loading: Loading, wanted: Floats, n_previous: int) -> Floats:
    """Deformation, velocity and wanted force, then those one sample before; shape (n_time, 3 or 6)."""
    assert loading.velocity is not None
    now = np.column_stack([loading.displacement, loading.velocity, wanted])
    return np.hstack([now] + [np.vstack([now[:1], now[:-1]])] * n_previous)
