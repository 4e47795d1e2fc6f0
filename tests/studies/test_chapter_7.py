"""The study of chapter 7 in its quick form, and properties of what it finds."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from result_tables import assert_filled

import mrwork as mr
from studies.chapter_7.controlled_tests import CLIPPED, NO_DAMPER_NAME, OFF, QUANTITIES, figures
from studies.chapter_7.earthquakes import LEAD, command, synthetic
from studies.chapter_7.findings import Chapter, chapter_of
from studies.chapter_7.frame_tests import figures_of
from studies.chapter_7.page import error_figure, history_figure, loop_figure, sine_figure
from studies.chapter_7.predictions import ALL_TRUE, FULL
from studies.chapter_7.sine_tests import Wanted, damper_test, sine_command, sine_tests
from studies.chapter_7.tables import tables
from studies.chapter_7.virtual_rig import (
    FRAME,
    NO_GAIN_ERRORS,
    SENSORS,
    TABLE,
    recorded,
    signals_of,
    true_rig,
)
from studies.common.command import Work
from studies.common.expected import departures


@pytest.fixture(scope="module")
def chapter() -> Chapter:
    return chapter_of(Work(quick=True, threads=1))


def test_the_quick_form_finds_what_is_expected(chapter: Chapter) -> None:
    assert departures(chapter.found, Path("studies/chapter_7/expected.toml")) == []


def test_every_table_names_its_rows_and_fills_them(chapter: Chapter) -> None:
    assert_filled(chain(*tables(chapter.found).values()))


def test_the_frame_is_found_within_its_standard_errors(chapter: Chapter) -> None:
    assert all(abs(each) < 4.0 for each in figures_of(chapter.frame)["in_errors"].values())
    assert chapter.frame.frame.mass[0, 0] != FRAME.mass[0, 0]


def test_a_true_rig_misses_the_measurements_by_their_sensors_alone(chapter: Chapter) -> None:
    true = chapter.campaign.predictions[ALL_TRUE]
    for case, runs in chapter.campaign.tests.items():
        for record, measured in runs.items():
            signals = true[case][record]
            error = measured.displacement - SENSORS.displacement.gain * signals.displacement
            # White noise and the rounding of the sensor, over many thousand samples.
            wide = np.hypot(SENSORS.displacement.noise, SENSORS.displacement.resolution / np.sqrt(12.0))
            assert np.std(error) == pytest.approx(wide, rel=0.05)


def test_prediction_and_tests_are_of_equal_commands_but_other_noise(chapter: Chapter) -> None:
    predicted = chapter.campaign.predictions[FULL]
    (record,) = predicted[OFF]
    tested = chapter.campaign.predictions[ALL_TRUE]
    assert not np.array_equal(predicted[CLIPPED][record].current, tested[CLIPPED][record].current)
    # Without a damper only the table's recorded motion and the frame differ, by half a percent of the sensor.
    peaks = [figures(each[NO_DAMPER_NAME][record])["peak displacement"] for each in (predicted, tested)]
    assert peaks[0] == pytest.approx(peaks[1], rel=0.02)


def test_control_is_scored_against_no_current(chapter: Chapter) -> None:
    ratios = chapter.found[chapter.kind]["tests"]["ratios"]
    assert ratios[OFF] == dict.fromkeys(QUANTITIES, 1.0)
    assert all(each > 1.5 for each in ratios[NO_DAMPER_NAME].values())


def test_a_sine_command_stays_about_the_middle_of_the_table() -> None:
    motion = sine_command(2.0, 2.0)
    amplitude = 2.0 / (2.0 * np.pi * 2.0) ** 2
    assert np.abs(motion.displacement).max() == pytest.approx(amplitude, rel=0.02)
    assert abs(motion.displacement[-1]) < 0.01 * amplitude
    assert np.abs(motion.acceleration[-500:]).max() == pytest.approx(2.0, rel=1e-3)


def test_a_command_begins_and_ends_at_rest_and_keeps_what_the_frame_answers() -> None:
    motion = synthetic(3, 10.0)
    passed = command(motion)
    assert np.abs(passed.velocity[-1]) < 1e-9
    assert np.abs(passed.displacement[-1]) < 1e-9
    rest = round(LEAD / motion.dt)
    # The frame's frequency passes with a gain of 0.9996.
    spectra = [np.fft.rfft(each, 4096) for each in (motion.acceleration, passed.acceleration[rest:])]
    near = abs(np.fft.rfftfreq(4096, motion.dt) - 3.0) < 0.3
    assert np.linalg.norm(spectra[1][near] - spectra[0][near]) < 0.02 * np.linalg.norm(spectra[0][near])
    assert TABLE.demand(passed).stroke < 0.5 * TABLE.demand(motion).stroke


def test_the_force_of_a_sine_test_is_that_of_the_damper_on_its_motion() -> None:
    rig = true_rig()
    (measured,) = sine_tests(rig, [Wanted(current=0.25, frequency=3.0, peak=2.0)], None, threads=1)
    test = damper_test(measured)
    loading = mr.Loading(
        dt=test.dt, displacement=test.displacement, velocity=test.velocity, command=0.25, command_unit="A"
    )
    force = mr.simulate_force(rig.damper.spec, rig.damper.draws[0], loading)
    # Where friction changes sign, within 10 mm/s, a velocity of 25 harmonics is as good as this.
    assert np.std(test.force - force) < 0.02 * np.std(force)


def test_sensors_read_with_their_gain_noise_and_resolution() -> None:
    still = mr.GroundMotion(name="still", dt=1e-3, acceleration=np.zeros(2001))
    (signals,) = signals_of(true_rig(), mr.ControlLaw(name="passive", gains={"command": [0.5]}), [still])
    signals = replace(signals, force=np.full(signals.time.size, 1000.0))
    seen = recorded(signals, np.random.default_rng(1))
    # Four standard errors of the mean.
    assert seen.force.mean() == pytest.approx(1010.0, abs=4.0 * 5.0 / np.sqrt(seen.time.size))
    assert np.all(seen.force == np.round(seen.force))
    assert recorded(signals, np.random.default_rng(1), NO_GAIN_ERRORS).force.mean() < 1001.0


def test_figures_are_drawn(chapter: Chapter) -> None:
    campaign = chapter.campaign
    (record,) = campaign.tests[OFF]
    for figure in (
        history_figure(campaign.tests[OFF][record], campaign.tests[CLIPPED][record]),
        sine_figure(campaign.sines, campaign.predicted_sines),
        loop_figure(campaign.damper),
        error_figure(chapter),
    ):
        assert all(axes.lines for axes in figure.axes)
