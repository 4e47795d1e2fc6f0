"""The observation model: from words to effects of a rig on a force, in the order of the rig."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from refusals import refusal

import mrwork as mr
from mrwork.identification import FitSettings
from mrwork.records import DamperTest, Observation, cut, observed
from mrwork.records.damper_test import Smoothing
from mrwork.records.observation import AS_IT_IS, AS_RECORDED, EFFECTS, Observing
from mrwork.records.reading import synthetic_test

WINDOW = 33
CLEAN = synthetic_test("spencer1997")


def averaged(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.convolve(samples, np.full(WINDOW, 1.0 / WINDOW), mode="valid")


@pytest.fixture(scope="module")
def smoothed() -> DamperTest:
    """As a rig would write it: the record went through a moving average before anyone read it."""
    return mr.test_from_arrays(
        name="smoothed",
        time=CLEAN.dt * np.arange(CLEAN.n_time - WINDOW + 1),
        displacement=averaged(CLEAN.displacement),
        velocity=averaged(CLEAN.velocity),
        force=averaged(CLEAN.force),
    )


def test_detect_averages_as_the_whole_record_was_also_on_a_part_of_it(smoothed: DamperTest) -> None:
    # Of every 16th sample the window has two, which no detector finds.
    for part in (smoothed, cut(smoothed, start=0.5, end=3.0), cut(smoothed, every=16)):
        assert observed(part, ["detect"]).observation == Observation(average_seconds=WINDOW * smoothed.dt)


def test_what_has_no_average_or_a_model_of_its_own_is_the_same_test(smoothed: DamperTest) -> None:
    assert observed(CLEAN, ["detect"]) is CLEAN
    assert observed(smoothed, ["none"]) is smoothed
    given = replace(smoothed, observation=Observation(gain=2.0))
    assert observed(given, ["detect"]) is given
    once = observed(smoothed, ["detect"])
    assert observed(once, ["detect"]) is once


def test_an_average_of_the_displacement_alone_leaves_the_force(smoothed: DamperTest) -> None:
    alone = Smoothing(window_seconds=0.1, channels=("displacement",))
    assert observed(replace(smoothed, smoothing=alone), ["detect"]).observation == AS_IT_IS


def test_values_are_given_in_seconds_or_periods(smoothed: DamperTest) -> None:
    test = replace(smoothed, frequency=2.0)
    found = observed(test, Observing.of(["average=0.25T", "lag=0.01", "delay=-0.002", "offset=-20"]))
    assert found.observation == Observation(
        average_seconds=0.125, lag_seconds=0.01, delay_seconds=-0.002, offset=-20.0
    )
    assert observed(test, Observing.of(["detect", "gain=1.1"])).observation == Observation(
        average_seconds=WINDOW * smoothed.dt, gain=1.1
    )


@pytest.mark.parametrize(
    "words",
    [["none"], ["average=0.1T", "lag=0.010"], ["offset=each", "detect", "mass=free"], ["weigh", "gain=1"]],
)
def test_what_is_observed_is_recorded_as_it_was_written(words: list[str]) -> None:
    settings = FitSettings(observe=words)
    assert settings.as_record()["observe"] == words
    assert FitSettings.of_record({"observe": words}) == settings


def test_an_effect_that_was_found_takes_the_place_of_what_was_asked_for() -> None:
    mass, lag = EFFECTS["mass"], EFFECTS["lag"]
    asked = Observing.of(["average=0.1T", "mass=free", "weigh", "offset=each"])
    assert (asked.free, asked.of_each, asked.weighs, asked.detects) == (
        (mass,),
        (EFFECTS["offset"],),
        True,
        False,
    )
    assert asked.to_fit == Observing.of(["mass=free", "weigh"])
    found = asked.with_effects({mass: 2.5, lag: None})
    assert found == Observing.of(["average=0.1T", "offset=each", "mass=2.5", "lag=free"])
    assert found.given(lambda: 0.5) == {"average_seconds": 0.05, "mass": 2.5}
    # What was compared as recorded is so, where nothing is given.
    assert AS_RECORDED.with_effects({}) == AS_RECORDED
    assert AS_RECORDED.to_fit == AS_RECORDED


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none", "detect"], "none and detect"),
        (["smooth"], "'smooth'; give detect, none, weigh, or mass=VALUE"),
        (["lowpass=0.1T"], "'0.1T' in --observe lowpass=0.1T is not a number"),
        (["gain=0"], "gain=0.*gain of an observation is 0"),
        (["average=1e9"], "average=1e9.*from 0 to 1e.06"),
    ],
)
def test_other_words_are_refused(words: list[str], said: str) -> None:
    refusal(Observing.of, words, match=said)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["average=100T"], "lasts 0.099 s"),
        (["lag=10"], "lasts 0.099 s"),
        (["delay=-10"], "lasts 0.099 s"),
        (["lowpass=500"], "nothing above 500 Hz"),
        (["gain=1.1", "gain=1.2"], "gain twice"),
    ],
)
def test_what_a_record_cannot_have_is_refused(words: list[str], said: str) -> None:
    short = replace(CLEAN.part(0, 100), frequency=1.0)
    refusal(observed, short, words, match=said)
    assert observed(short, ["lowpass=450"]).observation.lowpass_hz == 450.0


@pytest.mark.parametrize(
    ("observation", "word"),
    [
        (Observation(delay_seconds=-10.0), "`delay_seconds`.* lasts 0.099 s"),
        (Observation(lowpass_hz=1e5), "`lowpass_hz`.* nothing above 500 Hz"),
    ],
)
def test_a_model_of_its_own_that_the_record_cannot_have_is_refused(
    observation: Observation, word: str
) -> None:
    test = replace(CLEAN.part(0, 100), observation=observation)
    refusal(observed, test, ["detect"], match=word)
    refusal(mr.identify, "bingham", test, match=word)


@pytest.mark.parametrize(
    "observation",
    [
        Observation(average_seconds=WINDOW * CLEAN.dt),
        Observation(delay_seconds=12.3 * CLEAN.dt),
        Observation(delay_seconds=-12.3 * CLEAN.dt, average_seconds=0.05),
    ],
)
def test_of_a_part_all_samples_are_compared_that_do_not_need_the_rest(observation: Observation) -> None:
    whole = observation.observe(CLEAN.force, CLEAN.dt)
    part = replace(CLEAN.part(500, 1500), observation=observation, n_settle=0)
    differs = np.abs(observation.observe(part.force, part.dt) - whole[500:1500]) > 1e-9 * np.ptp(whole)
    assert not differs[part.counted].any()
    before, after = part.counted.start, part.n_time - part.counted.stop
    # The window may reach beyond the record by less than a sample.
    assert differs[: max(before - 1, 0)].all()
    assert differs[part.n_time - max(after - 1, 0) :].all()
    assert before + after + part.n_counted == part.n_time


def test_a_record_of_which_the_average_leaves_nothing_is_refused() -> None:
    average = Observation(average_seconds=99 * CLEAN.dt)
    short = replace(CLEAN.part(0, 102), n_settle=60, observation=average)
    refusal(mr.identify, "bingham", short, match="none of its 102 samples is compared")


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


def test_a_lag_has_the_amplitude_and_the_phase_of_first_order() -> None:
    lag = 0.012
    amplitude, phase = amplitude_and_phase(Observation(lag_seconds=lag).observe(SINE, DT))
    turn = 2.0 * np.pi * FREQUENCY * lag
    # The sine is straight between samples.
    assert amplitude == pytest.approx(1.0 / np.hypot(1.0, turn), rel=1e-3)
    assert phase == pytest.approx(-np.arctan(turn), abs=1e-3)


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
