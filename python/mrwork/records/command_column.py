"""Command of a test from its column, and the nominal amplitude, frequency and command that its file name states."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.remark import OF_FILES, ONCE, Measured, Remark, RemarkKind
from mrwork.base.summary import list_names
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats
from mrwork.dampers.command import (
    Command,
    command_noise,
    command_range,
    quantity_of_command,
    range_in_words,
    variation_in_words,
)
from mrwork.errors import RecordError
from mrwork.files.named_columns import ColumnTable, column_option, words_and_unit
from mrwork.records.damper_test import DamperTest, fields_of_commands
from mrwork.records.motion import SmoothMotion

# Fewest samples of a pulse that noise does not explain.
_PULSE: Final = 3
# Tolerances: nominal amplitude and frequency are set points, which the rig reaches only approximately.
_AMPLITUDE: Final = 0.25
_FREQUENCY: Final = 0.20
_VARIES: Final = RemarkKind(
    "command_varies",
    "the {0} {1} {lowest} and {highest} {2}, by {value:.4g} {2}; a model follows it by current laws (--law), a coil "
    "behind its set point by --driver-lag",
    verbs=ONCE,
    cured_by="pulses",
)
_RINGS: Final = RemarkKind(
    "command_rings",
    "the {0} rings below zero, to {value:.3g} {1} ({share:.2g} % of the samples); it is taken as zero there, and the "
    "force is not compared until as long after",
    verbs=ONCE,
)
_NEGATIVE: Final = RemarkKind(
    "command_negative",
    "the {0} goes down to {value:g}: the force does not depend on its direction",
    "give its magnitude",
)


def command_of(samples: Floats, unit: CommandUnit, *, source: str) -> tuple[Command, tuple[Remark, ...]]:
    """A command: its median, if it varies no more than a measured constant does; else as it varies, with remarks."""
    quantity = quantity_of_command(unit)
    present = samples[~np.isnan(samples)]
    if present.size == 0 or np.isinf(present).any():
        problem = "has no value" if present.size == 0 else "has infinite values"
        raise RecordError(f"{source}: the {quantity} {problem}; correct the column or leave it out")
    value = float(np.median(present))
    tolerance = command_noise(value, unit)
    low, high = np.percentile(present, [1.0, 99.0])
    is_constant = high - low <= tolerance and not _has_pulse(np.abs(present - value) > tolerance)
    command = Command(value if is_constant else present, unit)
    if beyond := command.beyond_any_driver:
        raise RecordError(f"{source}: the {quantity} {beyond}; check its unit, or leave the column out")
    remarks = []
    if not is_constant:
        lowest, highest = range_in_words(np.asarray(command.without_ringing().values))
        words = quantity, variation_in_words(present), unit
        span = Measured(float(highest) - float(lowest), unit)
        remarks.append(_VARIES.remark(*words, measured=span, lowest=lowest, highest=highest))
    if command.rings_below_zero:
        lowest_sample = float(present.min())
        share = 100.0 * float(np.mean(present < -command_noise(lowest_sample, unit)))
        remarks.append(_RINGS.remark(quantity, unit, measured=Measured(lowest_sample, unit), share=share))
    if command.impossibility:
        lowest_sample = command_range(command.values)[0]
        remarks.append(_NEGATIVE.remark(quantity, measured=Measured(lowest_sample, unit)))
    return Command(value if is_constant else samples, unit), tuple(remarks)


def _has_pulse(outside: NDArray[np.bool_]) -> bool:
    """Whether samples beyond the tolerance follow each other, as in a pulse too short for the percentiles."""
    runs = np.convolve(outside, np.ones(_PULSE), mode="valid") if outside.size >= _PULSE else np.zeros(0)
    return bool(np.any(runs > _PULSE - 0.5))


DISAGREES: Final = RemarkKind(
    "name_disagrees",
    "the file name says {article} {0} of {named:.3g} {1}, the record {recorded:.3g} {1}{how}",
    "rename the file, or check the column and its unit",
    verbs=OF_FILES,
)


def motion_matches_name(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Warn if amplitude or frequency are far from their nominal values."""
    amplitude, frequency, dominant = test.amplitude, test.frequency, motion.frequency
    # The dominant frequency is resolved to half a line of the spectrum.
    resolved = 0.5 / (test.dt * test.n_time)
    if frequency is not None and abs(dominant - frequency) > _FREQUENCY * frequency + resolved:
        yield DISAGREES.remark("frequency", "Hz", article="a", named=frequency, recorded=dominant, how="")
    recorded = 0.5 * float(np.ptp(test.displacement))
    if amplitude is not None and abs(recorded - amplitude) > _AMPLITUDE * amplitude:
        how = " (half the peak to peak)"
        named, recorded = 1e3 * amplitude, 1e3 * recorded
        yield DISAGREES.remark("amplitude", "mm", article="an", named=named, recorded=recorded, how=how)


_SEVERAL: Final = RemarkKind(
    "name_says_several",
    "the file name says {names}, so its command is not known",
    "give it, as in --column command=0.5A, or in a table of tests, as mrwork check FILES --table begins it",
)
_UNCLEAR: Final = RemarkKind(
    "command_unclear",
    "column '{0}' may be the command and does not say its unit, so the {named} of the file name are not used",
    "give one, as in {option} or --column 'command={named}'",
)
_NOT_OF_NAME: Final = RemarkKind(
    "name_not_used", "the command is {recorded}; the {named} of the file name are not used", verbs=OF_FILES
)


_ASKED: Final = RemarkKind(
    "command_asked",
    "column{s} {0} may be the command of the damper, and no other column is; the test is read without one",
    "say so, as in {option}, or --column command=none",
    verbs=OF_FILES,
)


def command_question(names: Sequence[str], table: ColumnTable) -> tuple[Remark, ...]:
    """A question about columns in a unit of commands, of a test without a command; nothing without such columns."""
    if not names:
        return ()
    unit = words_and_unit(names[0])[1] or table.units.get(names[0], "")
    quoted = list_names([f"'{name}'" for name in names])
    option, plural = column_option("command", names[0], unit), "s" if len(names) > 1 else ""
    return (_ASKED.remark(quoted, s=plural, option=option),)


def with_nominal_command(test: DamperTest, nominal: Nominal, unclear: Sequence[str] = ()) -> DamperTest:
    """Return the test with the command of its file name if it has none, and with a remark if the name is not used.

    `unclear` are columns that may be the command and do not say their unit: the name is no evidence beside them.
    """
    if nominal.command is None:
        if not nominal.several or test.commands or unclear:
            return test
        remark = _SEVERAL.remark(names=" and ".join(nominal.several))
        return replace(test, remarks=(*test.remarks, remark))
    value, unit = float(nominal.command.values), nominal.command.unit
    recorded = {command_unit: command for command, command_unit in test.commands}
    named = f"{value:g} {unit}"
    if unit in recorded:
        # A varying command disagrees if it never is the nominal one.
        nearest = float(np.clip(value, *command_range(recorded[unit])))
        if abs(nearest - value) <= command_noise(value, unit):
            return test
        words = nominal.command.quantity, unit
        remark = DISAGREES.remark(*words, article="a", named=value, recorded=nearest, how="")
    elif recorded:
        remark = _NOT_OF_NAME.remark(recorded=test.command_in_words, named=named)
    elif unclear:
        remark = _UNCLEAR.remark(unclear[0], named=named, option=column_option("command", unclear[0], unit))
    else:
        return replace(test, **fields_of_commands([nominal.command]))
    return replace(test, remarks=(*test.remarks, remark))


_NUMBER: Final = r"\d+(?:[x.]\d+)?"
_NAME: Final = re.compile(
    rf"(?P<amplitude>{_NUMBER})mm_?(?P<frequency>{_NUMBER})Hz"
    rf"(?:_?(?P<command>{_NUMBER})(?P<unit>[AV]))?(?![A-Za-z\d])",
    re.IGNORECASE,
)
# A number with a unit of current or voltage anywhere in a name: 500mA_run3, sine 0.5 A, dec_3x21V.
_COMMAND_IN_NAME: Final = re.compile(r"(?<![\dA-Za-z.])(\d+(?:[x.,]\d+)?)[\s_]?(m?[AV])(?![A-Za-z\d])")


@dataclass(frozen=True, slots=True, kw_only=True)
class Nominal:
    """Nominal values from a file name: amplitude [m], frequency [Hz], and the command in A or V; `None` if absent.

    A name that `is_regular` states them together, as 10mm1Hz0x5A; `several` are commands of a name with more than one.
    """

    amplitude: float | None = None
    frequency: float | None = None
    command: Command | None = None
    is_regular: bool = True
    several: tuple[str, ...] = ()


def nominal_from_name(stem: str) -> Nominal:
    """Read amplitude, frequency and command, in A or V, from a file name; the decimal point may be written ``x``.

    The command may stand apart from them, as in ``run3_500mA``, where it is the only one.

    Examples
    --------
    >>> nominal_from_name("unfiltered_25mm0x25Hz_0.75A").frequency
    0.25
    """
    match = _NAME.search(stem)
    nominal = Nominal()
    if match is not None:
        # Division instead of multiplication: 5 / 1000 is the double nearest to 0.005.
        amplitude, frequency = _value(match["amplitude"]) / 1000.0, _value(match["frequency"])
        nominal = Nominal(amplitude=amplitude, frequency=frequency)
        if match["command"] is not None:
            return replace(nominal, command=_command(match["command"], match["unit"]))
    named = {
        (_value(number), mark): _command(number, mark) for number, mark in _COMMAND_IN_NAME.findall(stem)
    }
    if len(named) > 1:
        several = tuple(f"{value:g} {mark}" for value, mark in sorted(named))
        return replace(nominal, is_regular=False, several=several)
    return replace(nominal, command=next(iter(named.values()), None), is_regular=not named)


def _command(number: str, mark: str) -> Command:
    """The command of a number and a mark such as A, V or mA."""
    value = _value(number) / (1000.0 if len(mark) > 1 else 1.0)
    return Command(value, "V" if mark[-1].upper() == "V" else "A")


def _value(text: str) -> float:
    return float(re.sub("[xX,]", ".", text))
