"""A fitted spectrum is that of the motion; the ground of a design is as strong as the strong parts of motions."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal

import mrwork as mr
from mrwork.errors import MrworkWarning
from mrwork.motions import Envelope, GroundMotion, KanaiTajimi, fitted_spectrum, scaled, stationary_ground
from mrwork.motions.spectral_density import CloughPenzien, mean_square_of, strong_part


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


def test_zero_motions_count_for_nothing() -> None:
    still = mr.GroundMotion(name="still", dt=0.01, acceleration=np.zeros(500))
    sound = noise(KanaiTajimi(), 1)
    with_others, alone = stationary_ground([still, sound]), stationary_ground([sound])
    assert (with_others.spectrum, with_others.n_motions) == (alone.spectrum, 1)
    refusal(stationary_ground, [still], match="is zero")
    short = GroundMotion(name="short", dt=0.01, acceleration=np.ones(20))
    refusal(fitted_spectrum, short, match="has 19 samples, a spectrum needs 50")


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


def test_a_spectrum_that_the_record_does_not_determine_is_warned_of() -> None:
    # A line: the narrower the filter, the likelier.
    time = 0.01 * np.arange(3000)
    line = replace(mr.synthetic_motion(), acceleration=np.sin(2.0 * np.pi * 2.0 * time), dt=0.01)
    with pytest.warns(MrworkWarning, match="no maximum that the record determines"):
        fitted_spectrum(line)
