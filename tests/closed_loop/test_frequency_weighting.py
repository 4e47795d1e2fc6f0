"""The weighting W_k: its published magnitudes, and the analogue filter on the same samples."""

import numpy as np
import pytest
from refusals import refusal
from scipy import signal

from mrwork.closed_loop import frequency_weighted

# Magnitudes at frequencies [Hz]: ISO 2631-1:1997, table 3, of the filter with its band limits.
PUBLISHED = {1.0: 0.482, 4.0: 0.967, 8.0: 1.036, 16.0: 0.768, 31.5: 0.405}


@pytest.mark.parametrize(("frequency", "magnitude"), PUBLISHED.items())
def test_magnitudes_are_those_of_the_standard(frequency: float, magnitude: float) -> None:
    dt = 2e-4
    # Whole cycles, after the transient.
    time = dt * np.arange(round(20.0 / dt))
    weighted = frequency_weighted(np.sin(2.0 * np.pi * frequency * time), dt)[time >= 10.0]
    assert np.sqrt(2.0 * np.mean(weighted**2)) == pytest.approx(magnitude, abs=1e-3)


def test_it_is_the_analogue_filter_on_straight_lines_between_samples() -> None:
    def stage(frequency: float, q: float) -> list[float]:
        w = 2.0 * np.pi * frequency
        return [1.0, w / q, w**2]

    root, w2, w3 = np.sqrt(0.5), 200.0 * np.pi, 25.0 * np.pi
    above, below = [1.0], [1.0]
    for one in ([w2**2], [1.0, 0.0, 0.0], [w3, w3**2], stage(2.37, 0.91)):
        above = np.polymul(above, one)
    for one in (stage(0.4, root), stage(100.0, root), stage(12.5, 0.63), stage(3.35, 0.91)):
        below = np.polymul(below, one)
    samples = np.random.default_rng(1).normal(size=(3000, 2))
    filtered = [signal.lsim((above, below), column, 1e-3 * np.arange(3000))[1] for column in samples.T]
    weighted = frequency_weighted(samples, 1e-3)
    np.testing.assert_allclose(weighted, np.transpose(filtered), atol=1e-7)
    np.testing.assert_array_equal(frequency_weighted(samples[:, 0], 1e-3), weighted[:, 0])


def test_no_samples_are_refused() -> None:
    refusal(frequency_weighted, np.empty(0), 1e-3, match="no samples")
    refusal(frequency_weighted, np.ones(3), 1e-3, "wd", match="weighting")
