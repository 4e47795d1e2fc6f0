"""Records of damper tests that are honest, in every kind of motion, and the ways in which a record lies.

A new lie is a `Lie` in `LIES`; a new honest motion, its function in `MOTIONS`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

import mrwork as mr
from mrwork.dampers import damper, damper_models
from mrwork.errors import MrworkError
from mrwork.records import DamperTest, build_damper_test

Samples = NDArray[np.float64]
# Rate at which a damper is simulated, of which a record keeps a part [Hz].
_FINE = 10000


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """Stroke beside 10 mm, peak force [N], or that of the model at its nominal parameters, sampling and noise."""

    name: str
    stroke: float = 1.0
    force: float | None = None
    rate: int = 1000
    # Standard deviations, of the half ranges.
    noise: float = 3e-3
    noise_of_displacement: float = 3e-4
    has_velocity: bool = False


RIGS = (
    Rig(name="lab"),
    Rig(name="lab with velocity", has_velocity=True),
    Rig(name="no noise", noise=0.0, noise_of_displacement=0.0),
    Rig(name="noisy", noise=0.02, noise_of_displacement=2e-3),
    Rig(name="50 Hz", rate=50),
    Rig(name="10 kHz", rate=10000),
    Rig(name="200 kN", stroke=6.0, force=2e5, rate=200),
    Rig(name="400 kN", stroke=30.0, force=4e5, rate=200),
    Rig(name="prosthesis", stroke=0.3, force=60.0),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Columns of a record, as a file has them: SI, whatever the record says of itself."""

    time: Samples
    displacement: Samples
    force: Samples
    velocity: Samples | None = None
    current: Samples | float | None = None

    def test(self) -> DamperTest:
        """The record as it is read."""
        return build_damper_test(
            name="record",
            time=self.time,
            displacement=self.displacement,
            force=self.force,
            velocity=self.velocity,
            current=self.current,
        )


def _sine(t: Samples) -> Samples:
    return np.sin(2.0 * np.pi * t)


def _fast(t: Samples) -> Samples:
    return 0.25 * np.sin(2.0 * np.pi * 4.0 * t)


def _slow(t: Samples) -> Samples:
    return np.sin(2.0 * np.pi * 0.25 * t)


def _rest_before_and_after(t: Samples) -> Samples:
    inside = (t > 2.0) & (t < 6.0)
    return np.where(inside, np.sin(2.0 * np.pi * (t - 2.0)), 0.0)


def _decaying(t: Samples) -> Samples:
    return np.exp(-0.2 * t) * np.sin(2.0 * np.pi * t)


def _growing(t: Samples) -> Samples:
    return (0.1 + 0.9 * t / t[-1]) * np.sin(2.0 * np.pi * t)


def _triangle(t: Samples) -> Samples:
    return np.asarray(2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * 0.5 * t)))


def _trapezoid(t: Samples) -> Samples:
    """Constant velocity with a hold at either end."""
    return np.clip(2.0 * _triangle(t), -1.0, 1.0)


def _staircase(t: Samples) -> Samples:
    """Steps that an actuator drives in 50 ms, with holds of a second."""
    levels = np.array([0.0, 0.5, 1.0, 0.2, -0.6, -1.0, -0.3, 0.0, 0.0])
    within = np.clip((t % 1.0) / 0.05, 0.0, 1.0)
    at = np.minimum(t.astype(int), levels.size - 2)
    return levels[at] + (levels[at + 1] - levels[at]) * within**2 * (3.0 - 2.0 * within)


def _sudden_steps(t: Samples) -> Samples:
    """To and fro in 20 ms, which is within a sample at 50 Hz, and rest between."""
    within = np.clip((t % 1.0 - 0.5) / 0.02, 0.0, 1.0)
    side = np.where(t.astype(int) % 2, -1.0, 1.0)
    return side * (2.0 * within**2 * (3.0 - 2.0 * within) - 1.0)


def _chirp(t: Samples) -> Samples:
    return np.sin(2.0 * np.pi * (0.2 * t + 0.25 * t**2))


def _random(t: Samples) -> Samples:
    made = sum(
        np.sin(2.0 * np.pi * f * t + phase) / np.sqrt(f)
        for f, phase in zip(
            np.linspace(0.2, 5.0, 60), np.random.default_rng(4).uniform(0, 6.28, 60), strict=True
        )
    )
    return np.asarray(made / np.abs(made).max())


def _earthquake(t: Samples) -> Samples:
    """A burst and a long coda."""
    made = _random(t) * (1.0 - np.exp(-2.0 * t)) * np.exp(-0.6 * np.maximum(t - 1.5, 0.0))
    return np.asarray(made / np.abs(made).max())


def _late_earthquake(t: Samples) -> Samples:
    return np.where(t > 3.0, _earthquake(np.maximum(t - 3.0, 0.0)), 0.0)


def _sine_on_a_ramp(t: Samples) -> Samples:
    return 0.5 * _sine(t) + 2.0 * t / t[-1] - 1.0


def _fast_on_a_ramp(t: Samples) -> Samples:
    return 0.4 * np.sin(2.0 * np.pi * 2.0 * t) + 2.0 * t / t[-1] - 1.0


def _ramp(t: Samples) -> Samples:
    """Once through the stroke."""
    return 2.0 * t / t[-1] - 1.0


def _ramp_then_sine(t: Samples) -> Samples:
    return np.where(t < 2.0, 0.25 * t, 0.5 + 0.5 * np.sin(2.0 * np.pi * (t - 2.0)))


def _bursts(t: Samples) -> Samples:
    return np.where((t % 4.0) < 2.0, _sine(t), 0.0)


MOTIONS: tuple[Callable[[Samples], Samples], ...] = (
    _sine,
    _fast,
    _slow,
    _rest_before_and_after,
    _decaying,
    _growing,
    _triangle,
    _trapezoid,
    _staircase,
    _sudden_steps,
    _chirp,
    _random,
    _earthquake,
    _late_earthquake,
    _sine_on_a_ramp,
    _fast_on_a_ramp,
    _ramp,
    _ramp_then_sine,
    _bursts,
)
# With rest at an extreme of the stroke.
_AT_REST = (_trapezoid, _sudden_steps)
# A lie is looked for where a damper is driven to and fro for most of the record.
TO_AND_FRO = (_sine, _fast, _slow, _decaying, _triangle, _chirp, _random)
MODELS = tuple(spec.name for spec in damper_models())
_SECONDS = 8.0
_AMPLITUDE = 0.01


@cache
def _driven(model: str, motion: Callable[[Samples], Samples]) -> tuple[Samples, Samples, Samples, Samples]:
    """Time, displacement, velocity and force of a model at its nominal parameters."""
    time = np.arange(int(_SECONDS * _FINE) + 1) / _FINE
    displacement = _AMPLITUDE * motion(time)
    velocity = np.gradient(displacement, 1.0 / _FINE)
    spec = damper(model)
    force = mr.simulate_force(
        spec, spec.nominal, mr.Loading(dt=1.0 / _FINE, displacement=displacement, velocity=velocity)
    )
    return time, displacement, velocity, force


def honest(model: str, motion: Callable[[Samples], Samples], rig: Rig, rng: int = 0) -> Columns:
    """The record of a rig, as its sensors give it."""
    every = _FINE // rig.rate
    time, displacement, velocity, force = (samples[::every] for samples in _driven(model, motion))
    noise = np.random.default_rng(rng)

    def measured(samples: Samples, scale: float, share: float) -> Samples:
        return scale * (samples + share * np.abs(samples).max() * noise.standard_normal(samples.size))

    return Columns(
        time=time,
        displacement=measured(displacement, rig.stroke, rig.noise_of_displacement),
        force=measured(
            force, 1.0 if rig.force is None else rig.force / float(np.abs(force).max()), rig.noise
        ),
        velocity=measured(velocity, rig.stroke, rig.noise) if rig.has_velocity else None,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Lie:
    """A way in which a record lies: what is done to its columns, at each size, and the findings that tell of it."""

    name: str
    tell: Callable[[Columns, float], Columns]
    sizes: tuple[float, ...] = (1.0,)
    codes: tuple[str, ...]

    def is_told(self, columns: Columns) -> bool:
        """Whether a record that lies so is refused, or has a finding that tells of it."""
        try:
            findings = columns.test().findings
        except MrworkError:
            return True
        return any(finding.code in self.codes for finding in findings)


def _half(columns: Columns, share: float) -> slice:
    """A part in the middle of the record."""
    n_time = columns.time.size
    return slice(int(n_time * (0.5 - 0.5 * share)), int(n_time * (0.5 + 0.5 * share)))


def _stuck(columns: Columns, share: float, channel: str) -> Columns:
    samples = getattr(columns, channel).copy()
    part = _half(columns, share)
    samples[part] = samples[part.start]
    return replace(columns, **{channel: samples})


def _stuck_with_noise(columns: Columns, share: float) -> Columns:
    samples = columns.displacement.copy()
    part = _half(columns, share)
    noise = np.random.default_rng(8).standard_normal(part.stop - part.start)
    samples[part] = samples[part.start] + 1e-4 * np.ptp(samples) * noise
    return replace(columns, displacement=samples)


def _jump(columns: Columns, share: float) -> Columns:
    """By a share of half the stroke."""
    size = share * 0.5 * np.ptp(columns.displacement)
    after = np.arange(columns.time.size) >= int(0.437 * columns.time.size)
    return replace(columns, displacement=columns.displacement + size * after)


def _drift(columns: Columns, share: float) -> Columns:
    """By a share of the rms velocity."""
    motion = np.gradient(columns.displacement, columns.time)
    rate = share * float(np.std(np.convolve(motion, np.full(5, 0.2), mode="same")))
    return replace(columns, displacement=columns.displacement + rate * columns.time)


def _scaled(columns: Columns, factor: float, channel: str) -> Columns:
    return replace(columns, **{channel: factor * getattr(columns, channel)})


def _coarse(columns: Columns, share: float, channel: str) -> Columns:
    step = share * 0.5 * float(np.ptp(getattr(columns, channel)))
    return replace(columns, **{channel: step * np.round(getattr(columns, channel) / step)})


def _copied_half(columns: Columns, _: float) -> Columns:
    half = columns.time.size // 2

    def twice(samples: Samples) -> Samples:
        return np.concatenate([samples[:half], samples[:half]])

    return replace(
        columns,
        time=columns.time[: 2 * half],
        displacement=twice(columns.displacement),
        force=twice(columns.force),
        velocity=None if columns.velocity is None else twice(columns.velocity),
    )


def _held(columns: Columns, n_held: float, channel: str) -> Columns:
    at = np.arange(columns.time.size)
    return replace(columns, **{channel: getattr(columns, channel)[at - at % int(n_held)]})


def _late(columns: Columns, seconds: float) -> Columns:
    return replace(columns, force=np.interp(columns.time - seconds, columns.time, columns.force))


def _clipped(columns: Columns, share: float) -> Columns:
    middle, half = 0.5 * (columns.force.max() + columns.force.min()), 0.5 * float(np.ptp(columns.force))
    return replace(columns, force=np.clip(columns.force, middle - share * half, middle + share * half))


def _swapped(columns: Columns, _: float) -> Columns:
    return replace(columns, displacement=columns.force, force=columns.displacement)


def _displacement_is_velocity(columns: Columns, _: float) -> Columns:
    return replace(columns, displacement=np.gradient(columns.displacement, columns.time))


def _force_is_displacement(columns: Columns, _: float) -> Columns:
    return replace(columns, force=1e5 * columns.displacement)


def _force_is_noise(columns: Columns, _: float) -> Columns:
    return replace(columns, force=np.random.default_rng(3).standard_normal(columns.time.size))


def _offset(columns: Columns, share: float) -> Columns:
    return replace(columns, force=columns.force + share * 0.5 * float(np.ptp(columns.force)))


def _another_force(columns: Columns, _: float) -> Columns:
    return replace(columns, force=np.interp(0.73 * columns.time, columns.time, columns.force))


def _with_velocity(change: Callable[[Samples], Samples]) -> Callable[[Columns, float], Columns]:
    def tell(columns: Columns, _: float) -> Columns:
        return replace(columns, velocity=change(np.gradient(columns.displacement, columns.time)))

    return tell


def _saturated(velocity: Samples) -> Samples:
    top = 0.6 * float(np.percentile(np.abs(velocity), 99.0))
    return np.clip(velocity, -top, top)


def _current_in_milliamperes(columns: Columns, amperes: float) -> Columns:
    return replace(columns, current=np.full(columns.time.size, 1000.0 * amperes))


def _cut_out(columns: Columns, share: float) -> Columns:
    """A part is missing and the time goes on, as where two records are joined."""
    kept = np.ones(columns.time.size, dtype=bool)
    kept[int(0.437 * kept.size) : int((0.437 + share) * kept.size)] = False
    n_kept = int(kept.sum())
    return replace(
        columns,
        time=columns.time[:n_kept],
        displacement=columns.displacement[kept],
        force=columns.force[kept],
        velocity=None if columns.velocity is None else columns.velocity[kept],
    )


LIES = (
    Lie(
        name="the displacement stands still",
        tell=lambda columns, share: _stuck(columns, share, "displacement"),
        sizes=(0.25, 0.5, 0.75),
        codes=("displacement_still",),
    ),
    Lie(
        name="the displacement is noise for a part",
        tell=_stuck_with_noise,
        sizes=(0.25, 0.5, 0.75),
        codes=("displacement_still",),
    ),
    Lie(
        name="the force stands still",
        tell=lambda columns, share: _stuck(columns, share, "force"),
        sizes=(0.25, 0.5, 0.75),
        codes=("force_still",),
    ),
    Lie(name="the displacement jumps", tell=_jump, sizes=(0.1, 0.3, 0.7, 1.5), codes=("displacement_jumps",)),
    Lie(
        name="the displacement drifts",
        tell=_drift,
        sizes=(0.03, 0.1, 0.3),
        codes=("displacement_drifts",),
    ),
    Lie(
        name="the displacement is in another unit",
        tell=lambda columns, factor: _scaled(columns, factor, "displacement"),
        sizes=(1e-3, 1e3),
        codes=("displacement_unusual", "time_unusual"),
    ),
    Lie(
        name="the force is in another unit",
        tell=lambda columns, factor: _scaled(columns, factor, "force"),
        sizes=(1e-3, 1e3),
        codes=("force_unusual", "displacement_unusual"),
    ),
    Lie(
        name="the time is in another unit",
        tell=lambda columns, factor: _scaled(columns, factor, "time"),
        sizes=(1e-3, 1e3),
        codes=("time_unusual",),
    ),
    Lie(
        name="the force is coarse",
        tell=lambda columns, share: _coarse(columns, share, "force"),
        sizes=(0.06, 0.15, 0.35, 0.6),
        codes=("coarse",),
    ),
    Lie(
        name="the displacement is coarse",
        tell=lambda columns, share: _coarse(columns, share, "displacement"),
        sizes=(0.06, 0.15, 0.35),
        codes=("coarse",),
    ),
    Lie(
        name="the second half is the first", tell=_copied_half, codes=("part_repeated", "displacement_jumps")
    ),
    Lie(
        name="the force is held",
        tell=lambda columns, n_held: _held(columns, n_held, "force"),
        sizes=(2.0, 10.0),
        codes=("held_samples",),
    ),
    Lie(
        name="the displacement is held",
        tell=lambda columns, n_held: _held(columns, n_held, "displacement"),
        sizes=(2.0, 10.0),
        codes=("held_samples",),
    ),
    Lie(name="a part is cut out", tell=_cut_out, sizes=(0.05, 0.1), codes=("displacement_jumps",)),
    Lie(
        name="the sign of the force",
        tell=lambda columns, _: _scaled(columns, -1.0, "force"),
        codes=("force_sign_flipped",),
    ),
    Lie(name="the force is late", tell=_late, sizes=(0.01, 0.03), codes=("force_delay", "moving_mass")),
    Lie(name="the force is early", tell=_late, sizes=(-0.01, -0.03), codes=("force_delay", "moving_mass")),
    Lie(name="the force is clipped", tell=_clipped, sizes=(0.5, 0.8), codes=("clipped",)),
    Lie(
        name="displacement and force are swapped",
        tell=_swapped,
        codes=("displacement_unusual", "force_unusual", "force_sign_unclear", "time_unusual"),
    ),
    Lie(
        name="the displacement is the velocity", tell=_displacement_is_velocity, codes=("force_sign_unclear",)
    ),
    Lie(name="the force is the displacement", tell=_force_is_displacement, codes=("force_sign_unclear",)),
    Lie(
        name="the force is noise",
        tell=_force_is_noise,
        codes=("force_sign_unclear", "force_unusual"),
    ),
    Lie(name="the force is of another test", tell=_another_force, codes=("force_sign_unclear",)),
    Lie(name="the force has an offset", tell=_offset, sizes=(0.3, 1.0), codes=("force_offset",)),
    Lie(
        name="the velocity is in mm/s",
        tell=_with_velocity(lambda velocity: 1000.0 * velocity),
        codes=("velocity_factor", "velocity_inconsistent"),
    ),
    Lie(
        name="the velocity is saturated",
        tell=_with_velocity(_saturated),
        codes=("clipped", "velocity_inconsistent", "velocity_noisy"),
    ),
    Lie(
        name="the current is in mA",
        tell=_current_in_milliamperes,
        sizes=(0.05, 0.5),
        codes=("command_unusual",),
    ),
)
"""Ways in which a record lies."""

# Findings of lies alone; others an honest record may have, too.
TELLING = frozenset(
    {
        "displacement_still",
        "displacement_jumps",
        "displacement_drifts",
        "displacement_unusual",
        "force_still",
        "force_unusual",
        "time_unusual",
        "command_unusual",
        "coarse",
        "held_samples",
        "part_repeated",
        "clipped",
    }
)


def honest_records(
    models: tuple[str, ...] = MODELS,
    motions: tuple[Callable[[Samples], Samples], ...] = MOTIONS,
    rigs: tuple[Rig, ...] = RIGS,
) -> Iterator[tuple[str, Columns]]:
    """Honest records with what they are of: the models by motion and rig.

    No actuator drives a large damper within a sample. Without noise, rest at an extreme and a force of friction alone
    are what a clipped channel is.
    """
    for model, motion, rig in product(models, motions, rigs):
        if (motion is _sudden_steps and rig.stroke > 1.0) or (
            rig.noise == 0.0 and (motion in _AT_REST or model == "dahl")
        ):
            continue
        yield f"{model}, {motion.__name__.strip('_')}, {rig.name}", honest(model, motion, rig)
