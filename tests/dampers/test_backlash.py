"""The dead zone of `backlash_bouc_wen`: no force within the play, the normalised Bouc-Wen model behind it."""

import numpy as np
import pytest
from backlash_rig import DT, ELEMENT, MOTIONS, PLAY, force_behind_play
from loop_samples import under_a_sine
from sinusoidal_tests import harmonic

import mrwork as mr
from mrwork.dampers.simulation import Loading, simulate_force

# s of the model [m].
WIDTH = 2e-4


def motion_of(amplitude: float, frequency: float) -> Loading:
    return harmonic(DT * np.arange(1001), (amplitude, frequency))


def force(loading: Loading, model: str = "backlash_bouc_wen", **changes: float) -> np.ndarray:
    spec = mr.damper(model)
    values = {**ELEMENT, "g": PLAY, **changes}
    return simulate_force(spec, [values[name] for name in spec.names], loading)


def test_without_play_it_is_the_normalised_bouc_wen_model() -> None:
    loading = motion_of(0.01, 1.5)
    plain = force(loading, "normalised_bouc_wen")
    apart = [
        float(np.max(np.abs(force(loading, g=play) - plain)) / np.max(np.abs(plain)))
        for play in (1e-4, 1e-5, 1e-6)
    ]
    # The depth of the dead zone is tanh(g/s): the difference vanishes in proportion to g, everywhere at once.
    assert apart[2] < 1e-2 * PLAY / WIDTH
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.2)
    assert apart[1] / apart[2] == pytest.approx(10.0, rel=0.02)


@pytest.mark.parametrize("motion", MOTIONS)
def test_it_has_the_force_behind_a_dead_zone_with_corners(motion: tuple[float, float]) -> None:
    loading = motion_of(*motion)
    expected = force_behind_play(loading.displacement, np.asarray(loading.velocity))
    apart = np.sqrt(np.mean((force(loading) - expected) ** 2))
    # The corners are rounded over 0.2 mm, which counts where little of the stroke is beyond the play.
    amplitude, _ = motion
    assert apart < (0.03 + 0.2 * WIDTH / (amplitude - PLAY)) * np.std(expected)


def test_a_stroke_well_within_the_play_meets_no_force() -> None:
    offset = ELEMENT["k"] * ELEMENT["x0"]
    found = force(motion_of(0.5 * PLAY, 2.0)) + offset
    assert np.max(np.abs(found)) < 0.01 * ELEMENT["k_w"]


def test_longer_strokes_have_the_spring_force_of_a_stroke_shorter_by_the_play() -> None:
    loading = Loading(dt=DT, displacement=np.linspace(-0.03, 0.03, 1201))
    spring = force(loading, c=1e-3, k_w=1e-3, x0=0.0) / ELEMENT["k"]
    x = loading.displacement
    beyond = np.abs(x) > PLAY + 5.0 * WIDTH
    expected = np.sign(x) * (np.abs(x) - PLAY)
    # The loop keeps its least yield force.
    np.testing.assert_allclose(spring[beyond], expected[beyond], rtol=0.0, atol=2e-3 / ELEMENT["k"])


def test_in_a_building_its_energies_balance() -> None:
    spec = mr.damper("backlash_bouc_wen")
    values = {**ELEMENT, "g": PLAY}
    responses = under_a_sine(spec, [values[name] for name in spec.names])
    assert responses.energy_error[0] < 1e-3
    assert responses.peak_stroke[0, 0] > PLAY
