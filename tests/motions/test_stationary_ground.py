"""The stationary ground of a design has the strength and the shape of the strong parts of motions."""

from __future__ import annotations

import numpy as np
import pytest
from sentences import Refused

import mrwork as mr
from mrwork.motions import CloughPenzien, KanaiTajimi, mean_square_of, scaled, stationary_ground
from mrwork.motions.spectral_density import strong_part


def noise(soil: KanaiTajimi, seed: int) -> mr.GroundMotion:
    return mr.synthetic_motion(soil, rng=seed, duration=40.0)


@pytest.mark.parametrize(
    "soil", [KanaiTajimi(), KanaiTajimi(frequency=30.0, damping=0.3), KanaiTajimi(frequency=8.0, damping=0.4)]
)
def test_filter_of_synthetic_motions_is_recovered(soil: KanaiTajimi) -> None:
    """Eight motions of 40 s: about a thousand bands, so that frequency and damping are known to some ten per cent."""
    ground = stationary_ground([noise(soil, seed) for seed in range(8)]).spectrum
    assert isinstance(ground, KanaiTajimi)
    assert ground.frequency == pytest.approx(soil.frequency, rel=0.15)
    assert ground.damping == pytest.approx(soil.damping, rel=0.3)


@pytest.mark.parametrize("kind", ["kanai_tajimi", "clough_penzien"])
def test_its_mean_square_is_that_of_the_strong_parts(kind: str) -> None:
    motions = [noise(KanaiTajimi(), 1), scaled(noise(KanaiTajimi(), 2), 3.0)]
    found = stationary_ground(motions, kind)  # type: ignore[arg-type] # one of the kinds
    expected = np.mean([np.mean(strong_part(each) ** 2) for each in motions])
    assert mean_square_of(found.spectrum) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("spectrum", [KanaiTajimi(), CloughPenzien()])
def test_mean_square_is_the_integral_of_the_density(spectrum: KanaiTajimi | CloughPenzien) -> None:
    w = np.linspace(0.0, 20_000.0, 2_000_001)
    # Beyond the last frequency the density falls as 1 / w^2.
    tail = float(spectrum.density(w[-1:])[0]) * w[-1]
    assert mean_square_of(spectrum) == pytest.approx(
        2.0 * (np.trapezoid(spectrum.density(w), w) + tail), rel=1e-5
    )


def test_strength_scales_and_shape_stays() -> None:
    one = stationary_ground([noise(KanaiTajimi(), 1)]).spectrum
    ten = stationary_ground([scaled(noise(KanaiTajimi(), 1), 10.0)]).spectrum
    assert isinstance(one, KanaiTajimi)
    assert isinstance(ten, KanaiTajimi)
    assert ten.intensity == pytest.approx(100.0 * one.intensity, rel=1e-4)
    assert (ten.frequency, ten.damping) == pytest.approx((one.frequency, one.damping), rel=1e-4)


def test_a_harmonic_motion_is_narrow_and_keeps_its_strength() -> None:
    time = 0.01 * np.arange(2001)
    sine = mr.GroundMotion(name="sine", dt=0.01, acceleration=np.sin(2.0 * np.pi * 3.0 * time))
    found = stationary_ground([sine])
    assert found.narrow
    assert found.mean_square == pytest.approx(0.5, rel=0.01)
    assert not stationary_ground([noise(KanaiTajimi(), 1)]).narrow


def test_zero_and_short_motions_count_for_nothing(refused: Refused) -> None:
    still = mr.GroundMotion(name="still", dt=0.01, acceleration=np.zeros(500))
    sound = noise(KanaiTajimi(), 1)
    with_others, alone = stationary_ground([still, sound]), stationary_ground([sound])
    assert (with_others.spectrum, with_others.n_motions) == (alone.spectrum, 1)
    refused(stationary_ground, [still])
    refused(stationary_ground, [])
