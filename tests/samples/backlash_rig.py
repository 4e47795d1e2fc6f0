"""A rig with play: its motion passes a dead zone with sharp corners, which no model has, before a Bouc-Wen element."""

import numpy as np
from sinusoidal_tests import harmonic

import mrwork as mr

DT = 2e-3
PLAY = 1.5e-3
"""Half width of the play [m]."""
ELEMENT = {"c": 2000.0, "k": 800.0, "x0": -0.02, "k_w": 600.0, "rho": 1200.0, "sigma": 0.7, "n": 1.8}
MOTIONS = ((0.038, 0.97), (0.025, 1.53), (0.013, 1.47), (0.004, 2.03), (0.002, 2.07))
"""Amplitude [m] and frequency [Hz] of the tests of the rig: its usual strokes, and small ones."""


def backlash_test(
    motion: tuple[float, float], *, noise: float = 6.0, cycles: int = 6, rng: int = 0
) -> mr.DamperTest:
    """A sinusoidal test of the rig with white noise of the force [N]."""
    amplitude, frequency = motion
    time = DT * np.arange(round(cycles / frequency / DT) + 1)
    loading = harmonic(time, motion)
    x, v = loading.displacement, loading.velocity
    scatter = np.random.default_rng(rng).standard_normal(time.size)
    return mr.test_from_arrays(
        name=f"{1e3 * amplitude:g} mm {frequency:g} Hz",
        time=time,
        displacement=x,
        velocity=v,
        force=force_behind_play(x, v) + noise * scatter,
        amplitude=amplitude,
        frequency=frequency,
        synthetic=True,
    )


def force_behind_play(x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Force of the element behind the dead zone, on a grid that is so fine that its corners do not matter."""
    finer = 20
    coarse = np.arange(x.size)
    fine = np.linspace(0.0, x.size - 1.0, finer * (x.size - 1) + 1)
    position, rate = (np.interp(fine, coarse, each) for each in (x, v))
    moved = np.sign(position) * np.maximum(np.abs(position) - PLAY, 0.0)
    loading = mr.Loading(dt=DT / finer, displacement=moved, velocity=np.where(moved == 0.0, 0.0, rate))
    spec = mr.damper("normalised_bouc_wen")
    return mr.simulate_force(spec, [ELEMENT[name] for name in spec.names], loading)[::finer]
