"""Command of a test: one number, or one value per sample, held until the next as a driver holds its set point."""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mrwork.base.numbers import of_unit
from mrwork.base.units import COMMAND_SCALES, CommandUnit
from mrwork.base.values import Floats, freeze_samples

CommandValues = float | Floats
"""A number if the command is constant, else shape (n_time,)."""

LARGEST_COMMAND: Final = COMMAND_SCALES["A"].largest
"""Largest command [A or V] that a test may have."""
# A measured command of zero is not exactly zero: by this number of its last decimals, and by this share of the largest.
_NOISE: Final = 2.0
_NOISE_SHARE: Final = 0.05

# Share of the samples in the middle half of the range of a command that switches between two levels.
_BETWEEN: Final = 0.05
# Correlation with time of a ramp over the whole record.
_RAMPING: Final = 0.9
# A jump is a change by this share of the range, beside which the command changes by less than this share of the jump.
_JUMP: Final = 0.05
_BESIDE: Final = 0.25
# Levels differ by more than this share of the range without its outermost hundredths.
_LEVEL: Final = 0.05
# A level is a mode that has this share of the samples of the largest one: what a driver only passes has fewer.
_MODE: Final = 0.1
# Quantiles from which modes are found.
_QUANTILES: Final = (np.arange(400) + 0.5) / 400.0
# A driver that rings is below zero for at most this share of the time, by at most this share of its highest level: the
# first overshoot of a step at a tenth of critical damping is 73 %.
_RINGING: Final = 0.1
_RINGING_DEPTH: Final = 0.75
# Fewer samples in succession are a glitch.
_GLITCH: Final = 3
# Share of the sum of squared changes that the jumps of a stepped command have.
_STEPPED: Final = 0.8


def quantity_of_command(unit: CommandUnit) -> Literal["current", "voltage", "command"]:
    """Name of the channel of a command in this unit."""
    if unit == "A":
        return "current"
    return "voltage" if unit == "V" else "command"


class Command(NamedTuple):
    """A command in its unit: one number, or one value per sample, shape (n_time,)."""

    values: CommandValues
    unit: CommandUnit

    @property
    def quantity(self) -> str:
        """Name of the channel: current, voltage, or command where the unit is another one."""
        return quantity_of_command(self.unit)

    @property
    def varies(self) -> bool:
        """Whether the command has a value per sample."""
        return isinstance(self.values, np.ndarray)

    @property
    def levels(self) -> tuple[float, ...]:
        """Set points at which the command stays, lowest first; see `levels_of_command`."""
        return tuple(sorted({command_level(level, self.unit) for level in levels_of_command(self.values)}))

    @property
    def in_words(self) -> str:
        """Value of a constant command, range and kind of a varying one, as in ``0 to 1 A, stepped``."""
        if not isinstance(self.values, np.ndarray):
            return of_unit(self.values, self.unit)
        low, high = range_in_words(self.values)
        return f"{low} to {high} {self.unit}, {'stepped' if is_stepped(self.values) else 'varying'}"

    @property
    def impossibility(self) -> str:
        """Fault as the predicate of a sentence: negative beyond noise, or beyond any driver; empty without.

        A command that only rings below zero is not negative.
        """
        low, high = command_range(self.values)
        if beyond := self.beyond_any_driver:
            return beyond
        negative = low < -command_noise(max(-low, high), self.unit)
        if COMMAND_SCALES[self.unit].is_signed or not negative or self.rings_below_zero:
            return ""
        return f"goes down to {low:g}: the force does not depend on its direction; give its magnitude"

    @property
    def beyond_any_driver(self) -> str:
        """Predicate of a sentence on how far the command is beyond any driver; empty where it is not."""
        low, high = command_range(self.values)
        largest = COMMAND_SCALES[self.unit].largest
        if max(-low, high) <= largest:
            return ""
        shared = "A or V" if self.unit in ("A", "V") else self.unit
        return f"reaches {low if -low > high else high:g}, and no driver gives more than {largest:g} {shared}"

    @property
    def rings_below_zero(self) -> bool:
        """Whether the command is below zero, beyond noise, only in passing, as of an underdamped driver after a step.

        It stays at no level below zero, is there for at most a tenth of the time, and goes no further than three
        quarters of its highest level; one or two samples are a glitch and may go further.
        """
        command = self.values
        # Most commands are never below zero, and their levels take longer to find.
        if not isinstance(command, np.ndarray) or command.size <= _GLITCH or command.min() >= 0.0:
            return False
        if COMMAND_SCALES[self.unit].is_signed:
            return False
        levels = levels_of_command(command)
        noise = command_noise(levels[-1], self.unit)
        below = command < -noise
        if levels[0] < -noise or not 0.0 < float(np.mean(below)) <= _RINGING:
            return False
        # The highest of any samples in succession: a glitch does not lower it.
        highest = np.lib.stride_tricks.sliding_window_view(command, _GLITCH).max(axis=1)
        return bool(highest.min() >= -_RINGING_DEPTH * levels[-1])

    def without_ringing(self) -> Command:
        """Command with ringing below zero replaced by zero; any other command unchanged."""
        return Command(np.maximum(self.values, 0.0), self.unit) if self.rings_below_zero else self

    def ringing_samples(self, n_time: int) -> NDArray[np.bool_]:
        """Samples, (n_time,), while a driver rings below zero and as long after: current and force are unknown."""
        left_out = np.zeros(n_time, dtype=np.bool_)
        if self.rings_below_zero:
            below = np.asarray(self.values) < -command_noise(float(np.max(self.values)), self.unit)
            for first, last in sample_runs(below):
                left_out[first : 2 * last - first] = True
        return left_out

    def resampled(self, time: Floats, grid: Floats) -> Command:
        """The command at other times [s], shape (n_grid,): the last value before each if stepped, else linear."""
        if not isinstance(self.values, np.ndarray):
            return self
        if not is_stepped(self.values):
            return Command(np.interp(grid, time, self.values), self.unit)
        # Times that are equal except for rounding are the same sample.
        last = np.searchsorted(time, grid + 1e-6 * float(np.median(np.diff(time))), side="right") - 1
        return Command(self.values[np.clip(last, 0, self.values.size - 1)], self.unit)

    def part(self, first: int, last: int, every: int = 1) -> Command:
        """Every `every`-th sample from `first` up to `last`: the value at the middle of those it stands for."""
        if not isinstance(self.values, np.ndarray):
            return self
        values = self.values[np.minimum(np.arange(first, last, every) + every // 2, last - 1)]
        return Command(freeze_samples(values), self.unit)

    def equals(self, other: Command) -> bool:
        """Whether two commands are equal, sample by sample where they vary."""
        same_kind = self.unit == other.unit and np.shape(self.values) == np.shape(other.values)
        return bool(same_kind and np.all(np.equal(self.values, other.values)))


def command_range(command: CommandValues) -> tuple[float, float]:
    """Lowest and highest value of a command."""
    return float(np.min(command)), float(np.max(command))


def command_noise(level: float, unit: CommandUnit) -> float:
    """Admissible variation of a measured constant command of this level, in its unit."""
    return _NOISE_SHARE * abs(level) + _NOISE / 10.0 ** COMMAND_SCALES[unit].decimals


def command_level(value: float, unit: CommandUnit) -> float:
    """Set point of a measured command: measured commands of one level differ by noise."""
    # Noise below zero leaves no minus sign.
    return round(value, COMMAND_SCALES[unit].decimals) + 0.0


def range_in_words(command: Floats) -> tuple[str, str]:
    """Lowest and highest value of a varying command, to a hundredth of its range or finer."""
    low, high = command_range(command)
    step = 10.0 ** np.floor(np.log10((high - low) / 100.0))
    return f"{step * round(low / step) + 0.0:.6g}", f"{step * round(high / step) + 0.0:.6g}"


def variation_in_words(command: Floats) -> str:
    """Verb for how a command changes: a ramp has half of its samples in the middle half of its range, switching few."""
    if _switches(command):
        return "switches between"
    if abs(float(np.corrcoef(np.arange(command.size), command)[0, 1])) > _RAMPING:
        return "ramps between"
    return "steps between" if is_stepped(command) else "varies between"


def is_stepped(command: Floats) -> bool:
    """Whether a command, shape (n_time,), switches or jumps, and must be held, not interpolated, between samples."""
    if _switches(command):
        return True
    change = np.abs(np.diff(command))
    beside = np.pad(change, 1)
    largest_beside = np.maximum(beside[:-2], beside[2:])
    jump = (change > _JUMP * np.ptp(command)) & (largest_beside < _BESIDE * change)
    return bool(np.sum(change[jump] ** 2) > _STEPPED * np.sum(change**2))


def _switches(command: Floats) -> bool:
    low, high = np.percentile(command, [1.0, 99.0])
    quarter = 0.25 * (high - low)
    return bool(np.mean((command > low + quarter) & (command < high - quarter)) < _BETWEEN)


def steps_of_command(command: CommandValues) -> NDArray[np.intp]:
    """First sample after each step of a command, shape (n_steps,), measured ones over several samples included."""
    if not isinstance(command, np.ndarray):
        return np.empty(0, dtype=np.intp)
    changes = np.abs(np.diff(command)) > _JUMP * np.ptp(command)
    return np.flatnonzero(changes & ~np.concatenate([[False], changes[:-1]])) + 1


def levels_of_command(command: CommandValues) -> tuple[float, ...]:
    """Values at which a command stays for some of the time, lowest first; of one that varies smoothly, a dozen.

    A level is the median of the samples of a mode, which neither noise nor the ringing of a driver shifts.
    """
    if not isinstance(command, np.ndarray):
        return (float(command),)
    left = np.quantile(command, _QUANTILES)
    low, high = np.quantile(left, [0.01, 0.99])
    width = _LEVEL * float(high - low)
    levels: list[float] = []
    most = 0
    while left.size:
        ends = np.searchsorted(left, left + width, side="right")
        counts = ends - np.arange(left.size)
        first = int(np.argmax(counts))
        if counts[first] < _MODE * most:
            break
        most = max(most, int(counts[first]))
        levels.append(float(np.median(left[first : ends[first]])))
        # Samples beside a mode are its noise.
        left = left[np.abs(left - levels[-1]) > width]
    return tuple(sorted(levels))


def sample_runs(chosen: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    """First sample, and sample beyond the last, of each run of chosen samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]])))
    return tuple((int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True))
