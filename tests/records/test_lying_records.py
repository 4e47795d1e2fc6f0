"""Records that lie are told, and honest records of every kind of motion and of every model have no such remark."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Self

import measured_data
import numpy as np
import pytest
from numpy.typing import NDArray
from record_files import codes, message

import mrwork as mr
from mrwork.records.checks import clipped_samples, coarse_step

DATA = measured_data.DATA / "dampers"
Samples = NDArray[np.float64]
# Rate at which a damper is simulated, of which a record keeps every tenth sample or less [Hz].
FINE = 10_000
# Remarks of lies alone; others an honest record may have, too.
TELLING = {
    *("displacement_still", "displacement_jumps", "displacement_drifts", "displacement_unusual", "clipped"),
    *("force_still", "force_unusual", "time_unusual", "command_unusual", "coarse", "held_samples"),
    "part_repeated",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Columns of a record, as a file has them: SI, whatever the record says of itself."""

    time: Samples
    displacement: Samples
    force: Samples
    velocity: Samples | None = None
    current: Samples | float | None = None

    def test(self) -> mr.DamperTest:
        channels = {field.name: getattr(self, field.name) for field in fields(self)}
        return mr.test_from_arrays(name="record", **channels)

    def says(self) -> set[str]:
        """The remarks that tell of a lie, or a refusal."""
        try:
            return set(codes(self.test()))
        except mr.MrworkError:
            return {"refused"}

    def both(self, change: Callable[[Samples], Samples]) -> Self:
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


def earthquake(t: Samples) -> Samples:
    """A burst and a long coda."""
    phases = np.random.default_rng(4).uniform(0, 6.28, 60)
    pairs = zip(np.linspace(0.2, 5.0, 60), phases, strict=True)
    random = sum(np.sin(2.0 * np.pi * f * t + phase) / np.sqrt(f) for f, phase in pairs)
    made = random * (1.0 - np.exp(-2.0 * t)) * np.exp(-0.6 * np.maximum(t - 1.5, 0.0))
    return np.asarray(made / np.abs(made).max())


# Stroke beside its half, over 8 s.
MOTIONS: dict[str, Callable[[Samples], Samples]] = {
    "sine": sine,
    "fast": lambda t: 0.25 * sine(t, 4.0),
    "rest before and after": lambda t: np.where((t > 2.0) & (t < 6.0), sine(t), 0.0),
    "decaying": lambda t: np.exp(-0.2 * t) * sine(t),
    "trapezoid": lambda t: np.clip(2.0 * triangle(t), -1.0, 1.0),
    "staircase": staircase,
    # To and fro in 20 ms, and rest between.
    "sudden steps": lambda t: (
        np.where(t.astype(int) % 2, -1.0, 1.0) * (2.0 * smooth(t % 1.0 - 0.5, 0.02) - 1.0)
    ),
    "chirp": lambda t: np.sin(2.0 * np.pi * (0.2 * t + 0.25 * t**2)),
    "late earthquake": lambda t: np.where(t > 3.0, earthquake(np.maximum(t - 3.0, 0.0)), 0.0),
    "sine on a ramp": lambda t: 0.5 * sine(t) + t / 4.0 - 1.0,
    "ramp": lambda t: t / 4.0 - 1.0,
    "bursts": lambda t: np.where((t % 4.0) < 2.0, sine(t), 0.0),
}


@cache
def driven(model: str, motion: str) -> tuple[Samples, Samples, Samples]:
    """Time, displacement of 10 mm and force of a model at its nominal parameters."""
    time = np.arange(8 * FINE + 1) / FINE
    x = 0.01 * MOTIONS[motion](time)
    loading = mr.Loading(dt=1.0 / FINE, displacement=x, velocity=np.gradient(x, 1.0 / FINE))
    return time, x, mr.simulate_force(mr.damper(model), mr.damper(model).nominal, loading)


def honest(
    model: str, motion: str, *, stroke: float = 1.0, peak: float | None = None, rate: int = 1000
) -> Columns:
    """The record of a rig with a little noise: its stroke beside 10 mm, peak force [N] and rate [Hz]."""
    time, displacement, force = (samples[:: FINE // rate] for samples in driven(model, motion))
    noise = np.random.default_rng(0)

    def measured(samples: Samples, scale: float, share: float) -> Samples:
        return scale * (samples + share * np.abs(samples).max() * noise.standard_normal(samples.size))

    return Columns(
        time=time,
        displacement=measured(displacement, stroke, 3e-4),
        force=measured(force, 1.0 if peak is None else peak / float(np.abs(force).max()), 3e-3),
    )


PLAIN = honest("bouc_wen", "sine")
TIME, MOVED, PULLED = PLAIN.time, PLAIN.displacement, PLAIN.force
PLACE = np.arange(TIME.size) / TIME.size
SPEED = np.gradient(MOVED, TIME)
SCATTER = np.random.default_rng(8).standard_normal(TIME.size)


def stuck(samples: Samples, noise: float = 0.0) -> Samples:
    """Still in the middle of a record, but for noise."""
    part = np.abs(PLACE - 0.5) < 0.125
    return np.where(part, samples[part][0] + noise * np.ptp(samples) * SCATTER, samples)


def coarse(samples: Samples, share: float) -> Samples:
    step = share * 0.5 * float(np.ptp(samples))
    return step * np.round(samples / step)


def held(samples: Samples) -> Samples:
    at = np.arange(samples.size)
    return samples[at - at % 2]


def cut_out() -> Columns:
    """A part is missing and the time goes on, as where two records are joined."""
    kept = np.abs(PLACE - 0.462) >= 0.025
    return replace(PLAIN.both(lambda samples: samples[kept]), time=TIME[: kept.sum()])


def twice() -> Columns:
    half = TIME.size // 2
    return replace(PLAIN.both(lambda samples: np.tile(samples[:half], 2)), time=TIME[: 2 * half])


def clipped(samples: Samples, share: float) -> Samples:
    middle, half = 0.5 * (samples.max() + samples.min()), 0.5 * float(np.ptp(samples))
    return np.clip(samples, middle - share * half, middle + share * half)


# What is done to the columns, and one of which remarks tells of it.
LIES: dict[str, tuple[Columns | dict[str, Samples], set[str]]] = {
    "the displacement stands still": ({"displacement": stuck(MOVED)}, {"displacement_still"}),
    "the displacement is noise for a part": ({"displacement": stuck(MOVED, 1e-4)}, {"displacement_still"}),
    "the force stands still": ({"force": stuck(PULLED)}, {"force_still"}),
    "the displacement jumps": ({"displacement": MOVED + 1e-3 * (PLACE >= 0.437)}, {"displacement_jumps"}),
    "the displacement drifts": (
        {"displacement": MOVED + 0.03 * np.std(SPEED) * TIME},
        {"displacement_drifts"},
    ),
    "the displacement is in mm": ({"displacement": 1e3 * MOVED}, {"displacement_unusual"}),
    "the displacement is in km": ({"displacement": 1e-3 * MOVED}, {"displacement_unusual"}),
    "the force is in kN": ({"force": 1e-3 * PULLED}, {"force_unusual", "displacement_unusual"}),
    "the force is in mN": ({"force": 1e3 * PULLED}, {"force_unusual", "displacement_unusual"}),
    "the time is in ms": ({"time": 1e3 * TIME}, {"time_unusual"}),
    "the time is in ks": ({"time": 1e-3 * TIME}, {"time_unusual"}),
    "the force is coarse": ({"force": coarse(PULLED, 0.06)}, {"coarse"}),
    "the displacement is coarse": ({"displacement": coarse(MOVED, 0.06)}, {"coarse"}),
    "the second half is the first": (twice(), {"part_repeated"}),
    "the force is held": ({"force": held(PULLED)}, {"held_samples"}),
    "the displacement is held": ({"displacement": held(MOVED)}, {"held_samples"}),
    "a part is cut out": (cut_out(), {"displacement_jumps"}),
    "the sign of the force": ({"force": -PULLED}, {"force_sign_flipped"}),
    "the force is late": ({"force": np.interp(TIME - 0.01, TIME, PULLED)}, {"force_delay", "moving_mass"}),
    # A force that is early by less than its hysteresis is not told in a sine.
    "the force is early": ({"force": np.interp(TIME + 0.03, TIME, PULLED)}, {"force_delay", "moving_mass"}),
    "the force is clipped": ({"force": clipped(PULLED, 0.8)}, {"clipped"}),
    "displacement and force are swapped": (
        {"displacement": PULLED, "force": MOVED},
        {"displacement_unusual", "force_unusual"},
    ),
    "the displacement is the velocity": ({"displacement": SPEED}, {"force_sign_unclear", "moving_mass"}),
    "the force is the displacement": ({"force": 1e5 * MOVED}, {"force_sign_unclear"}),
    "the force has an offset": ({"force": PULLED + 0.15 * np.ptp(PULLED)}, {"force_offset"}),
    "the velocity is in mm/s": ({"velocity": 1e3 * SPEED}, {"velocity_factor"}),
    "the velocity is saturated": (
        {"velocity": clipped(SPEED, 0.6)},
        {"clipped", "velocity_inconsistent", "velocity_noisy"},
    ),
    "the current is in mA": ({"current": np.full(TIME.size, 50.0)}, {"command_unusual"}),
}


@pytest.mark.parametrize("lie", LIES)
def test_a_lie_of_a_plain_sine_is_told(lie: str) -> None:
    told, wanted = LIES[lie]
    assert wanted & (told if isinstance(told, Columns) else replace(PLAIN, **told)).says()


@pytest.mark.parametrize("model", ["bouc_wen", "dahl"])
def test_honest_records_of_every_motion_have_no_remark_of_a_lie(model: str) -> None:
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
    told = {spec.name: honest(spec.name, "sine").says() & TELLING for spec in mr.damper_models()}
    assert {name: found for name, found in told.items() if found} == {}


@pytest.mark.long
@pytest.mark.skipif(not DATA.is_dir(), reason=f"measured damper records are not at {DATA} (set MRWORK_DATA)")
def test_measured_records_have_no_remark_of_a_lie() -> None:
    tests = mr.read_damper_tests([DATA / "utfsm", DATA / "labcontrol"])
    assert {test.name: found for test in tests if (found := TELLING & set(codes(test)))} == {}


STILL = np.where(np.arange(TIME.size) < 4000, MOVED, MOVED[4000])
PEAK = np.abs(PULLED).max()
SIZES: dict[str, tuple[dict[str, Samples], str]] = {
    "displacement_still": ({"displacement": STILL}, "for 3.99 s, first from 4.01 s on"),
    "displacement_jumps": ({"displacement": MOVED + 7e-3 * (TIME > 3.0)}, "at 3 s: that is 7."),
    "displacement_drifts": ({"displacement": MOVED + 5e-3 * TIME}, "+5 mm/s, +40 mm over the record"),
    "displacement_unusual": ({"displacement": 0.5e-3 * MOVED}, "spans 10 um"),
    "force_unusual": ({"force": 1.1e6 / PEAK * PULLED}, "reaches 1.1 MN"),
    "time_unusual": ({"time": 1000.0 / 1.5 * TIME}, "has 0.0015 Hz"),
    "coarse": (
        {"force": 400.0 * np.round(1150.0 / PEAK * PULLED / 400.0)},
        "steps of 400 N, 40 % of its half range of 1000 N",
    ),
}


@pytest.mark.parametrize("code", SIZES)
def test_a_lie_is_told_with_its_size(code: str) -> None:
    told, size = SIZES[code]
    test = replace(PLAIN, **told).test()
    assert size in message(test, code)
    assert "clipped" not in codes(test)


def test_the_largest_damper_is_honest_and_a_small_stroke_of_a_mount_too() -> None:
    columns = honest("bouc_wen", "sine", stroke=30.0, peak=4e5, rate=200)
    assert not TELLING & columns.says()
    short = replace(columns, displacement=0.25e-3 / np.abs(columns.displacement).max() * columns.displacement)
    assert not TELLING & replace(short, time=0.01 * columns.time, force=0.001 * columns.force).says()


@pytest.mark.parametrize("share", [0.002, 0.01, 0.03])
@pytest.mark.parametrize("rate", [1, 10])
def test_a_rounded_sine_is_not_clipped(share: float, rate: int) -> None:
    motion = np.sin(2.0 * np.pi * 0.001 * rate * np.arange(8000))
    read = share * np.round(motion / share)
    assert not clipped_samples(read).any()
    assert clipped_samples(np.clip(read, -0.7, 0.7)).mean() > 0.3 or coarse_step(read) is not None
