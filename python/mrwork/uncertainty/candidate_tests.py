"""Candidate tests: sinusoids within the limits of a rig, and the motion of each."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from pathlib import Path
from typing import Annotated

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.hints import InUnit, Within
from mrwork.base.units import CommandUnit
from mrwork.dampers.command import LARGEST_COMMAND, Command, command_level
from mrwork.dampers.simulation import Amplitude, Frequency, Loading, sinusoid
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import RecordError, SettingError
from mrwork.files.delimited import open_delimited
from mrwork.records import DamperTest
from mrwork.records.damper_test import as_tests, range_of_tests
from mrwork.records.motion import spectrum

# Default grid: range beyond the tested amplitudes and frequencies either way, number of values, excess of velocity.
_FURTHER = 2.0
_STEPS = 7
_FASTER = 1.5
_SAMPLES_PER_CYCLE = 200
# Multiple of the largest tested command above which a candidate is a slip of its unit.
_FAR_COMMAND = 10.0
# The first cycle settles the transient, the other two count.
_CYCLES = 3
# Bytes of the derivatives that a plan keeps of all its candidates.
_MOST_BYTES = 512 << 20
_COLUMNS = ("amplitude", "frequency", "current")

PlannedCommand = Annotated[float, Within(least=0.0, most=LARGEST_COMMAND)]


@checked
class Candidate:
    """Sinusoid: amplitude [m] (half the peak to peak), frequency [Hz], command of a model with laws."""

    amplitude: Amplitude
    frequency: Frequency
    command: PlannedCommand | None = None

    @property
    def peak_velocity(self) -> float:
        """Peak velocity of the sinusoid [m/s], 2 pi f a."""
        return 2.0 * pi * self.frequency * self.amplitude

    @checked
    def in_words(self, unit: CommandUnit | None) -> str:
        """Description such as "10 mm, 1 Hz, 0.5 A"."""
        command = "" if self.command is None else f", {self.command:g} {unit}"
        return f"{1e3 * self.amplitude:.3g} mm, {self.frequency:.3g} Hz{command}"


@checked
class Limits:
    """Limits of a rig; `None` is no limit.

    Parameters
    ----------
    stroke
        Largest stroke of the rig, peak to peak. [m]
    peak_velocity
        Largest velocity of the rig. [m/s]; dampers of a gun's recoil reach about 10 m/s.
    """

    stroke: Annotated[float, Within(least=1e-6, most=2.0), InUnit("m")] | None = None
    peak_velocity: Annotated[float, Within(least=1e-6, most=50.0), InUnit("m/s")] | None = None

    @checked
    def allow(self, candidate: Candidate) -> bool:
        """Whether the test is within the limits, up to rounding."""
        within = 1.0 + 1e-9
        return (self.stroke is None or 2.0 * candidate.amplitude <= self.stroke * within) and (
            self.peak_velocity is None or candidate.peak_velocity <= self.peak_velocity * within
        )


@checked
def candidate_grid(
    spec: DamperSpec,
    tests: DamperTest | Sequence[DamperTest],
    *,
    amplitudes: Sequence[Amplitude] = (),
    frequencies: Sequence[Frequency] = (),
    commands: Sequence[PlannedCommand] = (),
    limits: Limits | None = None,
) -> tuple[Candidate, ...]:
    """All combinations of amplitude, frequency and command within the limits of the rig.

    Default amplitudes and frequencies range from half the least tested value to twice the largest; default commands are
    the tested ones, and the middle of a wide gap between them. Where either grid is a default, the default limit of
    velocity is 1.5 times the largest tested one.

    Parameters
    ----------
    amplitudes
        Amplitudes of the candidates, half of peak to peak, as 0.005,0.01; default: about the tested amplitudes. [m]
    frequencies
        Frequencies of the candidates; default: about the tested frequencies. [Hz]
    commands
        Currents or voltages of the candidates, where the model has current laws; default: the tested commands.
    """
    if commands and spec.command_unit is None:
        raise SettingError(
            f"{spec.name} was identified without current laws, so no test at another current can be predicted; "
            "leave the currents out"
        )
    limits = limits or Limits()
    tests = as_tests(tests)
    _refuse_far_commands(commands, spec, tests)
    excitations = [excitation_of(test) for test in tests]
    if limits.peak_velocity is None and not (amplitudes and frequencies):
        fastest = _FASTER * max(excitation.peak_velocity for excitation in excitations)
        limits = Limits(stroke=limits.stroke, peak_velocity=fastest)
    amplitudes = amplitudes or _about([excitation.amplitude for excitation in excitations])
    frequencies = frequencies or _about([excitation.frequency for excitation in excitations])
    levels: Sequence[float | None] = [None]
    if spec.command_unit is not None:
        unit = spec.command_unit
        recorded = [command for test in tests for command in test.commands if command.unit == unit]
        gap = range_of_tests(tests, unit).gap
        middle = () if gap is None else (command_level(0.5 * sum(gap), unit),)
        levels = commands or sorted({*middle, *(level for command in recorded for level in _ends(command))})
    _check_count(len(levels) * len(amplitudes) * len(frequencies), spec)
    grid = tuple(
        candidate
        for command in levels
        for amplitude in amplitudes
        for frequency in frequencies
        if limits.allow(
            candidate := Candidate(amplitude=float(amplitude), frequency=float(frequency), command=command)
        )
    )
    if not grid:
        raise SettingError(
            "no candidate is within the limits of the rig; raise them, or give smaller amplitudes"
        )
    return grid


def _refuse_far_commands(commands: Sequence[float], spec: DamperSpec, tests: Sequence[DamperTest]) -> None:
    """Refuse commands far above all tested ones, as those in milliamperes are."""
    if not commands or spec.command_unit is None:
        return
    unit = spec.command_unit
    largest = max(
        (float(np.max(command)) for test in tests for command, symbol in test.commands if symbol == unit),
        default=0.0,
    )
    if largest > 0.0 and max(commands) > _FAR_COMMAND * largest:
        raise SettingError(
            f"a command of {max(commands):g} {unit} is more than {_FAR_COMMAND:g} times the largest tested one, "
            f"{largest:g} {unit}, and the laws tell nothing there; give commands in {unit}"
        )


def read_candidates(path: Path, spec: DamperSpec, limits: Limits | None = None) -> tuple[Candidate, ...]:
    """Candidates from a text file: columns `amplitude` [m], `frequency` [Hz], and `current` for models with laws."""
    columns = _COLUMNS if spec.command_unit is not None else _COLUMNS[:2]
    table = open_delimited(path)
    expected = (
        f"expected the columns {', '.join(columns)} with numbers in SI, amplitude and frequency positive"
    )
    if not set(columns) <= set(table.names):
        raise RecordError(f"{path}, {table.locate(0)}: {expected}")
    rows = np.stack([*table.read(columns).values()], axis=1)
    _check_count(len(rows), spec)
    wrong = ~np.isfinite(rows).all(axis=1) | (rows[:, :2] <= 0.0).any(axis=1)
    if wrong.any():
        raise RecordError(f"{path}, {table.locate(int(np.argmax(wrong)))}: {expected}")
    candidates = [
        Candidate(amplitude=amplitude, frequency=frequency, command=command[0] if command else None)
        for amplitude, frequency, *command in rows.tolist()
    ]
    allowed = tuple(candidate for candidate in candidates if (limits or Limits()).allow(candidate))
    if not allowed:
        raise RecordError(
            f"{path} has no candidate within the limits of the rig; add some, or raise the limits"
        )
    return allowed


def _check_count(count: int, spec: DamperSpec) -> None:
    size = 8 * (_CYCLES - 1) * _SAMPLES_PER_CYCLE * (2 * len(spec.names) + 1)
    if count * size > _MOST_BYTES:
        raise SettingError(
            f"{count:,} candidates of {spec.name} would take {count * size / 1e9:,.1f} GB and "
            f"{count * (2 * len(spec.names) + 1):,} simulations; give {_MOST_BYTES // size:,} at most"
        )


def harmonic_motion(candidate: Candidate, spec: DamperSpec) -> tuple[Loading, slice]:
    """Motion of a candidate from mid-stroke in three cycles, and the samples of the counted ones."""
    loading = sinusoid(
        candidate.amplitude,
        candidate.peak_velocity,
        cycles=_CYCLES,
        per_cycle=_SAMPLES_PER_CYCLE,
        command=candidate.command,
        command_unit=spec.command_unit,
    )
    return loading, slice(_SAMPLES_PER_CYCLE, _CYCLES * _SAMPLES_PER_CYCLE)


def excitation_of(test: DamperTest) -> Candidate:
    """Sinusoid of the nominal amplitude and frequency of a test, or else half its peak to peak at its dominant one."""
    return Candidate(
        amplitude=test.amplitude or 0.5 * float(np.ptp(test.displacement)),
        frequency=test.frequency or float(spectrum(test.displacement, test.dt).dominant),
    )


def _ends(command: Command) -> tuple[float, ...]:
    """A constant command, or the lowest and the highest level of one that varies."""
    if not isinstance(command.values, np.ndarray):
        return (command.values,)
    return command.levels[0], command.levels[-1]


def _about(values: Sequence[float]) -> list[float]:
    spread = np.geomspace(min(values) / _FURTHER, max(values) * _FURTHER, _STEPS)
    return sorted({float(f"{value:.2g}") for value in spread})
