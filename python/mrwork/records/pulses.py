"""Pulses of a driver (PWM) that were recorded as the command, of which the coil and the force follow the mean alone.

Apart from the checks because the repair needs what they detect.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats
from mrwork.dampers.command import Command
from mrwork.records.damper_test import DamperTest
from mrwork.records.finding import OF_FILES, Finding, FindingKind, Measured
from mrwork.records.motion import SmoothMotion

# Pulses go down to this share of their level, and at most this share of the samples is between, on edges.
_OFF: Final = 0.1
_ON_EDGES: Final = 0.2
_FEWEST: Final = 10
# Share of the cycles that are as long as most, to this share or a sample; of others the mean is shorter than this [s].
_REGULAR: Final = 0.6
_ALIKE: Final = 0.1
_FAST: Final = 0.05
# Cycles of irregular pulses, and samples in a window, whose mean is known to some hundredths of the level.
_CYCLES: Final = 20
_PHASES: Final = 10
# Steps within a line of the spectrum, and lines by which a frequency is surely another.
_FINER: Final = 8
_SURE: Final = 3.0
# The longest window as a share of the record.
_LONGEST: Final = 0.2


class Pulses(NamedTuple):
    """Pulses of a command to `level`: samples of the `window` over which to average, and of a state in the median.

    `share` is that of the time at the level. The samples show so many `phases` of the pulses.
    """

    level: float
    share: float
    state: float
    window: int
    phases: int

    def left_unknown(self, dt: float) -> str:
        """What their mean does not tell, as a clause."""
        if self.phases < _PHASES:
            return f"their samples show {self.phases} phases of a period, which give the mean to 1/{self.phases} only"
        return f"a lag of the driver above {1.0 / (dt * self.window):.3g} 1/s is not known with it"

    def mean_of(self, command: Floats) -> Floats:
        """Centred moving average of the command, shape (n_time,); at the ends that of the outermost window."""
        first = np.arange(command.size) - self.window // 2
        first = first.clip(0, command.size - self.window)
        total = np.append(0.0, np.cumsum(command))
        return np.asarray((total[first + self.window] - total[first]) / self.window, dtype=np.float64)


def pulses_of(command: Command, dt: float) -> Pulses | None:
    """Pulses from zero to one level, regular or fast; `None` for a command that is none or switches seldom."""
    samples = command.values
    if not isinstance(samples, np.ndarray):
        return None
    low, high = np.percentile(samples, [1.0, 99.0])
    on = samples > 0.5 * (low + high)
    edges = np.abs(samples - 0.5 * (low + high)) < 0.25 * (high - low)
    switched = np.flatnonzero(np.diff(on))
    if not abs(low) < _OFF * high or edges.mean() > _ON_EDGES or switched.size < 2 * _FEWEST:
        return None
    # By what a driver sets the width, its pulses begin or end in time.
    cycles = [np.diff(switched[first::2]) for first in (0, 1)]
    alike = [np.mean(np.abs(each - np.median(each)) <= max(1.0, _ALIKE * np.median(each))) for each in cycles]
    state, share = float(np.median(np.diff(switched))), float(on.mean())
    if max(alike) >= _REGULAR:
        window = _whole_periods(on, float(np.median(cycles[int(np.argmax(alike))])))
        return Pulses(float(high), share, state, window, window)
    cycle = 2.0 * samples.size / switched.size
    window = min(round(_CYCLES * cycle), int(_LONGEST * samples.size))
    return Pulses(float(high), share, state, window, _PHASES) if cycle * dt < _FAST else None


def _whole_periods(on: NDArray[np.bool_], cycle: float) -> int:
    """Samples of a window with as many phases of regular pulses, evenly spread, by a fraction of their frequency.

    Pulses faster than the samples show are in it by their alias.
    """
    size = 1 << (_FINER * on.size).bit_length()
    lines = np.abs(np.fft.rfft((on - on.mean()) * np.hanning(on.size), size))
    slowest = int(0.5 * size / cycle)
    left = frequency = (slowest + int(np.argmax(lines[slowest:]))) / size
    before, window = 0, 1
    # Nearest-integer continued fraction: window times frequency is nearly whole, or whole as far as the record tells.
    unsure = _SURE / on.size
    while abs(window) < _PHASES and abs(window * frequency - round(window * frequency)) > unsure * abs(
        window
    ):
        whole = round(1.0 / left)
        longer = whole * window + before
        if abs(longer) > _LONGEST * on.size:
            break
        before, window, left = window, longer, 1.0 / left - whole
    return abs(window)


# Means over these times before, of what pulses are beside their mean, are a coil or damper that follows them [s].
_LAGS: Final = (0.02, 0.06)
# A force follows the pulses if they explain this share of the variance that the motion leaves.
_FOLLOWS: Final = 0.13
_MOST_SAMPLES: Final = 20_000
_PULSED: Final = FindingKind(
    "command_pulsed",
    "the {0} switches between zero and {value:.3g} {1}, has a state for {state:.3g} samples ({ms:.3g} ms) in the "
    "median, is on for {share:.0f} % of the time, and the force does not follow it, as with pulses of a driver (PWM), "
    "of which the coil gets the mean",
    "record the current in the coil, or take the mean over {window:.3g} ms by --repair pulses: {unknown}",
    verbs=OF_FILES,
    cured_by="pulses",
)


def pulses_finding(test: DamperTest, motion: SmoothMotion) -> Iterator[Finding]:
    """Warn of a command that switches faster than the damper, or the record, can follow."""
    for command in test.commands:
        pulses = pulses_of(command, test.dt)
        if pulses is None or _follows(test, motion, np.asarray(command.values), pulses):
            continue
        yield _PULSED.found(
            command.quantity,
            command.unit,
            measured=Measured(pulses.level, command.unit),
            state=pulses.state,
            ms=1e3 * test.dt * pulses.state,
            share=100.0 * pulses.share,
            window=1e3 * test.dt * pulses.window,
            unknown=pulses.left_unknown(test.dt),
        )


def _follows(test: DamperTest, motion: SmoothMotion, command: Floats, pulses: Pulses) -> bool:
    """Whether pulses explain a force beyond what the motion does: f0 + k x + c v + f tanh(v + h x), each with them."""
    beside = command - pulses.mean_of(command)
    some = slice(None, None, max(command.size // _MOST_SAMPLES, 1))
    speed = motion.velocity[some] / np.percentile(np.abs(motion.velocity), 99.0)
    place = motion.displacement[some] / np.abs(motion.displacement).max()
    forms = np.stack(
        [np.ones_like(speed), place, speed, np.tanh(20.0 * speed), np.tanh(20.0 * speed + 4.0 * place)]
    )
    before = [np.ones(max(round(seconds / test.dt), 1)) for seconds in _LAGS]
    lagged = [np.convolve(beside, each / each.size)[: beside.size][some] for each in before]

    def left(columns: Floats) -> float:
        residual = test.force[some] - columns.T @ np.linalg.lstsq(columns.T, test.force[some], rcond=None)[0]
        return float(residual @ residual)

    return left(np.concatenate([forms, *(each * forms for each in lagged)])) < (1.0 - _FOLLOWS) * left(forms)
