"""A law that is recorded has the bits of the same function called in Python; what is not recorded is told."""

import math
import pickle
import random
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from loop_samples import devices, five_storeys, rd1005, sweep
from refusals import refusal

import mrwork as mr
from mrwork.closed_loop import Fault, Hardware, LoopSample, Responses, UserLaw
from mrwork.closed_loop.recorded_law import LoopShape
from mrwork.closed_loop.rows_law import RowsLaw
from mrwork.dampers.simulation import Outcome

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
BROKEN = Fault(channel="deformation", index=0, start=0.2, end=0.3, value=np.nan)
HARDWARE = {
    "plain": Hardware(measured_storeys=(0, 2)),
    "observer with noise and delay": Hardware(
        feedback="observer",
        acceleration_noise=0.01,
        force_noise=1.0,
        deformation_noise=1e-5,
        delay=2e-3,
        command_rate=100.0,
        measured_storeys=(0, 2),
    ),
    "a sensor that fails": Hardware(measured_storeys=(0, 2), faults=(BROKEN,)),
}
GAINS = np.array([1.0, 5.0, 10.0])
SPEEDS, SLOPES = np.array([0.0, 0.05, 0.1, 0.2]), np.array([0.0, 4.0, 9.0, 10.0])
WEIGHT = np.random.default_rng(1).normal(size=(2, 10))


def brake(sample: LoopSample, memory: Floats) -> Floats:
    return np.where(sample.force * sample.rate > 0.0, 10.0 * np.abs(sample.rate), 0.0)


def stroke(sample: LoopSample, memory: Floats) -> Floats:
    return np.clip(100.0 * np.abs(sample.deformation), 0.0, sample.largest)


def inner(sample: LoopSample, memory: Floats) -> Floats:
    """The comparison hides a reading that is not a number."""
    return np.where(np.abs(sample.deformation) < 1e-9, 0.0, sample.largest)


def scanned(sample: LoopSample, memory: Floats) -> Floats:
    return GAINS[sample.candidate, None] * np.abs(sample.rate)


def switched(sample: LoopSample, memory: Floats) -> Floats:
    size = np.abs(sample.drift)
    on = (size > 0.004) | ((memory > 0.0) & (size > 0.002))
    memory[:] = on
    return on * sample.largest


def ramp(sample: LoopSample, memory: Floats) -> Floats:
    memory += 1.0
    return np.minimum(1e-3 * memory[:, :1] + 0.1 * sample.time, sample.largest)


def filtered(sample: LoopSample, memory: Floats) -> Floats:
    memory[:, 0] += 1e-3 * (sample.acceleration[:, 0] - 2.0 * memory[:, 0])
    return np.interp(np.abs(sample.rate), SPEEDS, SLOPES) * np.abs(memory[:, :1])


def fading(sample: LoopSample, memory: Floats) -> Floats:
    assert sample.rms is not None
    return np.minimum(sample.rms.rate * 10.0 + sample.rms.acceleration[:, :1], sample.largest)


def mean_of_fifty(sample: LoopSample, memory: Floats) -> Floats:
    memory[:, 1:] = memory[:, :-1]
    memory[:, 0] = sample.acceleration[:, 0]
    return np.abs(memory.mean(axis=1))[:, None] * np.ones(2)


def of_state(sample: LoopSample, memory: Floats) -> Floats:
    return np.abs(sample.state @ WEIGHT.T)


def curved(sample: LoopSample, memory: Floats) -> Floats:
    return np.tanh(np.abs(sample.rate) ** 0.35) + 0.1 * np.exp(-np.abs(sample.deformation))


# The law, numbers of its memory, candidates, time of running means, and how near the numbers of Python are.
LAWS: dict[str, tuple[UserLaw, float]] = {
    "brake": (UserLaw(name="brake", command=brake), 0.0),
    "stroke": (UserLaw(name="stroke", command=stroke), 0.0),
    "inner": (UserLaw(name="inner", command=inner), 0.0),
    "scanned": (UserLaw(name="scanned", command=scanned, n_candidates=3), 0.0),
    "switched": (UserLaw(name="switched", command=switched, n_memory=2), 0.0),
    "ramp": (UserLaw(name="ramp", command=ramp, n_memory=1), 0.0),
    "filtered": (UserLaw(name="filtered", command=filtered, n_memory=1), 0.0),
    "fading": (UserLaw(name="fading", command=fading, rms_time=0.5), 0.0),
    "mean of fifty": (UserLaw(name="mean", command=mean_of_fifty, n_memory=50), 1e-12),
    "of state": (UserLaw(name="of state", command=of_state), 1e-12),
    "curved": (UserLaw(name="curved", command=curved), 1e-12),
}


def run(law: Any, hardware: Hardware, **settings: Any) -> Responses:
    loop = devices(rd1005(), second=True)
    return mr.simulate_loop(
        five_storeys(), loop, law, [sweep(0.5), sweep(0.7, peak=4.0)], hardware, **settings
    )


def assert_same(found: Responses, expected: Responses, near: float) -> None:
    np.testing.assert_array_equal(found.outcome, expected.outcome)
    for quantity in ("peak_drift", "rms_acceleration", "mean_current", "device_energy", "command_travel"):
        mine, its = getattr(found, quantity), getattr(expected, quantity)
        if near:
            np.testing.assert_allclose(mine, its, rtol=near)
        else:
            np.testing.assert_array_equal(mine, its)


@pytest.mark.parametrize("hardware", HARDWARE.values(), ids=HARDWARE)
@pytest.mark.parametrize("name", LAWS)
def test_a_recorded_law_has_the_bits_of_its_function(name: str, hardware: Hardware) -> None:
    law, near = LAWS[name]
    found = run(replace(law, record=True), hardware)
    assert_same(found, run(replace(law, record=False), hardware), near)
    assert found.law_remarks == ()
    assert found.mean_current.max() > 0.0


@pytest.mark.parametrize("name", ["scanned", "switched", "fading"])
def test_runs_share_nothing(name: str) -> None:
    law, hardware = replace(LAWS[name][0], record=True), HARDWARE["observer with noise and delay"]
    many = run(law, hardware, threads=2)
    assert_same(run(law, hardware, threads=1), many, 0.0)
    loop = devices(rd1005(), second=True)
    alone = mr.simulate_loop(
        five_storeys(), loop, law, [sweep(0.7, peak=4.0)], hardware, motion_numbers=[1], histories=True
    )
    np.testing.assert_array_equal(alone.peak_drift, many.peak_drift[1::2])


def test_a_loop_with_a_recorded_law_goes_to_another_process() -> None:
    law = LAWS["filtered"][0]
    shape = LoopShape(
        lengths={
            **dict.fromkeys(("displacement", "velocity", "acceleration"), 5),
            **dict.fromkeys(("deformation", "rate", "force"), 2),
            "ground_acceleration": None,
            "ground_velocity": None,
            "drift": 0,
        },
        largest=(1.88, 1.88),
        sample_time=1e-3,
    )
    recorded, settings = RowsLaw(formula=law.formula, settings=np.zeros((1, 0))).recorded(shape)
    assert pickle.loads(pickle.dumps(recorded)) == recorded
    assert settings.shape == (1, 0)
    # The law reads two rates and an acceleration, and keeps one number.
    assert [name for name, _, _ in recorded.inputs] == ["memory", "acceleration", "rate", "rate"]
    assert recorded.start == (0.0,)


@pytest.mark.parametrize("record", [True, False])
def test_a_reading_that_is_no_number_is_no_command(record: bool) -> None:
    law = replace(LAWS["inner"][0], record=record)
    found = run(law, HARDWARE["a sensor that fails"], histories=True)
    assert set(found.outcome) == {Outcome.FAILED_SAFE}
    history = found.histories[0]
    during = (history.time > 0.21) & (history.time < 0.29)
    assert set(history.command[during, 0]) == {0.0}
    assert history.command[~during, 0].max() == 1.88


@pytest.mark.parametrize("record", [True, False])
def test_a_sensor_that_a_law_does_not_read_may_fail(record: bool) -> None:
    found = run(replace(LAWS["brake"][0], record=record), HARDWARE["a sensor that fails"])
    assert set(found.outcome) == {Outcome.FINISHED}


def test_numbers_of_candidates_are_settings() -> None:
    law, hardware = replace(LAWS["scanned"][0], record=True), HARDWARE["plain"]
    many = run(law, hardware)
    for number, gain in enumerate(GAINS):
        one = UserLaw(name="one", command=lambda sample, memory, gain=gain: gain * np.abs(sample.rate))
        np.testing.assert_array_equal(run(one, hardware).peak_drift, many.peak_drift[2 * number :][:2])


seen: list[Any] = []


def looks(sample: LoopSample, memory: Floats) -> Floats:
    seen.append(sample.rate[0])
    return np.abs(sample.rate)


def branches(sample: LoopSample, memory: Floats) -> Floats:
    return np.abs(sample.rate) if sample.time > 0.1 else np.zeros_like(sample.rate)


def rolls_dice(sample: LoopSample, memory: Floats) -> Floats:
    return np.abs(sample.rate) * (0.5 + 0.0 * random.random() + 1e-9 * random.random())


def leaks(sample: LoopSample, memory: Floats) -> Floats:
    return np.abs(sample.rate) + 0.0 * len([seen.append(sample.rate)])  # type: ignore[func-returns-value]


def by_motion(sample: LoopSample, memory: Floats) -> Floats:
    return np.abs(sample.rate) * (1.0 + sample.motion[:, None])


def of_several(sample: LoopSample, memory: Floats) -> Floats:
    return np.abs(sample.rate) / (1.0 + 1e-3 * len(sample.rate))


NOT_RECORDED: dict[str, tuple[Callable[[LoopSample, Floats], Any], str]] = {
    "an effect": (looks, r"line \d+: it calls seen\.append and does not use the result"),
    "a branch": (branches, r"line \d+: `if`.*np\.where"),
    "chance": (rolls_dice, "another one each time"),
    "a reading that is kept": (leaks, "keeps a reading outside"),
    "the number of a motion": (by_motion, r"sample\.motion"),
    "several runs": (of_several, "several runs at once"),
}


@pytest.mark.parametrize("name", NOT_RECORDED)
def test_what_cannot_be_recorded_runs_in_python_and_says_why(name: str) -> None:
    function, reason = NOT_RECORDED[name]
    law = UserLaw(name="mine", command=function)
    refusal(run, replace(law, record=True), HARDWARE["plain"], match=rf"^mine cannot be recorded: .*{reason}")
    found = run(law, HARDWARE["plain"])
    (remark,) = found.law_remarks
    assert remark.code == "law_in_python"
    assert not math.isnan(found.peak_drift.max())


def broken(sample: LoopSample, memory: Floats) -> Floats:
    size = np.abs(sample.rate)
    found = np.where(size > 0.01, np.nan, size)
    return 2.0 * found


@pytest.mark.parametrize("record", [True, False])
def test_a_law_that_makes_no_number_of_numbers_is_named_with_the_line_that_does(record: bool) -> None:
    law = UserLaw(name="broken", command=broken, record=record)
    line = broken.__code__.co_firstlineno + 2
    refusal(
        run,
        law,
        HARDWARE["plain"],
        match=rf"^broken \(.*test_recorded_law.py, line \d+\) .* \(NaN\) for device .*, made in line {line},",
    )
