"""A moving average of the record is part of the model by default, in the fit and in what follows from it."""

from contextlib import closing
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import measured_data
import numpy as np
import pytest

import mrwork as mr
from mrwork import Journal
from mrwork.base.remark import warnings_of
from mrwork.identification.result import free_run
from mrwork.records import DamperTest, Observation, cut, observed
from mrwork.records.damper_test import Smoothing
from mrwork.records.observation import AS_IT_IS
from mrwork.uncertainty import predict

UTFSM = measured_data.DATA / "dampers" / "utfsm"
WINDOW = 61
CLEAN = mr.synthetic_test("spencer1997")
NOMINAL = {"k_w": 650.0, "sigma": 0.5, "n": 2.0, "k": 2500.0, "x0": 0.038}
HELD = {name: (value, value) for name, value in NOMINAL.items()}
identify = partial(mr.identify, "normalised_bouc_wen", bounds=HELD, threads=1)


def recorded(seconds: slice = slice(None)) -> DamperTest:
    """The clean test as a rig would write it that averages force and motion."""
    weights = np.full(WINDOW, 1.0 / WINDOW)
    x, v, force = (
        np.convolve(samples, weights, mode="valid")[seconds]
        for samples in (CLEAN.displacement, CLEAN.velocity, CLEAN.force)
    )
    return mr.test_from_arrays(
        name="recorded", time=CLEAN.dt * np.arange(x.size), displacement=x, velocity=v, force=force
    )


def test_the_average_is_detected_by_default_and_left_out_on_request() -> None:
    test = recorded()
    averaged, plain = identify(test), identify(test, observe="none")
    assert averaged.quality[0].observation == Observation(average_seconds=WINDOW * test.dt)
    assert plain.quality[0].observation == AS_IT_IS
    assert averaged.fit_percent > plain.fit_percent + 1.0
    told = identify(replace(test, observation=averaged.quality[0].observation), observe="none")
    assert told.theta == averaged.theta


def test_the_average_describes_a_part_wherever_that_ends() -> None:
    true = mr.damper("bouc_wen")
    for end in (1.1, 1.2, 1.3):
        part = cut(recorded(), start=0.2, end=end)
        _, averaged = free_run(true, np.array(true.nominal), observed(part, ["detect"]))
        _, plain = free_run(true, np.array(true.nominal), part)
        assert averaged.nrmse < 0.2 * plain.nrmse


@pytest.mark.skipif(not UTFSM.is_dir(), reason=f"measured records are not at {UTFSM} (set MRWORK_DATA)")
def test_the_average_of_a_measured_record_improves_its_fit_wherever_the_part_ends() -> None:
    part = cut(mr.read_damper_test(UTFSM / "10mm1Hz0x75A.csv"), start=0.5, end=6.5, every=8)
    averaged, plain = (
        mr.identify("elasto_visco_plastic", part, observe=observe, threads=1)
        for observe in ("detect", "none")
    )
    assert averaged.nrmse < 0.75 * plain.nrmse
    assert not about_averages(averaged)


def about_averages(fit: mr.Fit) -> list[mr.Remark]:
    return [each for each in fit.remarks if each.code == "average_needless"]


@cache
def fooled() -> DamperTest:
    """The clean test with an average that was found in it though there is none."""
    smoothing = Smoothing(window_seconds=0.08, channels=("force", "displacement"))
    return replace(CLEAN, name="fooled", path="", smoothing=smoothing)


def test_an_average_without_which_the_fit_is_better_is_named_kept_and_replayed(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    with closing(Journal(path)) as journal:
        fit = identify(fooled(), journal=journal)
    assert fit.quality[0].observation == Observation(average_seconds=0.08)
    (warning,) = about_averages(fit)
    assert warning.measured is not None
    assert warning.measured.value == pytest.approx(0.08)
    without = identify(fooled(), observe="none")
    assert f"{without.fit_percent:.1f}" in warning.message
    assert f"% instead of {fit.fit_percent:.2f} %" in warning.message
    assert not warnings_of(without.remarks)
    written = path.read_bytes()
    with closing(Journal(path, resume=True)) as journal:
        again = identify(fooled(), journal=journal)
    assert (again.theta, again.remarks) == (fit.theta, fit.remarks)
    assert path.read_bytes() == written


def test_several_tests_name_the_one_that_is_better_without_its_average() -> None:
    fit = identify([recorded(slice(None, 1000)), fooled().part(900, CLEAN.n_time)])
    assert [each.words for each in about_averages(fit)] == [("fooled",)]


def test_an_average_that_is_in_the_record_or_was_given_is_not_doubted() -> None:
    assert not warnings_of(identify(recorded()).remarks)
    given = identify(fooled(), observe="average=0.05")
    assert not about_averages(given)


def test_nothing_detected_is_none_to_the_bit() -> None:
    assert identify(CLEAN).theta == identify(CLEAN, observe="none").theta


def test_predictions_and_posteriors_use_the_observation_of_the_fit() -> None:
    first, second = recorded(slice(None, 1000)), recorded(slice(900, None))
    fit = identify(first)
    assert predict(fit, second).test.observation == Observation(average_seconds=WINDOW * first.dt)
