"""The observation model applies the effects of a rig to a force, and refuses impossible settings."""

from __future__ import annotations

import numpy as np
import pytest
from sentences import Refused

from mrwork.records import AS_IT_IS, Observation

DT = 1e-3
TIME = DT * np.arange(4000)
FREQUENCY = 2.0
SINE = np.sin(2.0 * np.pi * FREQUENCY * TIME)
INSIDE = slice(1000, 3000)


def amplitude_and_phase(signal: np.ndarray) -> tuple[float, float]:
    """Amplitude and phase of the component at `FREQUENCY`, over whole periods."""
    phase = 2.0 * np.pi * FREQUENCY * TIME[INSIDE]
    component = 2.0 * np.mean(signal[INSIDE] * np.exp(-1j * phase))
    return float(abs(component)), float(np.angle(component) + np.pi / 2)


def test_nothing_done_is_the_same_array() -> None:
    assert AS_IT_IS.observe(SINE, DT) is SINE


@pytest.mark.parametrize("window", [0.05, 0.0503, 0.3])
def test_an_average_weakens_a_sine_by_its_transfer_function(window: float) -> None:
    # Linear interpolation between samples reduces it by a further (omega dt)^2 / 12 = 1.3e-5.
    amplitude, phase = amplitude_and_phase(Observation(average_seconds=window).observe(SINE, DT))
    assert amplitude == pytest.approx(abs(np.sinc(FREQUENCY * window)), abs=3e-5)
    assert phase == pytest.approx(0.0, abs=1e-9)


def test_an_average_keeps_straight_lines_and_constants() -> None:
    line = 3.0 + 2.0 * TIME
    averaged = Observation(average_seconds=0.05).observe(line, DT)
    np.testing.assert_allclose(averaged[INSIDE], line[INSIDE], rtol=1e-12)
    np.testing.assert_allclose(
        Observation(average_seconds=0.05).observe(np.full(50, 7.0), DT), 7.0, rtol=1e-12
    )


@pytest.mark.parametrize("delay", [0.004, 0.0043, -0.0021])
def test_a_delay_moves_a_sine(delay: float) -> None:
    amplitude, phase = amplitude_and_phase(Observation(delay_seconds=delay).observe(SINE, DT))
    assert amplitude == pytest.approx(1.0, abs=3e-5)
    assert phase == pytest.approx(-2.0 * np.pi * FREQUENCY * delay, abs=1e-4)


def test_a_low_pass_halves_the_power_at_its_corner() -> None:
    amplitude, _ = amplitude_and_phase(Observation(lowpass_hz=FREQUENCY).observe(SINE, DT))
    assert amplitude == pytest.approx(np.sqrt(0.5), abs=1e-3)
    assert np.array_equal(Observation(lowpass_hz=0.6 / DT).observe(SINE, DT), SINE), "beyond Nyquist"


def test_gain_and_offset_come_last() -> None:
    observed = Observation(average_seconds=0.05, gain=2.0, offset=5.0).observe(SINE, DT)
    expected = 2.0 * Observation(average_seconds=0.05).observe(SINE, DT) + 5.0
    np.testing.assert_array_equal(observed, expected)


@pytest.mark.parametrize("samples", [1e-300, 1e-9, 0.9e-3, 1.1e-3])
def test_an_average_much_shorter_than_a_sample_changes_nothing(samples: float) -> None:
    # A quarter of the window times the change between samples, at an end of the record.
    change = 0.25 * samples * np.abs(np.diff(SINE)).max()
    averaged = Observation(average_seconds=samples * DT).observe(SINE, DT)
    np.testing.assert_allclose(averaged, SINE, rtol=0.0, atol=1.01 * change + 1e-11)


def test_rows_are_observed_as_they_are_alone() -> None:
    observation = Observation(delay_seconds=2.5e-3, lowpass_hz=40.0, average_seconds=0.031, gain=1.1)
    rows = np.stack([SINE, SINE**3, np.cos(TIME)])
    together = observation.observe(rows, DT)
    for row, alone in zip(together, rows, strict=True):
        np.testing.assert_allclose(row, observation.observe(alone, DT), rtol=0, atol=1e-14)


def test_what_no_rig_does_is_refused(refused: Refused) -> None:
    for values in (
        *({"average_seconds": -1.0}, {"gain": 0.0}, {"delay_seconds": np.inf}, {"lowpass_hz": np.nan}),
        *({"lowpass_hz": 1e-4}, {"average_seconds": 1e9}, {"gain": 1e30}, {"offset": -1e50}),
    ):
        refused(Observation, **values)
