"""Random motions have the peaks that were asked for, and commands use their whole range."""

from __future__ import annotations

import numpy as np

from mrwork.control.inverse_network import random_loading
from mrwork.simulation import Loading


def loading(rng: int, velocity: float = 0.2) -> Loading:
    return random_loading(
        amplitude=0.01,
        velocity=velocity,
        largest_command=1.88,
        command_unit="A",
        dt=1e-3,
        n_cycles=30,
        rng=np.random.default_rng(rng),
    )


def test_peaks_are_those_asked_for() -> None:
    """The velocity to 1 %, for the stretch of time that meets it is found on another grid."""
    for rng in range(5):
        for velocity in (0.02, 0.2):
            made = loading(rng, velocity)
            np.testing.assert_allclose(np.abs(made.displacement).max(), 0.01, rtol=1e-12)
            assert made.velocity is not None
            np.testing.assert_allclose(np.abs(made.velocity).max(), velocity, rtol=0.01)


def test_velocity_is_the_derivative_of_the_displacement() -> None:
    made = loading(1, velocity=0.02)
    assert made.velocity is not None
    quotient = (made.displacement[2:] - made.displacement[:-2]) / (2.0 * made.dt)
    # Central differences at 1 kHz of tones up to some 3 Hz: (2 pi 3/1000)^2/6 of the size is left.
    np.testing.assert_allclose(quotient, made.velocity[1:-1], atol=1e-3 * 0.02)


def test_commands_rest_at_both_ends_and_wander_between() -> None:
    command = np.asarray(loading(2).command)
    for share in (
        np.mean(command == 0.0),
        np.mean(command == 1.88),
        np.mean((command > 0.2) & (command < 1.7)),
    ):
        assert 0.05 < share < 0.8


def test_a_seed_gives_the_same_bits() -> None:
    np.testing.assert_array_equal(loading(3).displacement, loading(3).displacement)
    assert not np.array_equal(loading(3).displacement, loading(4).displacement)
