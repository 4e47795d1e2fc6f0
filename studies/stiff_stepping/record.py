"""Random motions as severe as the published damper meets in a building."""

from __future__ import annotations

import numpy as np

from mrwork.kernels import LoadingHistory
from mrwork.simulate import Loading

STROKE = 0.006
PEAK_VELOCITY = 0.6


def random_record(seed: int, dt: float = 1.0 / 3000.0, n_time: int = 3000) -> LoadingHistory:
    """Sinusoids of random phase, +-6 mm and 0.6 m/s; it starts in motion, from a damper at rest.

    The time is stretched until the peak velocity is right, and the displacement is then sampled.
    """
    rng = np.random.default_rng(seed)
    frequency = np.linspace(0.5, 25.0, 80)[:, None]
    phase = rng.uniform(0.0, 2.0 * np.pi, (80, 1))
    time = np.linspace(0.0, 1.0, 3001)

    def motion(time: np.ndarray) -> np.ndarray:
        return np.sin(2.0 * np.pi * frequency * time + phase).sum(axis=0)

    scale = STROKE / np.max(np.abs(motion(time)))
    velocity = (2.0 * np.pi * frequency * np.cos(2.0 * np.pi * frequency * time + phase)).sum(axis=0)
    stretch = PEAK_VELOCITY / (scale * np.max(np.abs(velocity)))
    sampled = np.arange(0.0, min(1.0 / (stretch * dt), n_time)) * dt * stretch
    return Loading(dt=dt, displacement=scale * motion(sampled)).history()
