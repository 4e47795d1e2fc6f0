"""Random motions and commands by which a damper shows what it can do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.parameters import CommandUnit
from mrwork.simulate import Loading

Floats = NDArray[np.float64]

_N_TONES = 24
# Tones reach this far to either side of the middle frequency.
_BAND = 5.0
# Enough to meet the peaks of the fastest within 1 %.
_PER_CYCLE = 100


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
    """A motion of the given peaks, and a command that wanders and jumps between 0 and the largest.

    The motion is a sum of tones of random phase, evenly spread in the logarithm of frequency about the f of
    `2 pi f amplitude = velocity`, with equal velocities; its time is stretched so that both peaks [m, m/s] are met.
    The command is the same noise, cut at both ends, so that it rests there a third of the time, with jumps.
    """
    # In units in which the tones lie about 1 Hz and the motion lasts so many seconds.
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
