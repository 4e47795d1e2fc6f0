"""A spectrum fitted to a motion is the one that the motion was drawn from."""

from __future__ import annotations

import numpy as np
import pytest
from sentences import Refused

import mrwork as mr
from mrwork.motions import CloughPenzien, Envelope, GroundMotion, KanaiTajimi, fitted_spectrum

# Without rise and decay, so that the motion is stationary.
FLAT = Envelope(rise=0.0, plateau_end=1e4, decay=0.0)


@pytest.mark.parametrize(("frequency", "damping", "intensity"), [(15.0, 0.6, 0.01), (8.0, 0.3, 0.002)])
def test_a_stationary_motion_gives_its_spectrum_back(
    frequency: float, damping: float, intensity: float
) -> None:
    """Of 200 s, about 5000 frequencies: two per cent in each number, within four of them."""
    true = KanaiTajimi(frequency=frequency, damping=damping, intensity=intensity)
    motion = mr.synthetic_motion(true, rng=3, duration=200.0, envelope=FLAT)
    found = fitted_spectrum(motion)
    assert isinstance(found, KanaiTajimi)
    for name in ("frequency", "damping", "intensity"):
        assert getattr(found, name) == pytest.approx(getattr(true, name), rel=0.08), name


def test_the_variance_is_that_of_the_strong_part() -> None:
    motion = mr.synthetic_motion(CloughPenzien(), rng=5, duration=40.0)
    energy = np.cumsum(motion.acceleration**2) / np.sum(motion.acceleration**2)
    strong = motion.acceleration[(energy > 0.05) & (energy < 0.95)]
    w = np.linspace(1e-2, 2.0 * np.pi * 25.0, 200_000)
    for kind in ("kanai_tajimi", "clough_penzien"):
        density = fitted_spectrum(motion, kind).density(w)
        assert 2.0 * np.trapezoid(density, w) == pytest.approx(strong.var(), rel=0.15)


def test_what_has_no_spectrum_is_refused(refused: Refused) -> None:
    still = GroundMotion(name="still", dt=0.01, acceleration=np.zeros(1000))
    refused(fitted_spectrum, still)
    short = GroundMotion(name="short", dt=0.01, acceleration=np.ones(20))
    refused(fitted_spectrum, short)
    refused(fitted_spectrum, mr.synthetic_motion(), "white")
