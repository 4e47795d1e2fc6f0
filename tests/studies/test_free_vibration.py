"""Free vibration: two methods recover a mode, agree with each other, and have correct standard errors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from mrwork.buildings import building
from mrwork.errors import RecordError
from studies.chapter_7.free_vibration import ModeEstimate, fourier_peak, logarithmic_decrement

Floats = NDArray[np.float64]

METHODS: tuple[Callable[..., ModeEstimate], ...] = (fourier_peak, logarithmic_decrement)
DT = 0.005


def decay(frequency: float, ratio: float, duration: float, phase: float = 0.4) -> Floats:
    """Free vibration of one mode with unit amplitude."""
    time = DT * np.arange(round(duration / DT))
    omega = 2.0 * np.pi * frequency
    damped = omega * np.sqrt(1.0 - ratio**2)
    return np.asarray(np.exp(-ratio * omega * time) * np.cos(damped * time - phase))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("ratio", [0.005, 0.01, 0.03])
@pytest.mark.parametrize("duration", [10.0, 40.0])
def test_a_clean_decay_gives_its_frequency_and_damping_however_long_it_is(
    method: Callable[..., ModeEstimate], ratio: float, duration: float
) -> None:
    # The shortest record has decayed by a fifth only; an offset must have no effect.
    estimate = method(decay(3.0, ratio, duration) + 0.3, dt=DT)
    assert estimate.frequency == pytest.approx(3.0, rel=1e-5)
    assert estimate.damping_ratio == pytest.approx(ratio, rel=1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_neither_unit_nor_sign_nor_sampling_of_the_record_matters(
    method: Callable[..., ModeEstimate],
) -> None:
    record = decay(3.0, 0.01, 20.0)
    first = method(record, dt=DT)
    for estimate in (method(-1e3 * record, dt=DT), method(record[::2], dt=2.0 * DT)):
        assert estimate.frequency == pytest.approx(first.frequency, rel=1e-5)
        assert estimate.damping_ratio == pytest.approx(first.damping_ratio, rel=1e-3)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("noise", [0.003, 0.05])
def test_standard_errors_are_what_noise_really_does(
    method: Callable[..., ModeEstimate], noise: float
) -> None:
    n_draws = 60
    frequency, ratio = np.empty(n_draws), np.empty(n_draws)
    for draw in range(n_draws):
        rng = np.random.default_rng(draw)
        record = decay(3.0, 0.01, 20.0, phase=float(draw))
        estimate = method(record + noise * rng.normal(size=record.size), dt=DT)
        frequency[draw] = (estimate.frequency - 3.0) / estimate.frequency_error
        ratio[draw] = (estimate.damping_ratio - 0.01) / estimate.damping_ratio_error
    for score in (frequency, ratio):
        # For 60 normal draws the standard deviation is within 0.28 of one and the mean within 0.39 of zero, at 3 sigma;
        # the errors are of first order and slightly conservative.
        assert 0.65 < score.std() < 1.35
        assert abs(score.mean()) < 0.45


def test_both_methods_agree_on_the_one_storey_frame() -> None:
    frame = building("frame")
    record = decay(float(frame.frequencies[0]), float(frame.damping_ratios[0]), 20.0)
    for method in METHODS:
        estimate = method(record, dt=DT)
        assert estimate.frequency == pytest.approx(frame.frequencies[0], rel=1e-5)
        assert estimate.damping_ratio == pytest.approx(frame.damping_ratios[0], rel=1e-4)
    assert logarithmic_decrement(record, dt=DT).n_extremes > 50


def test_the_older_reading_of_the_half_power_width_passes_a_short_record_for_damping() -> None:
    # Half the width is no estimate: after 10 s the peak of a mode with 0.5 % is hardly wider than for a steady sine.
    record = decay(3.0, 0.005, 10.0)
    frequency = np.fft.rfftfreq(1 << 17, DT)
    power = np.abs(np.fft.rfft(record, 1 << 17)) ** 2
    above = frequency[power > power.max() / 2.0]
    assert (above[-1] - above[0]) / (2.0 * 3.0) > 2.5 * 0.005
    assert fourier_peak(record, dt=DT).damping_ratio == pytest.approx(0.005, rel=1e-3)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("record", "why"),
    [
        (decay(3.0, 0.0, 5.0), "damping does not show"),
        (decay(3.0, -0.01, 5.0), "grows"),
        (np.random.default_rng(6).normal(size=2000), "free vibration"),
    ],
)
def test_a_record_without_a_decay_is_refused(
    method: Callable[..., ModeEstimate], record: Floats, why: str
) -> None:
    with pytest.raises(RecordError, match=why):
        method(record, dt=DT)


def test_too_few_extremes_for_a_decrement_are_refused() -> None:
    with pytest.raises(RecordError, match="5 are needed"):
        logarithmic_decrement(decay(3.0, 0.5, 5.0), dt=DT)
