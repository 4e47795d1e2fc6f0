"""Pulses of a driver in the column of the command are told and averaged; switching that the damper follows is not."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from record_files import codes, message, write_test

import mrwork as mr
from mrwork.records import DamperTest, repair
from mrwork.records.reading import Reading

Signal = NDArray[np.float64]
COIL = 25.0
SECONDS = 12.0
TIME = 0.002 * np.arange(6000)


def coil(sent: Signal, dt: float, rate: float = COIL) -> Signal:
    """First-order lag of a held command."""
    current, share = np.zeros(sent.size), -np.expm1(-rate * dt)
    for index in range(1, sent.size):
        current[index] = current[index - 1] + share * (sent[index - 1] - current[index - 1])
    return current


SEVERAL = (0.43, 0.77, 1.13, 1.61, 2.2, 2.9)


def rig(recorded: Signal, current: Signal, dt: float, frequencies: tuple[float, ...] = SEVERAL) -> DamperTest:
    """A damper that is none of the package's, in a motion of these frequencies, with noise of sensors."""
    rng, time = np.random.default_rng(5), dt * np.arange(recorded.size)
    omega = 2.0 * np.pi * np.array(frequencies)[:, np.newaxis]
    amplitude = 0.008 * np.array([1.0, 0.8, 0.7, 0.5, 0.3, 0.2])[: len(frequencies), np.newaxis]
    phase = omega * time + np.arange(float(len(frequencies)))[:, np.newaxis] ** 2
    displacement, velocity = (amplitude * np.sin(phase)).sum(0), (amplitude * omega * np.cos(phase)).sum(0)
    friction = (150.0 + 900.0 * current) * np.arctan((velocity + 0.5 * displacement) / 0.008) * 2.0 / np.pi
    force = friction + (300.0 + 500.0 * current) * velocity / (1.0 + np.abs(velocity) / 0.3)
    return mr.test_from_arrays(
        name="rig",
        time=time,
        displacement=displacement + 5e-6 * rng.standard_normal(time.size),
        force=force + 4.0 * rng.standard_normal(time.size),
        current=recorded,
    )


def pulsed(
    carrier: float, sampled: float, widths: tuple[float, ...] = (0.3, 0.6)
) -> tuple[DamperTest, Signal]:
    """A rig whose command was recorded as pulses, and their true width, which changes every two seconds."""
    time = np.arange(int(SECONDS * sampled)) / sampled
    width = np.array(widths)[(time / 2.0).astype(int) % len(widths)]
    return rig(
        1.0 * ((carrier * time + 0.137) % 1.0 < width), coil(width, 1.0 / sampled), 1.0 / sampled
    ), width


@pytest.mark.parametrize(
    ("carrier", "sampled"),
    [
        (50.0, 1000.0),
        (120.0, 1000.0),
        (100.0, 500.0),
        (250.0, 500.0),
        (1003.0, 500.0),
        (1007.0, 500.0),
        (1234.567, 500.0),
    ],
)
def test_pulses_are_told_though_the_samples_show_few_of_them(carrier: float, sampled: float) -> None:
    test, _ = pulsed(carrier, sampled)
    told = message(test, "command_pulsed")
    assert "between zero and 1 A" in told
    assert "--repair pulses" in told


@pytest.mark.parametrize("carrier", [1001.0, 1003.0])
def test_pulses_whose_alias_is_in_step_with_a_sine_are_told(carrier: float) -> None:
    """Of odd multiples: those of even ones are alike in both halves, as the command of a law that knows the motion."""
    for begins in (0.0, 0.25, 0.6):
        shown = 1.0 * ((carrier * TIME + begins) % 1.0 < 0.3)
        assert "command_pulsed" in codes(rig(shown, np.full(TIME.size, 0.3), 0.002, (1.0,)))
        followed = coil(shown, 0.002)
        assert "command_pulsed" not in codes(rig(shown, followed, 0.002, (1.0,)))


def test_pulses_without_a_carrier_are_told() -> None:
    rng = np.random.default_rng(8)
    width = np.full(6000, 0.4)
    test = rig(1.0 * (rng.uniform(size=width.size) < width), coil(width, 0.002), 0.002)
    assert "command_pulsed" in codes(test)
    mean = np.asarray(repair(test, ["pulses"])[0].current)
    # Of 40 to 80 samples that are on by chance.
    assert np.std(mean - 0.4) < np.sqrt(0.24 / 40.0)


RANDOM = np.random.default_rng(6)


@pytest.mark.parametrize(
    ("command", "rate"),
    [
        (1.0 * (np.sin(2.0 * np.pi * 0.9 * TIME) * np.sin(2.0 * np.pi * 1.3 * TIME) > 0.0), COIL),
        (1.0 * (TIME % 0.5 < 0.25), COIL),
        (1.0 * (3.1 * TIME % 1.0 < 0.3), 500.0),
        (1.0 * (5.0 * TIME % 1.0 < 0.5), 10.0),
        (1.0 * RANDOM.integers(0, 2, 200)[(TIME / 0.1).astype(int)], COIL),
        (1.0 * RANDOM.integers(0, 2, 200)[(TIME / 0.2).astype(int)], 10.0),
        (0.5 + 0.02 * RANDOM.standard_normal(TIME.size), COIL),
        (0.5 + 0.5 * np.sin(2.0 * np.pi * 8.0 * TIME), COIL),
    ],
    ids=["bang-bang", "2 Hz", "short", "slow coil", "random 0.1 s", "random 0.2 s", "constant", "sine"],
)
def test_a_command_that_the_damper_follows_is_not_told(command: Signal, rate: float) -> None:
    assert "command_pulsed" not in codes(rig(command, coil(command, 0.002, rate), 0.002))


# The alias of 1249 Hz at 500 Hz has two samples in a period and a beat of half a second.
@pytest.mark.parametrize(
    ("carrier", "sampled"), [(50.0, 1000.0), (47.0, 1000.0), (1003.0, 500.0), (1249.0, 500.0)]
)
def test_the_repair_gives_the_width_of_the_pulses(carrier: float, sampled: float) -> None:
    test, width = pulsed(carrier, sampled)
    repaired, (entry,) = repair(test, ["pulses"])
    assert {"command_pulsed", "command_varies"}.isdisjoint(codes(repaired))
    assert repaired.original is test
    assert entry.measured is not None
    away = int(entry.measured.value * sampled)
    steps = np.flatnonzero(np.diff(width))
    settled = np.min(np.abs(np.arange(width.size) - steps[:, np.newaxis]), axis=0) > away
    # An edge may lie anywhere between two samples, and a window in a period of 21.3 samples.
    np.testing.assert_allclose(np.asarray(repaired.current)[settled], width[settled], atol=0.035)
    assert f"above {1.0 / entry.measured.value:.2g} 1/s is not known" in entry.message


def test_the_mean_of_pulses_of_one_width_is_a_constant_command() -> None:
    repaired, _ = repair(pulsed(1003.0, 500.0, (0.4,))[0], ["pulses"])
    assert repaired.current == pytest.approx(0.4, abs=0.01)


def test_a_carrier_in_time_with_the_samples_leaves_the_mean_open() -> None:
    test, _ = pulsed(100.0, 500.0)
    assert "show 5 phases of a period, which give the mean to 1/5 only" in message(test, "command_pulsed")
    repaired, _ = repair(test, ["pulses"])
    assert np.ptp(repaired.current) == pytest.approx(0.4)


def test_pulses_are_averaged_before_samples_are_left_out(tmp_path: Path) -> None:
    test, width = pulsed(50.0, 1000.0)
    file = str(write_test(tmp_path / "rig.csv", test))
    (thinned,) = Reading(files=(file,), every=10, repairs={"pulses": None}).tests()
    assert thinned.n_time == test.n_time / 10
    assert np.mean(np.abs(np.asarray(thinned.current) - width[5::10]) < 0.01) > 0.98


def test_a_command_without_pulses_is_not_averaged() -> None:
    command = 1.0 * np.random.default_rng(9).integers(0, 2, 200)[(TIME / 0.1).astype(int)]
    test = rig(command, coil(command, 0.002), 0.002)
    same, (entry,) = repair(test, ["pulses"])
    assert entry.code == "no_pulses"
    np.testing.assert_array_equal(same.current, command)


@pytest.mark.parametrize(("carrier", "sampled", "known"), [(50.0, 1000.0, True), (1003.0, 500.0, False)])
def test_a_lag_that_the_mean_of_pulses_hides_is_not_identifiable(
    carrier: float, sampled: float, known: bool
) -> None:
    repaired, _ = repair(pulsed(carrier, sampled)[0], ["pulses"])
    laws = {"f_c": "linear", "c0": "linear"}
    spec = mr.damper("bingham").with_current_laws(laws, unit="A", lag="one_rate")
    lag = mr.identify(spec, repaired, rng=1, threads=1).parameters["eta"]
    assert (lag.verdict.word != "not identifiable") is known
    assert known or "mean of pulses over" in lag.verdict.reason
