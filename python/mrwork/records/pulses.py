"""Pulses of a driver (PWM) recorded as the command, of which the coil gets the mean; for the check and the repair."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mrwork.base.remark import OF_FILES, Measured, Remark, RemarkKind
from mrwork.base.values import Floats
from mrwork.dampers.command import Command
from mrwork.records.damper_test import DamperTest
from mrwork.records.motion import SmoothMotion, fit_residual, regular_cycles

# Pulses go down to this share of their level, and at most this share of the samples is between, on edges.
_OFF: Final = 0.1
_ON_EDGES: Final = 0.2
_FEWEST_PULSES: Final = 10
# Share of the cycles that are as long as most, to this share or a sample; of others the mean is shorter than this [s].
_REGULAR: Final = 0.6
_ALIKE: Final = 0.1
_FAST: Final = 0.05
# Cycles of irregular pulses, and samples of regular ones, whose mean is known to a tenth of the level or better.
_CYCLES: Final = 20
_PHASES: Final = 10
# Steps within a line of the spectrum, lines by which a frequency surely is another, longest share of a record averaged.
_FINER: Final = 8
_SURE: Final = 3.0
_LONGEST_AVERAGED: Final = 0.2


class Pulses(NamedTuple):
    """Pulses to `level`, on for a `share` of the time, with states of so many samples in the median.

    `mean`, shape (n_time,), is over a `window` [s]; `unknown` is a clause on what it does not tell.
    """

    level: float
    share: float
    state: float
    window: float
    unknown: str
    mean: Floats


def pulses_of(command: Command, dt: float) -> Pulses | None:
    """Pulses from zero to one level, regular or fast; `None` for a command that is none or switches seldom."""
    samples = command.values
    if not isinstance(samples, np.ndarray):
        return None
    low, high = np.percentile(samples, [1.0, 99.0])
    on = samples > 0.5 * (low + high)
    edges = np.abs(samples - 0.5 * (low + high)) < 0.25 * (high - low)
    switched = np.flatnonzero(np.diff(on))
    if not abs(low) < _OFF * high or edges.mean() > _ON_EDGES or switched.size < 2 * _FEWEST_PULSES:
        return None
    cycle = 2.0 * samples.size / switched.size
    window = min(round(_CYCLES * cycle), int(_LONGEST_AVERAGED * samples.size))
    # By what a driver sets the width, its pulses begin or end in time.
    for lengths in (np.diff(switched[::2]), np.diff(switched[1::2])):
        usual = float(np.median(lengths))
        if np.mean(np.abs(lengths - usual) <= max(1.0, _ALIKE * usual)) >= _REGULAR:
            window = _whole_periods(on, usual)
            break
    else:
        if cycle * dt > _FAST:
            return None
    unknown = f"a lag of the driver above {1.0 / (dt * window):.2g} 1/s is not known with it"
    if window < _PHASES:
        unknown = f"the samples show {window} phases of a period, which give the mean to 1/{window} only"
    total = np.append(0.0, np.cumsum(samples))
    # At the ends the mean of the outermost window.
    mean = np.pad((total[window:] - total[:-window]) / window, (window // 2, (window - 1) // 2), "edge")
    state = float(np.median(np.diff(switched)))
    return Pulses(float(high), float(on.mean()), state, dt * window, unknown, mean)


def _whole_periods(on: NDArray[np.bool_], cycle: float) -> int:
    """Samples of a window that has evenly spread phases of regular pulses of about a `cycle`, or of their alias."""
    size = 1 << (_FINER * on.size).bit_length()
    lines = np.abs(np.fft.rfft((on - on.mean()) * np.hanning(on.size), size))
    slowest = int(0.5 * size / cycle)
    left = frequency = (slowest + int(np.argmax(lines[slowest:]))) / size
    before, window, unsure = 0, 1, _SURE / on.size
    # Nearest-integer continued fraction: window times frequency is nearly whole, or whole as far as the record tells.
    while (
        abs(window) < _PHASES and abs(window * frequency - round(window * frequency)) > abs(window) * unsure
    ):
        whole = round(1.0 / left)
        longer = whole * window + before
        if abs(longer) > _LONGEST_AVERAGED * on.size:
            break
        before, window, left = window, longer, 1.0 / left - whole
    return abs(window)


# Means over these times before, of what pulses are beside their mean, are a coil or damper that follows them [s].
_LAGS: Final = (0.02, 0.06)
# A force follows pulses that explain this share of the variance which the motion leaves: 0.19 and more of those that
# it follows, behind a coil of 4 1/s at least, and 0.11 at most of the others.
_FOLLOWS: Final = 0.13
_MOST_SAMPLES: Final = 20_000
# Share of the samples that are as in the period before, and as half a period before are not, of pulses in step with a
# motion; and share by which halves of its cycles differ: 0.24 of a damper that is 12 % stronger one way.
_IN_STEP: Final = 0.9
_OFTEN: Final = 0.2
_UNLIKE: Final = 0.3
_PULSED: Final = RemarkKind(
    "command_pulsed",
    "the {0} switches between zero and {value:.3g} {1}, has a state for {state:.3g} samples in the median, is on for "
    "{share:.0f} % of the time, and the force does not follow it, as with pulses of a driver (PWM), of which the coil "
    "gets the mean",
    "record the current in the coil, or take the mean over {window:.3g} ms by --repair pulses: {2}",
    verbs=OF_FILES,
    cured_by="pulses",
)


def pulses_remark(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Warn of a command that switches faster than the damper, or the record, can follow."""
    for command in test.commands:
        pulses = pulses_of(command, test.dt)
        if pulses is not None and not _follows(test, motion, command.values - pulses.mean):
            level, share, state, window, unknown, _ = pulses
            numbers = {"share": 100.0 * share, "state": state, "window": 1e3 * window}
            words = command.quantity, command.unit, unknown
            yield _PULSED.remark(*words, measured=Measured(level, command.unit), **numbers)


def _unlike_halves(test: DamperTest, on: NDArray[np.bool_]) -> float | None:
    """Difference of the force half a period later, mirrored, where pulses in step with the motion are not alike there.

    It is a share of that force; `None` where the motion does not repeat, or no such pulses are in step with it.
    """
    cycles = regular_cycles(test.displacement)
    half = round((cycles[-1].stop - cycles[0].start) / len(cycles) / 2) if cycles else 0
    if not half or np.mean(on[: -2 * half] == on[2 * half :]) < _IN_STEP:
        return None
    differ = on[:-half] != on[half:]
    if differ.mean() < _OFTEN:
        return None
    force, later = test.force[:-half], test.force[half:]
    offset = 0.5 * np.mean(force + later)
    apart, mirrored = (force + later - 2.0 * offset)[differ], (later - offset)[differ]
    return float(np.linalg.norm(apart) / np.linalg.norm(mirrored))


def _follows(test: DamperTest, motion: SmoothMotion, beside: Floats) -> bool:
    """Whether pulses `beside` their mean explain a force better than f0 + k x + c v + f tanh(v + h x) alone does.

    Pulses in step with the motion would explain any loop; those of odd multiples of its frequency change the force of
    one half of a cycle and not of the other.
    """
    if (unlike := _unlike_halves(test, beside > 0.0)) is not None:
        return unlike > _UNLIKE
    some = slice(None, None, max(beside.size // _MOST_SAMPLES, 1))
    speed = motion.velocity[some] / np.percentile(np.abs(motion.velocity), 99.0)
    place = motion.displacement[some] / np.abs(motion.displacement).max()
    friction = np.tanh(20.0 * speed), np.tanh(20.0 * speed + 4.0 * place)
    forms = np.stack([np.ones_like(speed), place, speed, *friction])
    before = [np.ones(max(round(seconds / test.dt), 1)) for seconds in _LAGS]
    lagged = [np.convolve(beside, each / each.size)[: beside.size][some] for each in before]

    def left(columns: Floats) -> float:
        return float(np.sum(fit_residual(columns.T, test.force[some]) ** 2))

    return left(np.concatenate([forms, *(each * forms for each in lagged)])) < (1.0 - _FOLLOWS) * left(forms)
