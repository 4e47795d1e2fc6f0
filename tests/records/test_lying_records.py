"""Records that lie are told, and honest records of every kind of motion and of every model have no such finding."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import measured_data
import numpy as np
import pytest
from command_line import mrwork, printed
from numpy.typing import NDArray
from record_files import codes, message, write_text
from scipy.io import savemat

import mrwork as mr
from mrwork.dampers import damper, damper_models
from mrwork.errors import MrworkError
from mrwork.records import DamperTest, build_damper_test, read_damper_tests
from mrwork.records.checks import clipped_share, coarse_step

DATA = measured_data.DATA / "dampers"
Samples = NDArray[np.float64]
# Rate at which a damper is simulated, of which a record keeps every tenth sample or less [Hz].
FINE = 10_000
# Findings of lies alone; others an honest record may have, too.
TELLING = {
    *(
        "displacement_still",
        "displacement_jumps",
        "displacement_drifts",
        "displacement_unusual",
        "force_still",
    ),
    *(
        "force_unusual",
        "time_unusual",
        "command_unusual",
        "coarse",
        "held_samples",
        "part_repeated",
        "clipped",
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Columns of a record, as a file has them: SI, whatever the record says of itself."""

    time: Samples
    displacement: Samples
    force: Samples
    velocity: Samples | None = None
    current: Samples | float | None = None

    def test(self) -> DamperTest:
        return build_damper_test(
            name="record",
            time=self.time,
            displacement=self.displacement,
            force=self.force,
            velocity=self.velocity,
            current=self.current,
        )

    def says(self) -> set[str]:
        """The findings that tell of a lie, or a refusal."""
        try:
            return set(codes(self.test()))
        except MrworkError:
            return {"refused"}

    def both(self, change: Callable[[Samples], Samples]) -> Columns:
        return replace(self, displacement=change(self.displacement), force=change(self.force))


def sine(t: Samples, frequency: float = 1.0) -> Samples:
    return np.sin(2.0 * np.pi * frequency * t)


def triangle(t: Samples) -> Samples:
    return np.asarray(2.0 / np.pi * np.arcsin(sine(t, 0.5)))


def smooth(t: Samples, seconds: float) -> Samples:
    """From 0 to 1 in so many seconds."""
    within = np.clip(t / seconds, 0.0, 1.0)
    return within**2 * (3.0 - 2.0 * within)


def staircase(t: Samples) -> Samples:
    """Steps that an actuator drives in 50 ms, with holds of a second."""
    levels = np.array([0.0, 0.5, 1.0, 0.2, -0.6, -1.0, -0.3, 0.0, 0.0])
    at = np.minimum(t.astype(int), levels.size - 2)
    return levels[at] + (levels[at + 1] - levels[at]) * smooth(t % 1.0, 0.05)


def random(t: Samples) -> Samples:
    phases = np.random.default_rng(4).uniform(0, 6.28, 60)
    pairs = zip(np.linspace(0.2, 5.0, 60), phases, strict=True)
    made = sum(np.sin(2.0 * np.pi * f * t + phase) / np.sqrt(f) for f, phase in pairs)
    return np.asarray(made / np.abs(made).max())


def earthquake(t: Samples) -> Samples:
    """A burst and a long coda."""
    made = random(t) * (1.0 - np.exp(-2.0 * t)) * np.exp(-0.6 * np.maximum(t - 1.5, 0.0))
    return np.asarray(made / np.abs(made).max())


# Stroke beside its half, over 8 s.
MOTIONS: dict[str, Callable[[Samples], Samples]] = {
    "sine": sine,
    "fast": lambda t: 0.25 * sine(t, 4.0),
    "slow": lambda t: sine(t, 0.25),
    "rest before and after": lambda t: np.where((t > 2.0) & (t < 6.0), sine(t), 0.0),
    "decaying": lambda t: np.exp(-0.2 * t) * sine(t),
    "growing": lambda t: (0.1 + 0.9 * t / 8.0) * sine(t),
    "triangle": triangle,
    "trapezoid": lambda t: np.clip(2.0 * triangle(t), -1.0, 1.0),
    "staircase": staircase,
    # To and fro in 20 ms, and rest between.
    "sudden steps": lambda t: (
        np.where(t.astype(int) % 2, -1.0, 1.0) * (2.0 * smooth(t % 1.0 - 0.5, 0.02) - 1.0)
    ),
    "chirp": lambda t: np.sin(2.0 * np.pi * (0.2 * t + 0.25 * t**2)),
    "random": random,
    "earthquake": earthquake,
    "late earthquake": lambda t: np.where(t > 3.0, earthquake(np.maximum(t - 3.0, 0.0)), 0.0),
    "sine on a ramp": lambda t: 0.5 * sine(t) + t / 4.0 - 1.0,
    "fast on a ramp": lambda t: 0.4 * sine(t, 2.0) + t / 4.0 - 1.0,
    "ramp": lambda t: t / 4.0 - 1.0,
    "ramp then sine": lambda t: np.where(t < 2.0, 0.25 * t, 0.5 + 0.5 * sine(t)),
    "bursts": lambda t: np.where((t % 4.0) < 2.0, sine(t), 0.0),
}


@cache
def driven(model: str, motion: str) -> tuple[Samples, Samples, Samples]:
    """Time, displacement of 10 mm and force of a model at its nominal parameters."""
    time = np.arange(8 * FINE + 1) / FINE
    displacement = 0.01 * MOTIONS[motion](time)
    loading = mr.Loading(
        dt=1.0 / FINE, displacement=displacement, velocity=np.gradient(displacement, 1.0 / FINE)
    )
    return time, displacement, mr.simulate_force(damper(model), damper(model).nominal, loading)


def honest(
    model: str, motion: str, *, stroke: float = 1.0, peak: float | None = None, rate: int = 1000, rng: int = 0
) -> Columns:
    """The record of a rig with a little noise: its stroke beside 10 mm, peak force [N] and rate [Hz]."""
    time, displacement, force = (samples[:: FINE // rate] for samples in driven(model, motion))
    noise = np.random.default_rng(rng)

    def measured(samples: Samples, scale: float, share: float) -> Samples:
        return scale * (samples + share * np.abs(samples).max() * noise.standard_normal(samples.size))

    return Columns(
        time=time,
        displacement=measured(displacement, stroke, 3e-4),
        force=measured(force, 1.0 if peak is None else peak / float(np.abs(force).max()), 3e-3),
    )


def plain() -> Columns:
    return honest("bouc_wen", "sine")


def stuck(samples: Samples, share: float, noise: float = 0.0) -> Samples:
    """Still in the middle of a record, but for noise."""
    at = np.arange(samples.size)
    part = np.abs(at - 0.5 * at.size) < 0.5 * share * at.size
    scatter = noise * np.ptp(samples) * np.random.default_rng(8).standard_normal(at.size)
    return np.where(part, samples[part][0] + scatter, samples)


def jumped(samples: Samples, share: float) -> Samples:
    return samples + share * 0.5 * np.ptp(samples) * (np.arange(samples.size) >= 0.437 * samples.size)


def coarse(samples: Samples, share: float) -> Samples:
    step = share * 0.5 * float(np.ptp(samples))
    return step * np.round(samples / step)


def held(samples: Samples, count: float) -> Samples:
    at = np.arange(samples.size)
    return samples[at - at % int(count)]


def without(columns: Columns, share: float) -> Columns:
    """A part is missing and the time goes on, as where two records are joined."""
    at = np.arange(columns.time.size) / columns.time.size
    kept = (at < 0.437) | (at >= 0.437 + share)
    return replace(columns.both(lambda samples: samples[kept]), time=columns.time[: kept.sum()])


def twice(columns: Columns) -> Columns:
    half = columns.time.size // 2
    again = columns.both(lambda samples: np.tile(samples[:half], 2))
    return replace(again, time=columns.time[: 2 * half])


def clipped(samples: Samples, share: float) -> Samples:
    middle, half = 0.5 * (samples.max() + samples.min()), 0.5 * float(np.ptp(samples))
    return np.clip(samples, middle - share * half, middle + share * half)


def speed(columns: Columns) -> Samples:
    return np.gradient(columns.displacement, columns.time)


def of_displacement(change: Callable[[Samples, float], Samples]) -> Callable[[Columns, float], Columns]:
    return lambda columns, size: replace(columns, displacement=change(columns.displacement, size))


def of_force(change: Callable[[Samples, float], Samples]) -> Callable[[Columns, float], Columns]:
    return lambda columns, size: replace(columns, force=change(columns.force, size))


def late(columns: Columns, seconds: float) -> Columns:
    return replace(columns, force=np.interp(columns.time - seconds, columns.time, columns.force))


def drifting(columns: Columns, share: float) -> Columns:
    """By a share of the rms velocity."""
    rate = share * float(np.std(np.convolve(speed(columns), np.full(5, 0.2), mode="same")))
    return replace(columns, displacement=columns.displacement + rate * columns.time)


def saturated(columns: Columns, _: float) -> Columns:
    top = 0.6 * float(np.percentile(np.abs(speed(columns)), 99.0))
    return replace(columns, velocity=np.clip(speed(columns), -top, top))


def scaled(samples: Samples, factor: float) -> Samples:
    return factor * samples


# What is done to the columns, at which sizes, and one of which findings tells of it.
LIES: dict[str, tuple[Callable[[Columns, float], Columns], tuple[float, ...], set[str]]] = {
    "the displacement stands still": (of_displacement(stuck), (0.25, 0.75), {"displacement_still"}),
    "the displacement is noise for a part": (
        of_displacement(lambda samples, share: stuck(samples, share, 1e-4)),
        (0.25, 0.75),
        {"displacement_still"},
    ),
    "the force stands still": (of_force(stuck), (0.25, 0.75), {"force_still"}),
    "the displacement jumps": (of_displacement(jumped), (0.1, 1.5), {"displacement_jumps"}),
    "the displacement drifts": (drifting, (0.03, 0.3), {"displacement_drifts"}),
    "the displacement is in another unit": (of_displacement(scaled), (1e-3, 1e3), {"displacement_unusual"}),
    "the force is in another unit": (
        of_force(scaled),
        (1e-3, 1e3),
        {"force_unusual", "displacement_unusual"},
    ),
    "the time is in another unit": (
        lambda columns, factor: replace(columns, time=factor * columns.time),
        (1e-3, 1e3),
        {"time_unusual"},
    ),
    "the force is coarse": (of_force(coarse), (0.06, 0.6), {"coarse"}),
    "the displacement is coarse": (of_displacement(coarse), (0.06, 0.35), {"coarse"}),
    "the second half is the first": (lambda columns, _: twice(columns), (1.0,), {"part_repeated"}),
    "the force is held": (of_force(held), (2.0, 10.0), {"held_samples"}),
    "the displacement is held": (of_displacement(held), (2.0, 10.0), {"held_samples"}),
    "a part is cut out": (without, (0.05, 0.1), {"displacement_jumps"}),
    "the sign of the force": (of_force(scaled), (-1.0,), {"force_sign_flipped"}),
    # A force that is early by less than its hysteresis is not told in a sine.
    "the force is late": (late, (0.01, 0.03, -0.03), {"force_delay", "moving_mass"}),
    "the force is clipped": (of_force(clipped), (0.5, 0.8), {"clipped"}),
    "displacement and force are swapped": (
        lambda columns, _: replace(columns, displacement=columns.force, force=columns.displacement),
        (1.0,),
        {"displacement_unusual", "force_unusual"},
    ),
    "the displacement is the velocity": (
        lambda columns, _: replace(columns, displacement=speed(columns)),
        (1.0,),
        {"force_sign_unclear"},
    ),
    "the force is the displacement": (
        lambda columns, _: replace(columns, force=1e5 * columns.displacement),
        (1.0,),
        {"force_sign_unclear"},
    ),
    "the force has an offset": (
        of_force(lambda samples, share: samples + share * 0.5 * float(np.ptp(samples))),
        (0.3, 1.0),
        {"force_offset"},
    ),
    "the velocity is in mm/s": (
        lambda columns, factor: replace(columns, velocity=factor * speed(columns)),
        (1e3,),
        {"velocity_factor"},
    ),
    "the velocity is saturated": (saturated, (1.0,), {"clipped", "velocity_inconsistent", "velocity_noisy"}),
    "the current is in mA": (
        lambda columns, ampere: replace(columns, current=np.full(columns.time.size, 1e3 * ampere)),
        (0.05, 0.5),
        {"command_unusual"},
    ),
}


@pytest.mark.parametrize("lie", LIES)
def test_a_lie_of_a_plain_sine_is_told(lie: str) -> None:
    tell, sizes, wanted = LIES[lie]
    assert {
        size: tell(plain(), size).says() for size in sizes if not wanted & tell(plain(), size).says()
    } == {}


@pytest.mark.parametrize("model", ["bouc_wen", "dahl"])
def test_honest_records_of_every_motion_have_no_finding_of_a_lie(model: str) -> None:
    records = {motion: honest(model, motion) for motion in MOTIONS}
    # No actuator drives a large damper within a sample.
    large = {
        f"{motion}, 200 kN": honest(model, motion, stroke=6.0, peak=2e5, rate=200)
        for motion in MOTIONS
        if motion != "sudden steps"
    }
    told = {name: columns.says() & TELLING for name, columns in (records | large).items()}
    assert {name: found for name, found in told.items() if found} == {}


def test_every_model_is_honest_in_a_sine() -> None:
    told = {spec.name: honest(spec.name, "sine").says() & TELLING for spec in damper_models()}
    assert {name: found for name, found in told.items() if found} == {}


@pytest.mark.skipif(not DATA.is_dir(), reason=f"measured damper records are not at {DATA} (set MRWORK_DATA)")
def test_measured_records_have_no_finding_of_a_lie() -> None:
    tests = read_damper_tests([DATA / "utfsm", DATA / "labcontrol"])
    assert {test.name: found for test in tests if (found := TELLING & set(codes(test)))} == {}


def test_a_lie_is_told_with_its_size() -> None:
    columns = plain()
    time = columns.time
    still = columns.displacement.copy()
    still[4000:] = still[4000]
    sizes = {
        "displacement_still": (replace(columns, displacement=still), "for 3.98 s, first from 4.03 s on"),
        "displacement_jumps": (
            replace(columns, displacement=columns.displacement + 7e-3 * (time > 3.0)),
            "at 3 s: that is 7.",
        ),
        "displacement_drifts": (
            replace(columns, displacement=columns.displacement + 5e-3 * time),
            r"+5 mm/s, +40 mm over the record",
        ),
        "displacement_unusual": (replace(columns, displacement=0.5e-3 * columns.displacement), "spans 10 um"),
        "force_unusual": (
            replace(columns, force=1.1e6 / np.abs(columns.force).max() * columns.force),
            "reaches 1.1 MN",
        ),
        "time_unusual": (replace(columns, time=1000.0 / 1.5 * time), "has 0.0015 Hz"),
    }
    for code, (lying, size) in sizes.items():
        assert size in message(lying.test(), code)


@pytest.mark.parametrize(("stroke", "peak"), [(6.0, 2e5), (30.0, 4e5)])
def test_a_large_damper_is_honest_and_a_small_stroke_of_a_mount_too(stroke: float, peak: float) -> None:
    columns = honest("bouc_wen", "sine", stroke=stroke, peak=peak, rate=200)
    assert not TELLING & columns.says()
    short = replace(columns, displacement=0.25e-3 / np.abs(columns.displacement).max() * columns.displacement)
    assert not TELLING & replace(short, time=0.01 * columns.time, force=0.001 * columns.force).says()


def test_a_coarse_force_is_told_by_its_step_and_not_called_clipped() -> None:
    columns = plain()
    force = 1150.0 / np.abs(columns.force).max() * columns.force
    test = replace(columns, force=400.0 * np.round(force / 400.0)).test()
    assert codes(test) == ["velocity_derived", "force_offset", "coarse"]
    assert "steps of 400 N, 40 % of its half range of 1000 N" in message(test, "coarse")


@pytest.mark.parametrize("share", [0.002, 0.01, 0.03])
@pytest.mark.parametrize("rate", [1, 10])
def test_a_rounded_sine_is_not_clipped(share: float, rate: int) -> None:
    motion = np.sin(2.0 * np.pi * 0.001 * rate * np.arange(8000))
    read = share * np.round(motion / share)
    assert clipped_share(read) == 0.0 or coarse_step(read) is not None
    assert clipped_share(np.clip(read, -0.7, 0.7)) > 0.3


def test_a_force_that_stands_still_for_most_of_a_record_ends_no_check() -> None:
    columns = plain()
    force = columns.force.copy()
    force[500:7500] = force[500]
    assert "force_still" in replace(columns, force=force).says()


def test_the_range_of_a_command_agrees_with_that_of_other_tests(tmp_path: Path) -> None:
    for number, top in enumerate((2.69, 2.72)):
        columns = honest("bouc_wen", "sine", rng=number)
        volts = np.where(columns.time % 2.0 < 1.0, 0.0, top)
        # The driver rings below zero after each step.
        since = columns.time % 2.0
        volts[since < 0.03] = -0.45 * np.exp(-since[since < 0.03] / 0.008)
        channels = {"t_s": columns.time, "displacement_m": columns.displacement, "force_n": columns.force}
        write_text(tmp_path / f"test{number}.csv", {**channels, "voltage_v": volts})
    said = printed("check", tmp_path)
    assert "switches between 0 and 2.69 V, by 2.69 V; a model" in said
    assert "[numbers of test0; over these tests 2.69 to 2.72 V]" in said


def test_a_hint_for_one_file_of_a_folder_names_what_works_for_the_folder(tmp_path: Path) -> None:
    rig = tmp_path / "rig"
    rig.mkdir()
    columns, other = plain(), honest("bouc_wen", "fast")
    channels = {"t_s": columns.time, "displacement_m": columns.displacement, "force_n": columns.force}
    write_text(rig / "test.csv", channels)
    savemat(rig / "old.mat", {"zeit": other.time, "weg": 1e3 * other.displacement, "kraft": other.force})
    refused = mrwork("check", rig)
    assert refused.returncode == 2
    assert "--column time=zeit:s --column displacement=weg:mm --column force=kraft:N" in refused.stderr
    assert "table of tests" in refused.stderr
    # The options alone are for every file, and the other has other columns.
    options = ("--column", "time=zeit:s", "--column", "displacement=weg:mm", "--column", "force=kraft:N")
    assert "table of tests" in mrwork("check", rig, *options).stderr
    assert "table of tests" not in mrwork("check", rig / "old.mat").stderr
    printed("check", rig, "--table")
    table = rig / "tests.csv"
    table.write_text(table.read_text().replace("old.mat,fit,?,?,?", "old.mat,fit,zeit:s,weg:mm,kraft:N"))
    said = printed("check", rig)
    assert "old.mat: 8001 samples" in said
    assert "test.csv: 8001 samples" in said
