"""Checks of single channels: constant, clipped, coarse, held or averaged ones, sampling, rest, breakaway, sign, size.

A size that no damper test has tells a unit that is off by a thousand.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.numbers import in_newtons
from mrwork.base.remark import OF_FILES, ONCE, Measured, Remark, RemarkKind
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats
from mrwork.dampers.command import sample_runs
from mrwork.errors import RecordError
from mrwork.files.grid import last_digit
from mrwork.records.damper_test import Channel, DamperTest, Smoothing
from mrwork.records.motion import Differentiator, SmoothMotion, reversals, spectrum

_SMALLEST_RANGE: Final = 1e-9
_TINY: Final = float(np.finfo(np.float64).tiny)
_FEWEST_PER_CYCLE: Final = 20.0
_REST_EXCURSION: Final = 0.01
_REST_CYCLES: Final = 0.25
_OFFSET_SHARE: Final = 0.05
_SIGN_SHARE: Final = 0.05
_SIGN_SURE: Final = 0.25
# A motion turns back whose shorter way is at least this share of the longer one, and never does below the other one.
_BACK: Final = 0.5
_NEVER_BACK: Final = 0.05
# Speeds at which the forces out and back are compared, above this share of the largest of both ways.
_SPEEDS: Final = 6
_SLOWEST_SHARE: Final = 0.05
# Share by which a damper is stronger one way, and its standard errors, from which on it is no static force.
_STRONGER: Final = 0.05
_SURELY_STRONGER: Final = 5.0
# Ratio of the squares that a share leaves to those that a constant leaves from which on a static force is sure. Of
# sines of three Bouc-Wen dampers it is 6 to 650 with an offset, and 0.01 to 2.7 where they are 12 or 25 % stronger one
# way; of random motions it is 0.6 to 2 in both cases.
_SURELY_STATIC: Final = 4.0
# Of rows in the order of the displacement the force leaps from one to the next by 1.4 of its standard deviation, and
# that is a large share of the largest force. Noise about the constant force of one way is a small one.
_LEAPS: Final = 0.7
_OF_LOOP: Final = 0.3


def check_varies(samples: Floats, quantity: str, unit: str, *, source: str) -> None:
    """Check that a channel is not constant."""
    if np.ptp(samples) < _SMALLEST_RANGE:
        value = "zero" if abs(samples[0]) < _SMALLEST_RANGE else f"constant at {samples[0]:g} {unit}"
        raise RecordError(f"{source}: the {quantity} is {value} throughout; check the channel and its wiring")


def check_order(displacement: Floats, force: Floats, *, source: str) -> None:
    """Check that rows are not ordered by displacement, where the force leaps between the two ways of a loop."""
    steps, leaps, size = np.diff(displacement), np.std(np.diff(force)), np.std(force)
    is_ordered = np.all(steps >= 0.0) or np.all(steps <= 0.0)
    if is_ordered and leaps > _LEAPS * size and size > _OF_LOOP * np.abs(force).max():
        raise RecordError(
            f"{source}: the rows are ordered by displacement, not by time: it never turns back, while the force leaps "
            "between two branches; export them in the order in which they were recorded"
        )


_FEW_SAMPLES: Final = RemarkKind(
    "few_samples_per_cycle",
    "only {value:.1f} samples per cycle of {frequency:.3g} Hz (at least {least:.0f} are advised): reversals of the "
    "motion, where the force changes most, are poorly resolved",
    "sample at {rate:.3g} Hz or more",
)


def samples_per_cycle(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Warn if the dominant cycle has fewer than 20 samples."""
    per_cycle = Measured(1.0 / (motion.frequency * test.dt), "")
    if per_cycle.value < (least := _FEWEST_PER_CYCLE):
        rate = least * motion.frequency
        yield _FEW_SAMPLES.remark(measured=per_cycle, frequency=motion.frequency, least=least, rate=rate)


# A motion at constant speed has gone half of the excursion by then, noise of a tenth of it spans less.
_STILL_SHARE: Final = 0.4


def samples_at_rest(displacement: Floats) -> int:
    """Number of samples until 1 % of the stroke; a harmonic motion from its peak takes 0.03 periods.

    None of a motion that grows slowly: at rest the first half spans far less than what ends it.
    """
    excursion = _REST_EXCURSION * float(np.ptp(displacement))
    rest = int(np.argmax(np.abs(displacement - np.median(displacement[:3])) > excursion))
    return rest if rest < 2 or np.ptp(displacement[: rest // 2]) < _STILL_SHARE * excursion else 0


_REST: Final = RemarkKind(
    "rest_before_motion", "at rest for the first {value:.2f} s of {whole:.2f} s", verbs=ONCE, cured_by="rest"
)


def rest_before_motion(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Note rest at the start that lasts a quarter of the dominant period or longer."""
    rest = samples_at_rest(test.displacement) * test.dt
    if rest >= _REST_CYCLES / motion.frequency:
        yield _REST.remark(measured=Measured(rest, "s"), whole=test.n_time * test.dt)


# The start ends at this fraction of the peak-to-peak stroke. The overshoot must exceed this fraction of the half range
# of the force, and this number of standard errors.
_BREAKAWAY_STROKE: Final = 0.05
_BREAKAWAY_SHARE: Final = 0.05
_BREAKAWAY_ERRORS: Final = 4.0
_BREAKAWAY: Final = RemarkKind(
    "breakaway",
    "the damper broke away from rest with {value:.3g} N more than any later force: stiction, which the models do not "
    "include",
    "remove the start by --repair rest",
    cured_by="rest",
)


def breakaway_remark(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Warn of a force at the first movement after rest above all later ones by at least 5 % of the half range."""
    rest = samples_at_rest(test.displacement)
    if rest * test.dt * motion.frequency < _REST_CYCLES:
        return
    moved = np.abs(test.displacement - test.displacement[0]) > _BREAKAWAY_STROKE * np.ptp(test.displacement)
    started = int(np.argmax(moved))
    if started + 1 >= moved.size:
        return
    force = np.abs(test.force - (static_force(test.displacement, test.force, motion.velocity) or 0.0))
    smoother = Differentiator(windows=np.full(test.n_time, 5), dt=test.dt)
    noise = smoother.noise(test.force - smoother.smooth(test.force))
    first = slice(max(rest - 2, 0), started + 1)
    overshoot = float(force[first].max() - force[started + 1 :].max())
    error = noise * float(np.sqrt(2.0))
    if overshoot >= max(_BREAKAWAY_SHARE * half_range(test.force), _BREAKAWAY_ERRORS * error):
        yield _BREAKAWAY.remark(measured=Measured(overshoot, "N", standard_error=error))


def turns_back(displacement: Floats, velocity: Floats) -> bool:
    """Whether a motion returns over at least half of the way that it goes."""
    return min(ways := travel(displacement, velocity)) >= _BACK * max(ways)


def travel(displacement: Floats, velocity: Floats) -> tuple[float, float]:
    """Lengths of the ways out and back [m], between reversals: noise of a sensor at rest is no travel."""
    strokes = np.diff(displacement[[0, *reversals(velocity), -1]])
    return float(strokes.clip(min=0.0).sum()), float(-strokes.clip(max=0.0).sum())


def static_force(displacement: Floats, force: Floats, velocity: Floats) -> float | None:
    """The static force [N] by what equal speeds show out and back; `None` where the motion has no such speeds.

    With the forces F+ and F- at a speed, while it rises or falls, the middle (F+ + F-) / 2 is the static force and a
    share of the half (F+ - F-) / 2 by which a damper is stronger one way. That share, by least squares over the speeds,
    is taken out where it is sure; a static force that changes its sign by that is none.
    """
    forces = _forces_out_and_back(displacement, force, velocity)
    if forces is None:
        return None
    root, middle, half = forces
    mean = float(np.average(middle, weights=root**2))
    design = np.stack([root, root * half], axis=1)
    (static, share), *_ = np.linalg.lstsq(design, root * middle, rcond=None)
    residual = root * middle - design @ (static, share)
    # Two speeds leave no residual.
    variance = (residual @ residual) / free if (free := np.count_nonzero(root) - 2) > 0 else np.inf
    error = float(np.sqrt(np.linalg.pinv(design.T @ design)[1, 1] * variance))
    if abs(share) < max(_STRONGER, _SURELY_STRONGER * error):
        return mean
    return float(static) if static * mean > 0.0 else 0.0


def may_be_one_way(displacement: Floats, force: Floats, velocity: Floats) -> bool:
    """Whether a damper that is stronger one way may be what shows as a static force.

    A share of the half then leaves squares of the middle that are not far above those that a constant leaves.
    """
    forces = _forces_out_and_back(displacement, force, velocity)
    if forces is None:
        return False
    root, middle, half = forces
    weighed = root * middle
    by_constant, by_share = (
        float(weighed @ weighed - (weighed @ column) ** 2 / max(float(column @ column), _TINY))
        for column in (root, root * half)
    )
    return by_share < _SURELY_STATIC * by_constant


def _forces_out_and_back(
    displacement: Floats, force: Floats, velocity: Floats
) -> tuple[Floats, Floats, Floats] | None:
    """Root of the weight, middle and half of the forces out and back [N], at each speed while it rises and falls."""
    speed = np.abs(velocity)
    top = min(float(velocity.max()), float(-velocity.min()))
    if not turns_back(displacement, velocity) or top <= 0.0:
        return None
    counted = (speed > _SLOWEST_SHARE * top) & (speed <= top)
    place = 2 * (_SPEEDS * speed / top).astype(np.intp).clip(max=_SPEEDS - 1) + (np.gradient(speed) > 0.0)
    place, weight = (place + 2 * _SPEEDS * (velocity < 0.0))[counted], speed[counted]
    travelled, pushed = (
        np.bincount(place, each, 4 * _SPEEDS).reshape(2, -1) for each in (weight, weight * force[counted])
    )
    out, back = pushed / travelled.clip(min=_TINY)
    both = travelled.min(axis=0)
    if both.sum() < _BACK * max(float(velocity.clip(min=0.0).sum()), float(-velocity.clip(max=0.0).sum())):
        return None
    return np.sqrt(both), 0.5 * (out + back), 0.5 * (out - back)


def half_range(force: Floats) -> float:
    """Half the range of a force [N] between its percentiles 0.5 and 99.5, which outliers do not affect."""
    return 0.5 * float(np.ptp(np.percentile(force, [0.5, 99.5])))


_SIGN_UNCLEAR: Final = RemarkKind(
    "force_sign_unclear",
    "the energy int F v dt is {share:.1f} % of int |F v| dt, {0}, so that the sign of the force is in doubt; it was "
    "not changed",
    "check the sign of the channel, and multiply it by -1 if the force does not resist the motion",
)
_SIGN_FLIPPED: Final = RemarkKind(
    "force_sign_flipped",
    "the recorded force has the sign that generates energy (int F v dt is {share:.0f} % of int |F v| dt); it was "
    "multiplied by -1 so that it resists the motion",
)


def force_sign(
    displacement: Floats, force: Floats, velocity: Floats, dt: float
) -> tuple[Floats, tuple[Remark, ...]]:
    """The force [N] with the sign that dissipates energy, and a remark if it was changed or is in doubt.

    The sign is of int F v dt / int |F v| dt, with the derivative v of the displacement, and F about its static part.
    It is changed where that is beyond doubt only: the motion turns back, most of the travel
    generates, and int F dx, which no smoothing of the motion changes, agrees.
    """
    centred = force - (static_force(displacement, force, velocity) or 0.0)
    power = centred * velocity
    whole = float(np.abs(power).sum())
    share = float(power.sum()) / whole if whole > 0.0 else 0.0
    work = float(0.5 * (centred[1:] + centred[:-1]) @ np.diff(displacement)) / dt
    agrees = 0.5 < work / (float(power.sum()) or 1.0) < 2.0
    if share >= _SIGN_SHARE and work > 0.0:
        return force, ()
    if not turns_back(displacement, velocity):
        reason = "of a motion that does not come back"
    elif abs(share) < _SIGN_SHARE:
        reason = "too little to tell a damper from a spring"
    elif share < -_SIGN_SURE and agrees and float(np.abs(velocity) @ np.sign(power)) < 0.0:
        return -force, (_SIGN_FLIPPED.remark(share=100.0 * share),)
    else:
        reason = "which a force that is late or a motion that is noise may have, too"
    return force, (_SIGN_UNCLEAR.remark(reason, share=100.0 * share),)


ONE_WAY: Final = RemarkKind(
    "one_way",
    "the motion never turns back in {value:.3g} mm: a static force, dry friction and a loop cannot be told apart",
    "test strokes out and back at equal speeds",
    verbs=ONCE,
)


def one_way_remark(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Warn of a motion of one way, which leaves open what two ways tell."""
    ways = travel(test.displacement, motion.velocity)
    if min(ways) < _NEVER_BACK * max(ways):
        yield ONE_WAY.remark(measured=Measured(1e3 * max(ways), "mm"))


TEMPERATURE: Final = RemarkKind(
    "temperature",
    "the temperature, column '{0}', is {value:.3g} in the mean and from {least:.3g} to {most:.3g}; no model has it",
    verbs=ONCE,
)
FORCE_OFFSET: Final = RemarkKind(
    "force_offset",
    "the force has a static offset of {value:+.4g} N, {share:.0f} % of its half range of {scale:.4g} N: gas pressure "
    "or the zero of the load cell, which a model describes by f0 or k x0{0}",
    # A fit describes the offset of its own tests; other tests may have another.
    verbs=OF_FILES,
    cured_by="offset",
)


def force_offset(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Note a static offset above 5 % of the half range of the force, which every model has a parameter for.

    A varying command weighs the directions of motion differently, so that the mean force is no static one.
    """
    offset = static_force(test.displacement, test.force, motion.velocity)
    scale = half_range(test.force)
    # A force of a few spikes has no range between the percentiles.
    if (
        offset is not None
        and not test.has_varying_command
        and scale > 0.0
        and abs(offset) > _OFFSET_SHARE * scale
    ):
        is_open = may_be_one_way(test.displacement, test.force, motion.velocity)
        or_else = ", or the damper is stronger one way, which is no offset" if is_open else ""
        share = 100.0 * abs(offset) / scale
        yield FORCE_OFFSET.remark(or_else, measured=Measured(offset, "N"), share=share, scale=scale)


_SHORTEST_RUN: Final = 3
_FEWEST_RUNS: Final = 2
# A parabola with slope s per sample at the cut would have risen by s n / 4 over the n samples cut. Rounding alone
# gives less than one step of the resolution.
_OVERSHOOT_STEPS: Final = 4.0
# Share of a range in which levels next to its extreme tell its resolution.
_TOP: Final = 0.1
# Rounding to this share of half the range is an error of 0.7 % of it, rms, and makes plateaus as clipping does.
_COARSE: Final = 0.025
_FEWEST_LEVELS: Final = 5
_FEWEST_PER_LEVEL: Final = 5
# Levels are whole steps apart, but for this share of one; what is closer than this share of the range is rounding.
_OFF_THE_STEPS: Final = 0.05
_ROUNDED: Final = 1e-9
_COARSELY_READ: Final = RemarkKind(
    "coarse",
    "the {0} is read in steps of {value:.3g} {1}, {share:.2g} % of its half range of {half:.4g} {1}",
    "measure again with a smaller range or more digits",
)
_CLIPPED: Final = RemarkKind(
    "clipped",
    "the {0} is clipped at its extreme in {value:.2g} % of its samples{1}: the channel exceeded its range",
    "measure again with a wider one",
)
_HELD: Final = RemarkKind(
    "held_samples",
    "the {0} has a new value in one of {value:.0f} samples only: it is sampled at {rate:.3g} Hz, and late by "
    "{late:.3g} ms in the mean",
    "use --every {value:.0f}, or sample all channels alike",
)
_STUCK: Final = RemarkKind(
    "stuck",
    "the force has one value in {value:.0f} samples from {begin:.4g} s on, while the displacement moves, and elsewhere "
    "another in nearly each sample",
    "check the channel and the logger, or omit that part (--from, --until)",
)
# Samples in a row, share of other neighbours that may be equal, and share of its range by which the displacement moves.
_STUCK_SAMPLES: Final = 20
_EQUAL: Final = 0.01
_MOVES: Final = 0.1


def stuck_force(test: DamperTest, _: SmoothMotion) -> Iterator[Remark]:
    """Warn of a force that a sensor or logger holds for a while within one way of the motion."""
    equal = np.diff(test.force) == 0.0
    first, last = max(sample_runs(equal), key=lambda run: run[1] - run[0], default=(0, 0))
    moved = np.ptp(test.displacement[first : last + 1]) > _MOVES * np.ptp(test.displacement)
    rare = np.count_nonzero(equal) - (last - first) <= _EQUAL * equal.size
    if last - first >= _STUCK_SAMPLES and moved and rare:
        value = Measured(last - first + 1, "samples")
        yield _STUCK.remark(measured=value, begin=float(test.time[first]))


def resolution_remarks(test: DamperTest, _: SmoothMotion) -> Iterator[Remark]:
    """Warn of channels with few levels, of clipped ones, and of those whose samples are held."""
    channels = [("displacement", test.displacement, "m"), ("force", test.force, "N")]
    if test.velocity_source == "measured":
        channels.append(("velocity", test.velocity, "m/s"))
    for name, samples, unit in channels:
        step = coarse_step(samples)
        if step is not None:
            half = 0.5 * float(np.ptp(samples))
            measured = Measured(step, unit)
            yield _COARSELY_READ.remark(name, unit, measured=measured, share=100.0 * step / half, half=half)
        elif (share := 100.0 * float(clipped_samples(samples).mean())) > 0.0:
            left_out = ", which are not compared with a model" if name == "force" else ""
            yield _CLIPPED.remark(name, left_out, measured=Measured(share, "%"))
        if (held := held_samples(samples)) > 1:
            late = 500.0 * (held - 1) * test.dt
            measured = Measured(held, "samples")
            yield _HELD.remark(name, measured=measured, rate=1.0 / (held * test.dt), late=late)


def coarse_step(samples: Floats) -> float | None:
    """Step between the levels of a channel, shape (n_time,), if it is coarse; `None` otherwise."""
    levels = np.unique(samples)
    whole = float(levels[-1] - levels[0])
    gaps = np.diff(levels)
    gaps = gaps[gaps > _ROUNDED * whole]
    if not _FEWEST_LEVELS <= gaps.size + 1 <= samples.size / _FEWEST_PER_LEVEL:
        return None
    step = float(gaps.min())
    if step <= 0.5 * _COARSE * whole:
        return None
    return step if np.all(np.abs(gaps / step - np.round(gaps / step)) < _OFF_THE_STEPS) else None


def clipped_samples(samples: Floats) -> NDArray[np.bool_]:
    """Which samples of a channel, shape (n_time,), are at an extreme that clips its peaks; none where none does.

    A clipped peak is three or more samples at the extreme value, between which noise leaves at most two others, with
    slopes beside it so steep that the curve would have continued by four steps of its resolution. A single one may be
    rest; of two, the other extreme clips one as well. A channel that is read coarsely has plateaus of its own.
    """
    clipped = np.zeros(samples.shape, dtype=np.bool_)
    levels = np.unique(samples)
    if levels.size < 2 * _SHORTEST_RUN or coarse_step(samples) is not None:
        return clipped
    sides = samples, -samples
    peaks = [_clipped_peaks(side, _resolution_at_top(np.unique(side))) for side in sides]
    if max(peaks) >= _FEWEST_RUNS:
        for side, count in zip(sides, peaks, strict=True):
            clipped |= (side == side.max()) & (count > 0)
    return clipped


def _resolution_at_top(levels: Floats) -> float:
    """Step of the levels at the highest: texts with a number of significant digits have finer ones near zero."""
    near = levels[levels > levels[-1] - _TOP * (levels[-1] - levels[0])]
    return max(float(np.diff(levels).min()), float(np.median(last_digit(near))))


def _clipped_peaks(samples: Floats, resolution: float) -> int:
    """Number of peaks at the maximum with steep flanks."""
    flat = samples == samples.max()
    for first, last in sample_runs(~flat):
        flat[first:last] = first > 0 and last < flat.size and last - first < _SHORTEST_RUN
    begin, end = np.array(sample_runs(flat)).T
    inside = (end - begin >= _SHORTEST_RUN) & (begin >= 2) & (end + 2 <= samples.size)
    begin, end = begin[inside], end[inside]
    # Both flanks must be steep; with one steep flank only, it may be a start from rest. They must be so beside the run,
    # and for a quarter of its length: of a rounded curve the nearest step alone is steep.
    slopes = [
        (samples[at] - samples[np.clip(at + sign * length, 0, samples.size - 1)]) / length
        for at, sign in ((begin, -1), (end - 1, 1))
        for length in (2, np.maximum((end - begin) // 4, 2))
    ]
    overshoot = np.minimum.reduce(slopes) * (end - begin) / 4.0
    return int(np.count_nonzero(overshoot > _OVERSHOOT_STEPS * resolution))


_FEWEST_CHANGES: Final = 20
# Share of the changes that are as far apart as most are, and of those that are a whole number of that apart.
_ALIKE: Final = 0.5
_IN_TIME: Final = 0.95
# Changes of a slow channel are of one step of its resolution each, and as far apart as it is slow.
_STEPS_AT_ONCE: Final = 3.0


def held_samples(samples: Floats) -> int:
    """Number of samples for which a channel, shape (n_time,), holds each of its values; 1 for one that does not."""
    changes = np.diff(samples)
    changed = np.flatnonzero(changes)
    if not _FEWEST_CHANGES <= changed.size <= samples.size // 2:
        return 1
    apart: NDArray[np.intp] = np.diff(changed)
    held = int(np.median(apart))
    sizes = np.abs(changes[changed])
    regular = np.mean(apart == held) > _ALIKE and np.mean(apart % held == 0) > _IN_TIME
    return held if held > 1 and regular and np.median(sizes) > _STEPS_AT_ONCE * sizes.min() else 1


# The longest dampers of bridges have about 2 m.
_LONGEST_STROKE: Final = 5.0
# That of a damper of 1 kN.
_LONG_STROKE: Final = 1.0
# Rods and mounts are stressed by some 20 MPa at full force, and then stretch by 1e-4 of their length to either side: by
# 0.1 mm for a damper of 1 kN with its fixture of half a metre. Lengths grow from a damper of 1 kN to one of 200 kN by
# about this power of the force.
_SHORTEST_STROKE: Final = 1e-4
_OF_FORCE: Final = 1e3
_GROWS: Final = 0.4
# The seal of the smallest cylinder takes some newtons; the largest magnetorheological dampers built have 400 to 500 kN.
_SMALLEST_FORCE: Final = 5.0
_LARGEST_FORCE: Final = 6e5
# Slow tests have some mm/s, and are sampled twenty times in a second or more often; recoil dampers reach some 15 m/s
# and 100 g, and mounts are tested up to some 300 Hz.
_SLOWEST: Final = 5e-4
_COARSE_STEP: Final = 0.05
# At steps of half a second nothing faster than this has been seen, [m/s].
_COARSEST: Final = 0.5
_SLOW: Final = 0.01
_FASTEST: Final = 20.0
_LARGEST_ACCELERATION: Final = 1e4
_HIGHEST_FREQUENCY: Final = 500.0
# The coils of the largest dampers take some 10 A, and no driver of them is set by more than the voltage of the mains.
_LARGEST_COMMANDS: Final[Mapping[CommandUnit, float]] = {"A": 20.0, "V": 240.0}
_STROKE: Final = RemarkKind(
    "displacement_unusual",
    "the displacement spans {span:.3g} {0}, {1} damper of {force}{2}",
    "check its channel and its unit: are {3}?",
)
_LONG: Final = ("m", "more than any", "", "mm taken for m")
_SHORT: Final = ("um", "no more than rod and mounts of a", " stretch", "millimetres taken for micrometres")


def stroke_remark(test: DamperTest, _: SmoothMotion) -> Iterator[Remark]:
    """Warn of a stroke that no damper has, or that its rod and mounts alone would give."""
    stroke, force = float(np.ptp(test.displacement)), float(np.abs(test.force).max())
    scale = (force / _OF_FORCE) ** _GROWS
    measured = Measured(stroke, "m")
    if stroke > min(_LONGEST_STROKE, _LONG_STROKE * scale):
        yield _STROKE.remark(*_LONG, measured=measured, span=stroke, force=in_newtons(force, 3))
    elif stroke < _SHORTEST_STROKE * scale:
        yield _STROKE.remark(*_SHORT, measured=measured, span=1e6 * stroke, force=in_newtons(force, 3))


_FORCE: Final = RemarkKind(
    "force_unusual", "the force reaches {force}, {0}", "check its channel and its unit: are {1}?"
)
_LARGE: Final = (f"more than the {1e-3 * _LARGEST_FORCE:.0f} kN of the largest dampers", "N taken for kN")
_SMALL: Final = ("less than the seal of a damper takes", "kN taken for N")


OF_STROKES: Final = frozenset({_STROKE.code, _FORCE.code})
"""Codes of remarks on sizes of strokes and forces, which angles and torques do not have."""


def force_remark(test: DamperTest, _: SmoothMotion) -> Iterator[Remark]:
    """Warn of a force that is larger than any damper's, or smaller than the friction of a seal."""
    force = float(np.abs(test.force).max())
    if not _SMALLEST_FORCE <= force <= _LARGEST_FORCE:
        words = _LARGE if force > _LARGEST_FORCE else _SMALL
        yield _FORCE.remark(*words, measured=Measured(force, "N"), force=in_newtons(force, 3))


PACE: Final = RemarkKind(
    "time_unusual",
    "the motion has {value:.2g} Hz and {speed:.2g} mm/s in steps of {dt:.3g} s, {0} than a damper is tested",
    "check the units of the time (are {1}?) and of the displacement",
)


def pace_remark(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Warn of a motion that is far slower, and sampled so, or far faster than a damper is tested."""
    speed = float(np.percentile(np.abs(motion.velocity), 99.0))
    acceleration = 2.0 * np.pi * motion.frequency * speed
    slow = test.dt >= _COARSE_STEP and (speed < _SLOWEST or (test.dt >= _COARSEST and speed < _SLOW))
    fast = speed > _FASTEST or motion.frequency > _HIGHEST_FREQUENCY or acceleration > _LARGEST_ACCELERATION
    if not slow and not fast:
        return
    words = ("slower", "ms taken for s") if slow else ("faster", "s taken for ms")
    yield PACE.remark(*words, measured=Measured(motion.frequency, "Hz"), speed=1e3 * speed, dt=test.dt)


_LARGE_COMMAND: Final = RemarkKind(
    "command_unusual",
    "the command reaches {value:.4g} {0}, more than a damper takes",
    "check its column and its unit: are m{0} taken for {0}?",
)


def command_remark(test: DamperTest, _: SmoothMotion) -> Iterator[Remark]:
    """Warn of a command that is larger than any coil or driver takes."""
    for values, unit in test.commands:
        highest = float(np.max(values))
        if highest > _LARGEST_COMMANDS.get(unit, np.inf):
            yield _LARGE_COMMAND.remark(unit, measured=Measured(highest, unit))


_DIFFERENCES: Final = 2
_HARMONICS: Final = np.arange(1, 5)
# Shortest window [samples]; with fewer, the only null is at or near the Nyquist frequency, as with a low-pass filter.
_SHORTEST: Final = 4
# A transform of a long signal takes some twenty times as long where its length has a large prime factor.
_LONG_SIGNAL: Final = 1 << 16
# Longest window, in periods; longer averages are not used in practice, and harmonics interfere there.
_LONGEST_AVERAGE: Final = 0.5
# Least depth relative to a moving average; rounding after the average fills the nulls a little. Combs of
# harmonics can reach the same mean depth, but not equally at w and 2 w.
_DEPTH: Final = 0.6
_EACH: Final = (0.5, 1.5)
# In standard deviations of the mean depth due to periodogram scatter.
_SIGNIFICANT: Final = 6.0
# Factor by which a Hann taper raises the variance of the cepstrum, since neighbouring spectral lines are correlated.
_TAPER: Final = 1.94


def detect_smoothing(test: DamperTest, frequency: float | None = None) -> Smoothing | None:
    """Detect a moving average applied to displacement and force of a test; `None` if there is none.

    If the two windows differ, the force's is returned, which has the higher harmonics. Windows of less than 4
    samples, or of more than an eighth of the record or half a period, cannot be detected, nor any in a record without
    noise. `frequency` is the dominant one of the motion [Hz], where it is known.
    """
    if frequency is None:
        frequency = spectrum(test.displacement, test.dt).dominant
    channels: tuple[tuple[Channel, Floats], ...]
    channels = (("force", test.force), ("displacement", test.displacement))
    windows = {name: detect_average(samples) for name, samples in channels}
    period = round(1.0 / (frequency * test.dt))
    for name, n_window in windows.items():
        if n_window is not None and n_window > _LONGEST_AVERAGE * period:
            windows[name] = None
    if len(set(windows.values())) > 1:
        # A pulse in every cycle has the spectrum of an average; the difference between cycles does not contain it.
        for name, samples in channels:
            if detect_average(samples[period:] - samples[:-period]) != windows[name]:
                windows[name] = None
    seen = [n_window for n_window in windows.values() if n_window is not None]
    if not seen:
        return None
    return Smoothing(
        window_seconds=seen[0] * test.dt,
        channels=tuple(name for name, n_window in windows.items() if n_window == seen[0]),
    )


_AVERAGED_TEXT: Final = (
    "{0} passed a moving average over {ms:.4g} ms ({samples:.0f} samples, {share:.2g} of the dominant period), which "
    "rounds the corners of the loop"
)
# A fit describes the average of its own tests; other tests may have another.
_AVERAGED: Final = RemarkKind(
    "moving_average",
    f"{_AVERAGED_TEXT}; identify applies the same average to the model's force",
    verbs=OF_FILES,
)
_MOTION_AVERAGED: Final = RemarkKind(
    "motion_averaged", _AVERAGED_TEXT, "use the original record, for the force shows none", verbs=OF_FILES
)


def smoothing_remark(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Warn of a moving average, with the fraction of a cycle that it covers."""
    smoothing = test.smoothing
    if smoothing is None:
        return
    window = smoothing.window_seconds
    kind = _AVERAGED if "force" in smoothing.channels else _MOTION_AVERAGED
    yield kind.remark(
        " and ".join(smoothing.channels),
        measured=Measured(window, "s", standard_error=test.dt),
        ms=1e3 * window,
        samples=window / test.dt,
        share=window * motion.frequency,
    )


def detect_average(samples: Floats) -> int | None:
    """Window in samples of a moving average applied to a signal, shape (n_time,); `None` if there is none.

    A moving average over w samples multiplies the spectrum by sin(pi f w dt) / (w sin(pi f dt)), which is
    zero at every multiple of 1/(w dt). In the logarithm of the power, log |1 - exp(-i w omega)|^2
    = -2 sum_j cos(j w omega) / j, so the cepstrum has spikes of -1/j at j w (Bogert, Healy and Tukey 1963). Their depth
    does not depend on the level or colour of the noise, and the cepstrum of smooth spectra is concentrated near the
    origin. The spikes at w, 2 w, 3 w and 4 w are combined. Odd harmonics of a motion of period T are distinguished by
    their alternating sign at multiples of T/2.
    """
    if samples.size >= _LONG_SIGNAL:
        # A small number times a power of two, of the differences.
        power = (samples.size - _DIFFERENCES).bit_length() - 4
        samples = samples[: _DIFFERENCES + ((samples.size - _DIFFERENCES) >> power << power)]
    windows = np.arange(_SHORTEST, (samples.size // 2 - 2) // int(_HARMONICS[-1]))
    if windows.size == 0:
        return None
    cepstrum = _cepstrum(samples)
    spikes = np.zeros_like(cepstrum)
    spikes[1:-1] = 0.5 * (cepstrum[:-2] + cepstrum[2:]) - cepstrum[1:-1]
    weight = 1.0 / _HARMONICS
    depth = spikes[_HARMONICS * windows[:, np.newaxis]] @ weight / np.sum(weight**2)
    best = int(np.argmax(depth))
    # A log periodogram has the variance pi^2 / 6; the difference from the mean of two neighbours has 1.5 times that.
    scatter = np.pi * np.sqrt(_TAPER * 1.5 / (6.0 * samples.size * np.sum(weight**2)))
    deep = depth[best] > max(_DEPTH, _SIGNIFICANT * scatter)
    window = int(windows[best])
    heights = spikes[window * _HARMONICS[:2]] * _HARMONICS[:2]
    alike = bool(np.all((heights > _EACH[0]) & (heights < _EACH[1])))
    # The edge of a steep low-pass filter gives a wave in the cepstrum, not a spike.
    beside = np.abs(spikes[window + 2 : min(2 * window - 1, window + 6)])
    return window if deep and alike and beside.max() < _EACH[0] else None


def _cepstrum(samples: Floats) -> Floats:
    """Power cepstrum of a signal, for quefrencies from 0 to half its number of samples."""
    # Differences raise the noise to the level of the motion; their own cepstrum, -1/k each, is added back.
    steep = np.diff(samples, _DIFFERENCES)
    power = np.abs(np.fft.rfft((steep - steep.mean()) * np.hanning(steep.size))) ** 2
    # Of an arc without noise all differences are zero.
    floor = max(float(np.finfo(np.float64).eps ** 2 * power.max()), float(np.finfo(np.float64).tiny))
    cepstrum = np.fft.irfft(np.log(np.maximum(power, floor)))[: samples.size // 2 - 1]
    cepstrum[1:] += _DIFFERENCES / np.arange(1, cepstrum.size)
    return np.asarray(cepstrum, dtype=np.float64)
