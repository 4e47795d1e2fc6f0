"""Short sinusoidal tests of a model at given parameters, with white noise."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import mrwork as mr
from mrwork.dampers.command import CommandValues

MOTIONS = ((0.010, 1.0), (0.004, 3.0), (0.015, 0.5), (0.006, 2.0))
PER_CYCLE = 60


def sinusoidal_test(
    model: str | mr.DamperSpec,
    theta: Sequence[float],
    motion: tuple[float, float],
    *,
    noise: float,
    cycles: int = 3,
    rng: int = 0,
    command: float | None = None,
) -> mr.DamperTest:
    """A sinusoidal test; `motion` is amplitude [m] and frequency [Hz], `noise` a share of the force.

    One at a constant `command` [A] names it, and follows it where the model has laws.
    """
    spec = mr.damper(model) if isinstance(model, str) else model
    dt = 1.0 / (PER_CYCLE * motion[1])
    time = dt * np.arange(cycles * PER_CYCLE + 1)
    loading = harmonic(time, motion, command if spec.command_unit else None)
    force = mr.simulate_force(spec, theta, loading)
    scatter = np.random.default_rng(rng).standard_normal(time.size)
    name = f"{1e3 * motion[0]:g} mm {motion[1]:g} Hz" if command is None else f"{motion} at {command} A"
    return _recorded(name, time, loading, force + noise * np.std(force) * scatter, command, synthetic=True)


def driven_test(
    spec: mr.DamperSpec,
    theta: Sequence[float] | NDArray[np.float64],
    motion: tuple[float, float],
    *,
    dt: float,
    n_time: int,
    noise_n: float,
    rng: int | Sequence[int],
    command: CommandValues,
    name: str = "",
) -> mr.DamperTest:
    """A sinusoidal test at a command [A], which may vary, with noise of `noise_n` [N] in the force alone."""
    time = dt * np.arange(n_time)
    loading = harmonic(time, motion, command)
    force = mr.simulate_force(spec, theta, loading)
    scatter = np.random.default_rng(rng).standard_normal(n_time)
    return _recorded(name or f"{command:g} A", time, loading, force + noise_n * scatter, command)


def harmonic(
    time: NDArray[np.float64], motion: tuple[float, float], command: CommandValues | None = None
) -> mr.Loading:
    """A sinusoid from mid-stroke with its exact velocity."""
    amplitude, frequency = motion
    angle = 2.0 * np.pi * frequency * time
    return mr.Loading(
        dt=time[1],
        displacement=amplitude * np.sin(angle),
        velocity=2.0 * np.pi * frequency * amplitude * np.cos(angle),
        command=command,
        command_unit=None if command is None else "A",
    )


def _recorded(
    name: str,
    time: NDArray[np.float64],
    loading: mr.Loading,
    force: NDArray[np.float64],
    command: CommandValues | None,
    *,
    synthetic: bool = False,
) -> mr.DamperTest:
    return mr.test_from_arrays(
        name=name,
        time=time,
        displacement=loading.displacement,
        velocity=loading.velocity,
        force=force,
        synthetic=synthetic,
        current=command,
    )
