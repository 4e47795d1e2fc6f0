"""Free vibration: two methods recover a mode, agree with each other, and have correct standard errors."""

from __future__ import annotations

from collections.abc import Callable

import measured_data
import numpy as np
import pytest
from numpy.typing import NDArray
from sentences import Refused

from mrwork.buildings import Building, ModeEstimate, building, fourier_peak, logarithmic_decrement

Floats = NDArray[np.float64]

METHODS: tuple[Callable[..., ModeEstimate], ...] = (fourier_peak, logarithmic_decrement)
DATA = measured_data.DATA
ISOLATED = DATA / "buildings" / "bncs_LAC100.csv"
DT = 0.005


def decay(frequency: float, ratio: float, duration: float, phase: float = 0.4) -> Floats:
    """Free vibration of one mode with unit amplitude."""
    time = DT * np.arange(round(duration / DT))
    omega = 2.0 * np.pi * frequency
    damped = omega * np.sqrt(1.0 - ratio**2)
    return np.asarray(np.exp(-ratio * omega * time) * np.cos(damped * time - phase))


def released(frame: Building, shape: Floats, duration: float) -> Floats:
    """Displacement of the floors after a release, shape (n_time, n_floors)."""
    values, vectors = np.linalg.eig(frame.state_matrices()[0])
    start = np.concatenate([shape, np.zeros_like(shape)]).astype(complex)
    weights = np.linalg.solve(vectors, start)
    time = DT * np.arange(round(duration / DT))
    states = (np.exp(np.outer(time, values)) * weights) @ vectors.T
    return states.real[:, : shape.size] @ frame.floors.T


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


@pytest.mark.parametrize("method", METHODS)
def test_a_mode_is_told_from_others_by_its_band(method: Callable[..., ModeEstimate]) -> None:
    uts = building("uts")
    record = released(uts, np.array([0.0, 0.0, 1.0, 0.0, 0.0]), 30.0)[:, 4]
    record = record + 0.002 * np.random.default_rng(5).normal(size=record.size)
    for mode, band in enumerate([(2.0, 5.0), (6.0, 11.0), (11.5, 15.5)]):
        estimate = method(record, dt=DT, band=band)
        assert estimate.frequency == pytest.approx(uts.frequencies[mode], rel=2e-3)
        assert estimate.damping_ratio == pytest.approx(uts.damping_ratios[mode], rel=0.1)


def test_both_methods_agree_on_the_one_storey_frame() -> None:
    frame = building("frame")
    record = released(frame, np.ones(1), 20.0)[:, 0]
    by_peak, by_decrement = (method(record, dt=DT) for method in METHODS)
    for estimate in (by_peak, by_decrement):
        assert estimate.frequency == pytest.approx(frame.frequencies[0], rel=1e-5)
        assert estimate.damping_ratio == pytest.approx(frame.damping_ratios[0], rel=1e-4)
    # Ratio of two successive peaks of the same sign.
    assert np.exp(by_decrement.decrement) == pytest.approx(np.exp(2.0 * np.pi * 0.01), rel=1e-4)
    assert by_decrement.n_extremes > 50


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
    ("record", "band"),
    [
        (np.zeros(3), None),
        (np.zeros(0), None),
        (np.ones(100), None),
        (np.append(decay(3.0, 0.01, 5.0), np.nan), None),
        (decay(3.0, 0.01, 5.0), (4.0, 2.0)),
        (decay(3.0, 0.01, 5.0), (2.0, 101.0)),
        (decay(3.0, 0.01, 5.0), (5.0, 8.0)),
        (decay(3.0, 0.01, 5.0), (2.0, 2.0001)),
        (decay(3.0, 0.0, 5.0), None),
        (decay(3.0, -0.01, 5.0), None),
        (np.random.default_rng(6).normal(size=2000), None),
    ],
)
def test_a_record_without_a_mode_in_it_is_refused(
    method: Callable[..., ModeEstimate], record: Floats, band: tuple[float, float] | None, refused: Refused
) -> None:
    refused(method, record, dt=DT, band=band)


def test_a_step_that_is_not_positive_is_refused(refused: Refused) -> None:
    refused(fourier_peak, decay(3.0, 0.01, 5.0), dt=0.0)


def test_too_few_peaks_for_a_decrement_are_refused(refused: Refused) -> None:
    refused(logarithmic_decrement, decay(3.0, 0.5, 5.0), dt=DT)


@pytest.mark.skipif(
    not ISOLATED.is_file(), reason=f"the isolated building is not at {ISOLATED} (set MRWORK_DATA)"
)
@pytest.mark.parametrize("column", ["d1_m", "d6_m", "a6_mps2"])
def test_the_end_of_a_record_whose_ground_still_moves_is_not_taken_for_a_decay(
    column: str, refused: Refused
) -> None:
    record = np.genfromtxt(ISOLATED, delimiter=",", names=True)
    refused(fourier_peak, record[column][record["t_s"] >= 40.0], dt=DT)
