"""Short sinusoidal tests of a model at given parameters, with white noise."""

from __future__ import annotations

import numpy as np

from mrwork.dampers import damper
from mrwork.dampers.simulation import Loading, simulate_force
from mrwork.records import DamperTest, build_damper_test

MOTIONS = ((0.010, 1.0), (0.004, 3.0), (0.015, 0.5), (0.006, 2.0))
PER_CYCLE = 60


def sinusoidal_test(
    model: str,
    theta: tuple[float, ...],
    motion: tuple[float, float],
    *,
    noise: float,
    cycles: int = 3,
    rng: int = 0,
    command: float | None = None,
) -> DamperTest:
    """A sinusoidal test; `motion` is amplitude [m] and frequency [Hz], `noise` a share of the force.

    One at a constant `command` [A] names it.
    """
    amplitude, frequency = motion
    dt = 1.0 / (PER_CYCLE * frequency)
    time = dt * np.arange(cycles * PER_CYCLE + 1)
    angle = 2.0 * np.pi * frequency * time
    displacement = amplitude * np.sin(angle)
    velocity = 2.0 * np.pi * frequency * amplitude * np.cos(angle)
    force = simulate_force(damper(model), theta, Loading(dt=dt, displacement=displacement, velocity=velocity))
    scatter = np.random.default_rng(rng).standard_normal(time.size)
    return build_damper_test(
        name=f"{1e3 * amplitude:g} mm {frequency:g} Hz" if command is None else f"{motion} at {command} A",
        time=time,
        displacement=displacement,
        velocity=velocity,
        force=force + noise * np.std(force) * scatter,
        synthetic=True,
        current=command,
    )
