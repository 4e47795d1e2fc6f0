"""Checked damper tests, built from channels in SI or read from files."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.arguments import AnyArrayLike, NotNegative, checked
from mrwork.base.numbers import counted
from mrwork.base.remark import OF_FILES, ONCE, Measured, Remark, RemarkKind
from mrwork.base.summary import list_names
from mrwork.base.units import COMMAND_SCALES, CommandUnit
from mrwork.base.values import Floats, freeze_samples
from mrwork.dampers.command import Command, quantity_of_command, sample_runs
from mrwork.errors import MrworkError, RecordError, SettingError
from mrwork.files.joined import parts_of
from mrwork.files.named_columns import ColumnTable
from mrwork.files.open_table import open_table, split_part
from mrwork.records import checks
from mrwork.records.columns import (
    COMMAND,
    MARKERS,
    SKIP,
    Headings,
    check_specification,
    stated_step,
    tells_a_test,
)
from mrwork.records.command_column import (
    command_of,
    command_question,
    motion_matches_name,
    nominal_from_name,
    with_nominal_command,
)
from mrwork.records.contradictions import (
    centred_remark,
    drift_of_displacement_remark,
    jump_remark,
    late_by_making,
    repeated_part,
    still_remarks,
    velocity_agrees,
)
from mrwork.records.corners import Corners
from mrwork.records.cycles import delay_remark, drift_remark, mass_remark
from mrwork.records.damper_test import DamperTest, VelocitySource, fields_of_commands
from mrwork.records.motion import SmoothMotion, smooth_motion
from mrwork.records.parts import count_parts, side_of, span_of
from mrwork.records.pulses import pulses_remark
from mrwork.records.rig_table import (
    EVERY_USE,
    EveryUse,
    Use,
    files_not_read,
    listed_tests,
)
from mrwork.records.window import (
    FEWEST_SAMPLES,
    Signals,
    complete_rows,
    settling_samples,
    spans_with,
    straight_strokes,
    uncompared_spans,
    uniform_step,
    without_spikes,
)

_DETECTORS: Final[tuple[Callable[[DamperTest, SmoothMotion], Iterator[Remark]], ...]] = (
    checks.force_offset, checks.one_way_remark, checks.rest_before_motion, checks.samples_per_cycle,
    motion_matches_name, checks.smoothing_remark, delay_remark, mass_remark, checks.breakaway_remark,
    checks.stroke_remark, checks.force_remark, checks.pace_remark, checks.command_remark,
    checks.resolution_remarks, checks.stuck_force, still_remarks, jump_remark, drift_of_displacement_remark,
    repeated_part, drift_remark, pulses_remark, centred_remark,
)  # fmt: skip
_DERIVED: Final = RemarkKind(
    "velocity_derived", "no velocity given; derived from the displacement by {by}", verbs=ONCE
)
_STRAIGHT_STROKES: Final = RemarkKind(
    "strokes_straight",
    "no velocity given; strokes of few samples at constant speed, so that the motion is straight between samples, and "
    "the force is compared at these",
    verbs=ONCE,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """File of a record: its path, its hash, by default of the arrays, and how messages call a row."""

    path: str = ""
    sha256: str | None = None
    locate: Callable[[int], str] = lambda row: f"sample {row + 1}"


@checked
def test_from_arrays(
    time: AnyArrayLike,
    displacement: AnyArrayLike,
    force: AnyArrayLike,
    *,
    name: str = "test",
    velocity: AnyArrayLike | None = None,
    current: AnyArrayLike | None = None,
    voltage: AnyArrayLike | None = None,
    command: AnyArrayLike | None = None,
    command_unit: CommandUnit | None = None,
    amplitude: NotNegative | None = None,
    frequency: NotNegative | None = None,
    synthetic: bool = False,
    keep_velocity: bool = False,
    origin: Origin | None = None,
) -> DamperTest:
    """Build a damper test from arrays, with the checks, the uniform step and the remarks of a test from a file.

    Parameters
    ----------
    time, displacement, force
        Shape (n_time,) [s, m, N]; at least 10 samples, time increasing. Displacement and force have the sign with which
        force times velocity is dissipated power.
    name
        Name of the test in reports and messages.
    velocity
        Shape (n_time,) [m/s]; derived from the displacement when absent.
    current, voltage
        Command [A, V], one number or shape (n_time,). Where the channel is constant within noise, its median is the
        command of the test; otherwise the command varies, and each sample is held until the next.
    command, command_unit
        Likewise a command in the unit given: "A" is the current, "V" the voltage, and another one, such as "mm" or "%",
        of a damper which follows another scalar.
    amplitude, frequency
        Nominal values [m, Hz], compared with half the peak to peak of the motion and its dominant frequency.
    synthetic
        Whether the test was simulated.
    keep_velocity
        Whether a velocity is used whatever was found: also one that is far noisier than the derivative of the
        displacement, a backward or forward difference of it, half a sample off, or held over several samples. By
        default it is then derived from the displacement, with a note among the remarks.
    origin
        File of the arrays, if they are of one.

    Raises
    ------
    RecordError
        The channels are not a valid test; the message names the first invalid row.

    Examples
    --------
    >>> import numpy as np, mrwork as mr
    >>> time = np.linspace(0.0, 2.0, 401)
    >>> test = mr.test_from_arrays(time, 0.01 * np.sin(6.28 * time), -500.0 * np.cos(6.28 * time), name="sine")
    >>> [remark.code for remark in test.remarks]
    ['velocity_derived', 'force_sign_flipped']
    """
    sent = _sent_commands(current, voltage, command, command_unit)
    origin = origin or Origin()
    source = origin.path or name
    raw = Signals(
        time=_channel(time, "time", source),
        displacement=_channel(displacement, "displacement", source),
        force=_channel(force, "force", source),
        velocity=None if velocity is None else _channel(velocity, "velocity", source),
    )
    read = [_command(samples, unit, source, raw.time.size) for samples, unit in sent]
    commands = [command for command, _ in read]
    record = replace(raw, commands=tuple(command for command in commands if command.varies))
    for channel_name, channel in record.channels.items():
        if channel.size != raw.time.size:
            raise RecordError(
                f"{source}: the {channel_name} has {channel.size} samples where the time has "
                f"{raw.time.size}; give one value per sample"
            )
    remarks = list[Remark]()
    complete = complete_rows(record, remarks, source=source, locate=origin.locate)
    checks.check_varies(complete.displacement, "displacement", "m", source=source)
    checks.check_varies(complete.force, "force", "N", source=source)
    checks.check_order(complete.displacement, complete.force, source=source)
    signals = uniform_step(without_spikes(complete, remarks), remarks, source=source)
    strokes = straight_strokes(signals)
    signals = strokes or signals
    displaced, dt = signals.displacement, signals.dt
    motion = smooth_motion(displaced, dt)
    corners = Corners.of(displaced, signals.force, motion)
    uncompared = uncompared_spans(signals, motion.velocity)
    moving = _between_gaps(motion.velocity, signals)
    velocity_source: VelocitySource = "derived"
    about_velocity: tuple[Remark, ...] = (_DERIVED.remark(by=motion.differentiator.in_words),)
    if strokes is not None and strokes.velocity is not None:
        moving, about_velocity = strokes.velocity, (_STRAIGHT_STROKES.remark(),)
    elif signals.velocity is not None and complete.velocity is not None:
        late = late_by_making(complete.time, complete.displacement, complete.velocity)
        moving, velocity_source, about_velocity = velocity_agrees(
            signals.velocity,
            displaced,
            motion,
            spans_with(uncompared, corners.reached),
            late=late,
            keep=keep_velocity,
        )
    left_out = checks.clipped_samples(signals.force)
    if velocity_source == "measured":
        corners = corners.leaping(moving)
    if strokes is None and (velocity_source == "derived" or not keep_velocity):
        moving = corners.velocity(moving, displaced, dt, velocity_source)
        remarks += corners.remarks(signals.time, velocity_source)
        left_out |= corners.about
    for sent_command in signals.commands:
        left_out |= sent_command.ringing_samples(displaced.size)
    on_grid = {sent_command.unit: sent_command.without_ringing() for sent_command in signals.commands}
    fields = fields_of_commands(
        [on_grid.get(given_command.unit, given_command) for given_command in commands]
    )
    resisting, about_sign = checks.force_sign(displaced, signals.force, motion.velocity, dt)
    remarks += [*about_velocity, *about_sign, *(remark for _, about in read for remark in about)]
    test = DamperTest(
        name=name,
        path=origin.path,
        sha256=_digest(raw, sent) if origin.sha256 is None else origin.sha256,
        dt=dt,
        start_time=float(signals.time[0]),
        displacement=freeze_samples(displaced),
        velocity=freeze_samples(moving),
        force=freeze_samples(resisting),
        velocity_source=velocity_source,
        n_settle=settling_samples(displaced),
        uncompared=spans_with(uncompared, left_out),
        amplitude=amplitude,
        frequency=frequency,
        synthetic=synthetic,
        **{"command_unit": command_unit if command is None else None, **fields},
    )
    # What stands between the samples of straight strokes is a mean of them, and of no channel.
    if strokes is None:
        test = replace(test, smoothing=checks.detect_smoothing(test, motion.frequency))
    return replace(test, remarks=(*remarks, *examine(test, motion)))


def _between_gaps(velocity: Floats, signals: Signals) -> Floats:
    """The velocity of a motion with gaps: a gap ends what is differentiated."""
    if not signals.missing.any():
        return velocity
    velocity = velocity.copy()
    for first, last in sample_runs(~signals.missing):
        if last - first >= FEWEST_SAMPLES:
            velocity[first:last] = smooth_motion(signals.displacement[first:last], signals.dt).velocity
    return velocity


def examine(test: DamperTest, motion: SmoothMotion) -> tuple[Remark, ...]:
    """Run all detectors on a test, whose smoothed motion is given."""
    return tuple(remark for detector in _DETECTORS for remark in detector(test, motion))


def _channel(samples: ArrayLike, name: str, source: str) -> Floats:
    channel = np.asarray(samples, dtype=np.float64)
    if channel.ndim != 1:
        raise RecordError(
            f"{source}: the {name} must have shape (n_time,), got {channel.shape}; give one channel"
        )
    return channel


def _sent_commands(
    current: ArrayLike | None,
    voltage: ArrayLike | None,
    command: ArrayLike | None,
    command_unit: CommandUnit | None,
) -> list[tuple[ArrayLike, CommandUnit]]:
    if command is not None and command_unit is None:
        raise SettingError(
            '`command` has no unit; give `command_unit`, "A" for a current or "V" for a voltage'
        )
    sent = dict[CommandUnit, ArrayLike]()
    for samples, unit in ((current, "A"), (voltage, "V"), (command, command_unit)):
        if samples is None or unit is None:
            continue
        if unit in sent:
            raise SettingError(f"a command in {unit} is given twice; give it once")
        sent[unit] = samples
    return [(sent[unit], unit) for unit in COMMAND_SCALES if unit in sent]


def _command(
    samples: ArrayLike, unit: CommandUnit, source: str, n_time: int
) -> tuple[Command, tuple[Remark, ...]]:
    quantity = quantity_of_command(unit)
    channel = _channel(np.atleast_1d(samples), quantity, source)
    # A constant one is not compared with the other channels later; a number of a MATLAB file is an array of one.
    if channel.size not in (1, n_time):
        raise RecordError(
            f"{source}: the {quantity} has {channel.size} samples where the time has {n_time}; give one value per "
            "sample, or a number"
        )
    return command_of(channel, unit, source=source)


def _digest(raw: Signals, commands: Iterable[tuple[ArrayLike, CommandUnit]]) -> str:
    sent = [(quantity_of_command(unit), samples) for samples, unit in commands]
    digest = hashlib.sha256()
    for name, samples in (*raw.channels.items(), *sent):
        digest.update(name.encode())
        # Little-endian on every machine, so that the hash depends on the values only.
        digest.update(np.ascontiguousarray(samples, dtype="<f8").tobytes())
    return digest.hexdigest()


# Columns that a note names; more are counted.
_MOST_NAMED: Final = 8


@checked
def read_damper_test(
    path: str | os.PathLike[str],
    *,
    columns: Mapping[str, str] | None = None,
    keep_velocity: bool = False,
    start: float | None = None,
    end: float | None = None,
) -> DamperTest:
    """Read one test from a text, .mat, .tdms, .xlsx or .xls file, check it and convert it to SI.

    Columns are recognised by their names with units (``t_s``, ``displacement_mm``, ``Force (kN)``, ``current_a``, in
    any case); a column of times of the day is the time from its first. Time, displacement and force are required;
    velocity, current and voltage are optional, and so is a command in another unit (``valve_mm``, ``opening_%``,
    ``setpoint_psi``), which is not converted. A file name such as ``10mm1Hz0x5A`` gives nominal amplitude, frequency
    and command; a column of the command takes precedence.

    Parameters
    ----------
    path
        The file; ``sweeps.csv#2`` is its second sweep or burst, or the second of several tests side by side, and
        ``motion.csv+load.csv`` two files of one test, joined by a channel that both have, else by their times;
        ``+load.csv@-1.5s`` moves those of the second.
    columns
        Quantity (``time``, ``displacement``, ``velocity``, ``force``, ``current``, ``voltage``) to its column:
        ``"COLUMN:UNIT"``, or ``"COLUMN"`` where the file states the unit; a unit at the end of the name may be omitted.
        ``command`` is a column of current or voltage, or a number with its unit, as ``"0.5 A"``, which goes before the
        columns of the file; ``time`` may likewise be a step or a sampling rate, as ``"200 Hz"``. A column may be given
        by its number from 1, and in volts or counts by what one of them stands for, with an offset, as
        ``"Load (V):V*200N"`` or ``"Ch 3:counts*0.5N-20N"``. ``"none"`` leaves out a quantity, or the column with that
        heading; ``markers`` is ``"skip"`` where lines among the rows mark events.
    keep_velocity
        As for `test_from_arrays`.
    start, end
        The rows from the first to the last between these times [s] alone, of a file whose other rows are no test;
        `cut` takes a part of a test, with the velocity of the whole.

    Returns
    -------
    DamperTest
        Test with the results of all checks in its `remarks`.

    Raises
    ------
    RecordError
        The file cannot be read as a test; the message names file, line and remedy.
    UnitError
        A column has no unit or a unit of another quantity.
    SettingError
        `columns` is malformed.

    Examples
    --------
    >>> test = read_damper_test("rig/10mm1Hz0x5A.csv", columns={"force": "F:kN"})  # doctest: +SKIP
    >>> test.current, test.frequency  # doctest: +SKIP
    (0.5, 1.0)
    """
    name, number = split_part(path)
    file, source = Path(name), name
    specs = dict(columns or {})
    table = open_table(file, tells_a_test)
    if MARKERS in specs:
        check_specification(MARKERS, specs.pop(MARKERS))
        table, _ = table.without_markers()
    step = stated_step(specs.get("time", ""))
    headings, is_side = side_of(table, Headings.of(table, source), number)
    are_assigned = False
    try:
        chosen, scalar = headings.assign(specs)
        are_assigned = True
        of_scalar = () if scalar is None or scalar.value is not None else (scalar.column,)
        numbers = table.read([*(name for choice in chosen.values() for name in choice.columns), *of_scalar])
    except MrworkError as error:
        if not (number or are_assigned) and (count := count_parts(table)) > 1:
            raise RecordError(
                f"{source}: has {count} tests side by side; read each by its number, as {source}#1, or let mrwork "
                f"check {source} --table list them"
            ) from error
        _refuse_sorted(table, headings, specs)
        marked = marked_lines(table)
        before = f"{source}: " if are_assigned else f"{error}; "
        refusal = type(error)(f"{before}{marked}") if marked else error
        refusal.of_columns = bool(marked) or not are_assigned
        raise refusal from None
    # Overflowing values become infinite, and the checks refuse them with their line.
    with np.errstate(over="ignore", invalid="ignore"):
        si = {quantity: choice.in_si(numbers) for quantity, choice in chosen.items()}
    if step is not None:
        si["time"] = step * np.arange(si["displacement"].size, dtype=np.float64)
    turned = chosen["displacement"].rotary and np.abs(np.diff(si["displacement"])).max(initial=0.0) > np.pi
    if turned:
        counted_anew = np.flatnonzero(np.abs(np.diff(si["displacement"])) > np.pi)
        si["displacement"] = np.unwrap(si["displacement"])
    part = _rows_between(si["time"], start, end, source)
    if number and not is_side:
        part = span_of(si["time"], number, source)
    si = {quantity: samples[part] if samples.size > 1 else samples for quantity, samples in si.items()}
    stem = "+".join(part.path.stem for part in parts_of(file))
    nominal = nominal_from_name(stem)
    test = test_from_arrays(
        name=f"{stem}#{number}" if number else stem,
        time=si["time"],
        displacement=si["displacement"],
        force=si["force"],
        velocity=si.get("velocity"),
        current=si.get("current"),
        voltage=si.get("voltage"),
        command=None if scalar is None else numbers[scalar.column][part] if of_scalar else scalar.value,
        command_unit=None if scalar is None else scalar.unit,
        amplitude=nominal.amplitude,
        frequency=nominal.frequency,
        keep_velocity=keep_velocity,
        origin=Origin(
            path=os.fspath(path),
            sha256=table.sha256
            if not number
            else hashlib.sha256(f"{table.sha256}#{number}".encode()).hexdigest(),
            locate=lambda row: table.locate(part.start + row),
        ),
    )
    used = {*(name for choice in chosen.values() for name in choice.columns), *of_scalar}
    test = with_nominal_command(test, nominal, headings.unclear_commands(used))
    if step is not None:
        # Who states the step has stated the unit of the time.
        test = replace(test, remarks=tuple(each for each in test.remarks if each.code != checks.PACE.code))
    rotation = list[Remark]()
    if chosen["displacement"].rotary:
        rotation.append(ROTARY.remark())
        kept = tuple(remark for remark in test.remarks if remark.code not in checks.OF_STROKES)
        test = replace(test, remarks=kept)
    if turned:
        first = f"{table.locate(int(counted_anew[0]) + 1)}"
        rotation.append(_TURNED.remark(measured=Measured(float(counted_anew.size), ""), first=first))
    asked = () if test.commands or COMMAND in specs else headings.asked_commands(used)
    return replace(
        test, remarks=(*command_question(asked, table), *rotation, *test.remarks, *unused_remark(table, used))
    )


def _refuse_sorted(table: ColumnTable, headings: Headings, columns: Mapping[str, str]) -> None:
    """Refuse rows in the order of the displacement before a file without times is asked for them."""
    try:
        chosen, _ = headings.assign({**columns, "time": "1 s"})
        numbers = table.read([name for choice in chosen.values() for name in choice.columns])
    except MrworkError:
        return
    displacement, force = (chosen[quantity].in_si(numbers) for quantity in ("displacement", "force"))
    checks.check_order(displacement, force, source=headings.source)


def _rows_between(time: Floats, start: float | None, end: float | None, source: str) -> slice:
    """Rows from the first that is not before `start` up to the first after it that is beyond `end`."""
    least, most = -np.inf if start is None else start, np.inf if end is None else end
    inside = np.flatnonzero((time >= least) & (time <= most))
    if start is None and end is None:
        return slice(0, time.size)
    if not inside.size:
        raise RecordError(
            f"{source}: no row has a time from {least:g} to {most:g} s; its times are {np.nanmin(time):g} to "
            f"{np.nanmax(time):g} s"
        )
    after = time[inside[0] :]
    # Up to the next sweep, whose time begins again.
    beyond = np.flatnonzero((after > most) | (np.diff(after, prepend=after[0]) < 0.0))
    return slice(int(inside[0]), int(inside[0] + beyond[0]) if beyond.size else time.size)


def marked_lines(table: ColumnTable) -> str:
    """What to do about lines among the rows that are none; empty where there are none."""
    _, markers = table.without_markers()
    if not markers:
        return ""
    shown = f"{counted(len(markers), 'line')} of other form between them, {list_names(markers, 3)}"
    cure = f"skip what marks events with --column {MARKERS}={SKIP}, or correct the file"
    return f"the rows of numbers have {shown}; {cure}"


_NOT_USED: Final = RemarkKind("not_used", "not used: {parts}", verbs=OF_FILES)
_TEMPERATURES: Final = re.compile(
    r"(?<![a-z])t[eé]mp(?![o])|°\s*[cf]\b|(?<![a-z])deg[ _]?[cf]\b|温度", re.IGNORECASE
)
ROTARY: Final = RemarkKind(
    "rotary",
    "angle and torque: of all that follows N is N m, mm is mrad, mm/s is mrad/s, N s/m is N m s/rad, N/m is N m/rad "
    "and 1/m is 1/rad",
    verbs=OF_FILES,
)
"""Of a rotary damper, whose model is the same with angle, rate and torque."""
_TURNED: Final = RemarkKind(
    "angle_continued",
    "the angle is counted anew at a turn {value:.0f} times, first at {first}; it was continued",
    verbs=OF_FILES,
)
_JOINED: Final = RemarkKind("files_joined", "{0}", verbs=OF_FILES)
_JOINED_BY_TIMES: Final = RemarkKind(
    "files_joined_by_times",
    "{0}; nothing shows that their times count from one instant",
    "record one channel in both files, or times of the day, or move a file, as in MOTION.csv+LOAD.csv@0.05s",
    verbs=OF_FILES,
)
_ENCODING: Final = RemarkKind("encoding", "the text is no UTF-8 and was read as {encoding}", verbs=ONCE)
_FURTHER: Final = RemarkKind(
    "further_records",
    "{number} more sheets have a record: {names}",
    "save each as a file of its own to read it",
    verbs=OF_FILES,
)
_NOT_READ: Final = RemarkKind("files_not_read", "{sentence}", verbs=OF_FILES)


def unused_remark(table: ColumnTable, used: Collection[str]) -> tuple[Remark, ...]:
    """Note the columns and other parts of a file that no quantity of the test is read from, and a temperature."""
    columns = [f"'{name}'" for name in table.names if name and name not in used]
    named = f"column{'s' if len(columns) > 1 else ''} {list_names(columns, _MOST_NAMED)}"
    parts = [*([named] if columns else []), *table.unused]
    remarks = [_NOT_USED.remark(parts="; ".join(parts))] if parts else []
    for name in table.names:
        if name not in used and _TEMPERATURES.search(f"{name} {table.units.get(name, '')}"):
            degrees = table.numbers(name)
            if degrees is not None and np.isfinite(degrees).all():
                mean, ends = Measured(float(degrees.mean()), ""), (float(degrees.min()), float(degrees.max()))
                remarks.append(checks.TEMPERATURE.remark(name, measured=mean, least=ends[0], most=ends[1]))
    if table.joined:
        remarks.append((_JOINED if table.is_sure else _JOINED_BY_TIMES).remark(table.joined))
    if table.encoding:
        remarks.append(_ENCODING.remark(encoding=table.encoding))
    if table.further:
        further = list_names([f"'{name}'" for name in table.further], _MOST_NAMED)
        remarks.append(_FURTHER.remark(number=len(table.further), names=further))
    return tuple(remarks)


@checked
def read_damper_tests(
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    *,
    columns: Mapping[str, str] | None = None,
    use: Use | EveryUse = EVERY_USE,
    keep_velocity: bool = False,
) -> tuple[DamperTest, ...]:
    """Read several tests: files, folders and tables of tests in their order, or a glob pattern in name order.

    Parameters
    ----------
    paths
        A folder stands for its table ``tests.csv``, or without one for all records in it; see `read_test_table`.
    columns
        As for `read_damper_test`, for all files; entries of a table go before them.
    use
        Of tables, read the tests for this use only: ``fit``, ``calibration`` or ``test``. The default, ``every``, reads
        all that have a use, held-out tests included: identify from those for ``fit``.
    keep_velocity
        As for `test_from_arrays`.

    Raises
    ------
    RecordError
        No file matches the pattern, there is no path, or a file cannot be read as a test.

    Examples
    --------
    >>> tests = read_damper_tests("rig/", use="fit")  # doctest: +SKIP
    """
    path_list = [paths] if isinstance(paths, str | os.PathLike) else list(paths)
    rows = listed_tests(paths if isinstance(paths, str | os.PathLike) else path_list, use=use)
    unread = files_not_read(path_list)
    tests = []
    for row in rows:
        specs = {**(columns or {}), **row.columns}
        test = read_damper_test(row.file, columns=specs, keep_velocity=keep_velocity)
        sentence = unread.get(Path(test.path).parent)
        beside = () if sentence is None else (_NOT_READ.remark(sentence=sentence),)
        tests.append(replace(test, remarks=(*test.remarks, *beside)))
    return tuple(tests)
