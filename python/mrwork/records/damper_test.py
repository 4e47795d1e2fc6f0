"""Damper test: a record in SI on a uniform time step, with its remarks, observation model and operating ranges."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations, pairwise
from operator import attrgetter
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.base.arguments import Count, NotNegative, Samples, Whole, checked
from mrwork.base.hints import Within
from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes
from mrwork.base.numbers import format_rounded
from mrwork.base.plotted import Plotted
from mrwork.base.remark import Remark as Remark
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Column, as_json
from mrwork.base.units import COMMAND_SCALES, CommandUnit
from mrwork.base.values import Floats, array_dataclass, freeze_samples, keep_arrays
from mrwork.dampers.command import Command, CommandValues, command_level
from mrwork.dampers.simulation import Loading
from mrwork.dampers.spec import DamperSpec
from mrwork.dampers.tested_range import Exceedance as Exceedance
from mrwork.dampers.tested_range import OperatingRange as OperatingRange
from mrwork.dampers.tested_range import Outside as Outside
from mrwork.dampers.tested_range import covering, least_stroke
from mrwork.errors import RecordError, SettingError
from mrwork.records.motion import crossing_instants, smooth_motion
from mrwork.records.observation import AS_IT_IS, Observation

Channel = Literal["displacement", "force"]
VelocitySource = Literal["measured", "derived"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Smoothing:
    """A moving average over `window_seconds` [s] that was applied to the named channels."""

    _made_by: ClassVar[str] = "mr.read_damper_test(path)"

    window_seconds: float
    channels: tuple[Channel, ...]


@checked
@array_dataclass(repr=False)
class DamperTest(Plotted, WithAxes, Summarised):
    """A force-motion record of one damper, uniformly sampled, in SI.

    Arrays have shape (n_time,): `displacement` [m] and `velocity` [m/s] of elongation, and the resisting `force` [N],
    so that force times velocity is dissipated power. `current` [A] and `voltage` [V] are a number if they are constant
    over the test, an array of shape (n_time,) if they vary, each sample held until the next, `None` if unknown. So is
    the `command` of a damper that follows another scalar, such as the opening of a valve, in its own `command_unit`.
    `amplitude` [m], half the peak to peak, and `frequency` [Hz] are nominal values from the file name, `None` if
    unknown. `velocity_source` states whether the velocity is a measured column or a derivative. The first `n_settle`
    samples are simulated but not compared: until the damper has travelled half its peak-to-peak stroke, its force
    depends on the state of the hysteresis before the record. Nor are the spans `uncompared`, first sample and beyond
    the last, where samples were interpolated: spikes, gaps, and the motion after a gap until the force does not depend
    on it. `observation` models how the recorded force follows from the damper's; samples at the ends for which it
    needs the force beyond the record are not compared either. `smoothing` is the moving average that was found in the
    whole record, `None` where there is none; it is kept with a part of the record, where it may no longer be found.
    `original` is the record before repairs, if it was repaired.
    """

    _made_by: ClassVar[str] = "mr.read_damper_test(path)"

    name: str
    path: str
    sha256: str
    dt: float
    start_time: float
    displacement: Samples
    velocity: Samples
    force: Samples
    velocity_source: VelocitySource
    n_settle: Whole = 0
    uncompared: tuple[tuple[Whole, Whole], ...] = ()
    current: CommandValues | None = None
    voltage: CommandValues | None = None
    command: CommandValues | None = None
    command_unit: CommandUnit | None = None
    amplitude: NotNegative | None = None
    frequency: NotNegative | None = None
    synthetic: bool = False
    observation: Observation = AS_IT_IS
    smoothing: Smoothing | None = None
    remarks: tuple[Remark, ...] = ()
    original: DamperTest | None = None

    def __post_init__(self) -> None:
        keep_arrays(self, "displacement", "velocity", "force", "current", "voltage", "command")
        if (self.command is None) is not (self.command_unit is None) or self.command_unit in ("A", "V"):
            raise SettingError(
                f"the command of {self.label} is {'unknown' if self.command is None else 'known'} and its unit is "
                f"{self.command_unit}; give both, a current as `current` and a voltage as `voltage`"
            )
        for name in ("current", "voltage", "command"):
            command = getattr(self, name)
            if not isinstance(command, np.ndarray):
                continue
            if command.shape != self.force.shape:
                raise SettingError(
                    f"`{name}` of {self.label} has shape {command.shape}; give a number, or shape {self.force.shape}"
                )
            if command.size and np.ptp(command) == 0.0:
                object.__setattr__(self, name, float(command[0]))

    @property
    def label(self) -> str:
        """How messages and results call the test: its path, or its name where it has none."""
        return self.path or self.name

    @property
    def n_time(self) -> int:
        """Number of samples, compared with a model or not."""
        return int(self.force.size)

    @property
    def acceleration(self) -> Floats:
        """Second derivative of the displacement [m/s^2], shape (n_time,)."""
        return smooth_motion(self.displacement, self.dt).acceleration

    @property
    def window(self) -> slice:
        """The samples from the first to the last that is compared with a model.

        They begin at `n_settle`, where the observation model can give them.
        """
        before, after = self.observation.reach(self.dt)
        return slice(max(self.n_settle, before), max(self.n_time - after, 0))

    @property
    def counted(self) -> slice | NDArray[np.intp]:
        """The samples that are compared with a model, as an index: the `window` without the `uncompared` spans."""
        if not self.uncompared:
            return self.window
        return int(self.window.start) + np.flatnonzero(outside_spans(self)[self.window])

    @property
    def n_counted(self) -> int:
        """Number of samples that are compared."""
        return int(np.arange(self.n_time)[self.counted].size)

    @property
    def commands(self) -> tuple[Command, ...]:
        """The known commands, each with its unit."""
        units: tuple[CommandUnit | None, ...] = ("A", "V", self.command_unit)
        pairs = zip((self.current, self.voltage, self.command), units, strict=True)
        return tuple(
            Command(values, unit) for values, unit in pairs if values is not None and unit is not None
        )

    @checked
    def command_in(self, unit: CommandUnit | None) -> CommandValues | None:
        """The command in this unit, `None` where it is not known."""
        return next((command.values for command in self.commands if command.unit == unit), None)

    @property
    def has_varying_command(self) -> bool:
        """Whether a command changes during the test."""
        return any(command.varies for command in self.commands)

    @property
    def command_in_words(self) -> str:
        """The known commands with their units, the range of one that varies; empty if none is known."""
        return ", ".join(command.in_words for command in self.commands)

    @checked
    def part(
        self, first: Annotated[int, Within(least=0)], last: Annotated[int, Within(least=0)], every: Count = 1
    ) -> DamperTest:
        """Every `every`-th sample from `first` up to `last`; a varying command stays held between samples."""
        window, end = slice(first, last, every), min(last, self.n_time)
        if not self.force[window].size:
            raise SettingError(
                f"{self.label}: a part from sample {first} up to {last} of {self.n_time} has none; give others"
            )
        return replace(
            self,
            displacement=freeze_samples(self.displacement[window]),
            velocity=freeze_samples(self.velocity[window]),
            force=freeze_samples(self.force[window]),
            uncompared=_spans_of_part(self.uncompared, first, end, every),
            dt=self.dt * every,
            start_time=self.start_time + first * self.dt,
            **fields_of_commands([command.part(first, end, every) for command in self.commands]),
        )

    @property
    def time(self) -> Floats:
        """Sample times [s], shape (n_time,)."""
        return self.start_time + self.dt * np.arange(self.n_time, dtype=np.float64)

    def _named_arrays(self) -> NamedArrays:
        def along(samples: ArrayLike, unit: str, words: str) -> NamedArray:
            return NamedArray.of(samples, "time", unit=unit, long_name=words)

        compared = np.zeros(self.n_time, dtype=np.bool_)
        compared[self.counted] = True
        held = "command, held until the next sample"
        commands = {
            command.quantity: along(np.broadcast_to(command.values, self.force.shape), command.unit, held)
            for command in self.commands
        }
        return NamedArrays(
            title=f"Damper test {self.name}",
            rows=("time",),
            labels={"time": NamedArray.of(self.time, unit="s", long_name="time")},
            arrays={
                "displacement": along(self.displacement, "m", "damper displacement"),
                "velocity": along(self.velocity, "m/s", f"damper velocity, {self.velocity_source}"),
                "force": along(self.force, "N", "damper force, as recorded"),
                "compared": along(compared, "", "whether the sample is compared with a model"),
                **commands,
            },
        )

    def document(self) -> dict[str, Any]:
        """What `mrwork check --json` prints of a record; a command that varies has its range."""
        return {**as_json(RECORD_COLUMNS, self), "remarks": [asdict(remark) for remark in self.remarks]}

    def _summary(self) -> Summary:
        return Summary(
            title=f"Damper test {self.name}",
            facts=(
                (
                    "samples",
                    f"{self.n_time} at {1.0 / self.dt:.5g} Hz, the first {self.n_settle} not compared"
                    f"{f', nor are {spans} spans' if (spans := len(self.uncompared)) else ''}",
                ),
                ("command", self.command_in_words or "unknown"),
                ("displacement", f"{self.displacement.min():.4g} to {self.displacement.max():.4g} m"),
                (
                    "velocity",
                    f"{self.velocity.min():.4g} to {self.velocity.max():.4g} m/s, {self.velocity_source}",
                ),
                ("force", f"{self.force.min():.4g} to {self.force.max():.4g} N"),
                ("observation", self.observation.in_words),
            ),
            notes=[remark.in_words for remark in self.remarks],
        )


def outside_spans(test: DamperTest) -> NDArray[np.bool_]:
    """Whether each sample is outside the spans that are not compared, shape (n_time,)."""
    outside = np.ones(test.n_time, dtype=np.bool_)
    for first, last in test.uncompared:
        outside[first:last] = False
    return outside


def _peak(samples: Floats) -> float:
    return float(np.abs(samples).max())


def _in_milli(value: float) -> str:
    return f"{1e3 * value:.3g}"


def _level(command: CommandValues | None) -> float | dict[str, float] | None:
    """A command as JSON has it, the range of one that varies."""
    if not isinstance(command, np.ndarray):
        return command
    return {"lowest": float(command.min()), "highest": float(command.max())}


RECORD_COLUMNS: Final = (
    Column("file", of=attrgetter("path")),
    Column("", "file", of=attrgetter("label")),
    Column("n_time", "samples"),
    Column("dt"),
    Column("", "rate", "Hz", shown="{:g}".format, of=lambda test: 1.0 / test.dt),
    Column("settle_seconds", of=lambda test: test.n_settle * test.dt),
    Column("amplitude_m", "amplitude", "mm", shown=_in_milli, of=lambda test: 0.5 * float(np.ptp(test.displacement))),
    Column("peak_displacement_m", of=lambda test: _peak(test.displacement)),
    Column("peak_velocity_mps", "velocity", "mm/s", shown=_in_milli, of=lambda test: _peak(test.velocity)),
    Column("peak_force_n", "force", "N", shown=format_rounded, of=lambda test: _peak(test.force)),
    Column("current_a", of=lambda test: _level(test.current)),
    Column("voltage_v", of=lambda test: _level(test.voltage)),
    Column("command", of=lambda test: _level(test.command)),
    Column("", "command", of=attrgetter("command_in_words")),
    *map(Column, ("command_unit", "velocity_source", "synthetic")),
)  # fmt: skip
"""What `mrwork check` tells of each record, in its table and its JSON."""


def _spans_of_part(
    spans: Sequence[tuple[int, int]], first: int, last: int, every: int
) -> tuple[tuple[int, int], ...]:
    n_kept = len(range(first, last, every))
    # Rounded up: a sample belongs to a span if it lies in it.
    placed = (tuple(min(max(-(-(end - first) // every), 0), n_kept) for end in span) for span in spans)
    return tuple((begin, end) for begin, end in placed if begin < end)


def as_tests(tests: DamperTest | Sequence[DamperTest]) -> tuple[DamperTest, ...]:
    """One test or several as a tuple, each of other data."""
    if isinstance(tests, DamperTest):
        return (tests,)
    as_tuple = tuple(tests)
    for (first, one), (second, other) in combinations(enumerate(as_tuple, start=1), 2):
        if one is other or (
            one.dt == other.dt
            and np.array_equal(one.force, other.force)
            and np.array_equal(one.displacement, other.displacement)
            and same_commands(one, other)
        ):
            names = one.label if one.label == other.label else f"{one.label} and {other.label}"
            raise RecordError(
                f"tests {first} and {second} ({names}) have the same samples; data that count twice make errors and "
                "bands too narrow, so give each test once"
            )
    return as_tuple


def fields_of_commands(commands: Iterable[Command]) -> dict[str, Any]:
    """Keyword arguments of a `DamperTest` that has these commands: `current`, `voltage`, or `command` and its unit."""
    fields: dict[str, Any] = {}
    for command in commands:
        fields[command.quantity] = command.values
        if command.quantity == "command":
            fields["command_unit"] = command.unit
    return fields


def same_commands(one: DamperTest, other: DamperTest) -> bool:
    """Whether the commands of two tests are equal, sample by sample where they vary."""
    pairs = zip(one.commands, other.commands, strict=False)
    return len(one.commands) == len(other.commands) and all(mine.equals(theirs) for mine, theirs in pairs)


def set_points(test: DamperTest) -> tuple[tuple[CommandUnit, float], ...] | None:
    """The constant commands of a test, as a driver is set, each after its unit; `None` where a command varies."""
    if test.has_varying_command:
        return None
    return tuple((unit, command_level(float(np.mean(command)), unit)) for command, unit in test.commands)


# Set points of several tests that are closer than this share of their range are one: a driver repeats them so.
_ONE_LEVEL = 0.01


def levels_among(values: ArrayLike) -> Floats:
    """The level of each value, (n_values,): the middle one of all that follow within 1 % of their range."""
    given = np.asarray(values, dtype=np.float64)
    if not given.size:
        return given
    order = np.argsort(given, kind="stable")
    begins = np.diff(given[order], prepend=-np.inf) > _ONE_LEVEL * np.ptp(given)
    groups = np.split(order, np.flatnonzero(begins)[1:])
    levels = np.empty_like(given)
    for group in groups:
        levels[group] = given[group[(group.size - 1) // 2]]
    return levels


def command_groups(tests: Sequence[DamperTest]) -> list[int]:
    """Number of the constant command of each test, (n_tests,); one that varies is alone, or with its equals."""
    points = [set_points(test) for test in tests]
    units = [None if point is None else tuple(unit for unit, _ in point) for point in points]
    keys: list[object] = [()] * len(tests)
    for kind in dict.fromkeys(filter(None, units)):
        members = [index for index, unit in enumerate(units) if unit == kind]
        values = np.array([[value for _, value in points[index] or ()] for index in members])
        levels = np.stack([levels_among(column) for column in values.T], axis=1)
        for index, level in zip(members, levels.tolist(), strict=True):
            keys[index] = (kind, *level)
    for index, test in enumerate(tests):
        if points[index] is None:
            keys[index] = next(other for other in range(index + 1) if same_commands(test, tests[other]))
    numbers = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    return [numbers[key] for key in keys]


def loading_of(test: DamperTest, spec: DamperSpec) -> Loading:
    """Motion of a test, with its command in the unit of the model, constant or held from sample to sample."""
    loading = Loading(dt=test.dt, displacement=test.displacement, velocity=test.velocity)
    if spec.command_unit is None:
        return loading
    command = test.command_in(spec.command_unit)
    if command is not None:
        return replace(loading, command=command, command_unit=spec.command_unit)
    raise RecordError(
        f"{test.label}: the model takes its command in {spec.command_unit}, the test has "
        f"{test.command_in_words or 'none'}; give it, as in --column command=0.5{spec.command_unit} or in a table of "
        "tests, as mrwork check FILES --table begins it, or a model in the other unit"
    )


# Share of the cycles above, and below, the range of frequencies.
_RARE = 0.1
# A cycle with a longer span that is not compared, in cycles, has a gap, after which half a stroke is not compared.
_BRIDGED = 0.25


def range_of_test(test: DamperTest, unit: CommandUnit | None, force: Samples | None = None) -> OperatingRange:
    """Ranges of a test with its command in `unit`.

    The `force` of a model [N], shape (n_time,), replaces the measured one where it is compared: it starts from a state
    of its own.
    """
    load = test.force if force is None else force
    if load.size != test.n_time:
        raise SettingError(
            f"`force` has {load.size} samples; give one for each of the {test.n_time} of {test.label}"
        )
    compared = slice(None) if force is None else test.counted
    load, command = load[compared], test.command_in(unit)
    return OperatingRange(
        stroke=0.5 * float(np.ptp(test.displacement)),
        velocity=_peak(test.velocity),
        frequency=_frequencies(test),
        command=None if command is None else (float(np.min(command)), float(np.max(command))),
        command_unit=None if command is None else unit,
        levels=() if command is None or unit is None else Command(command, unit).levels,
        force=_peak(load),
        power=max(0.0, float(np.mean(load * test.velocity[compared]))),
        least_stroke=least_stroke(test.displacement),
    )


def range_of_tests(tests: Sequence[DamperTest], unit: CommandUnit | None = None) -> OperatingRange:
    """Ranges of one or more tests together; without a `unit`, that in which most of the commands are known."""
    if unit is None:
        # Of several units with as many commands a current, then a voltage.
        units: Sequence[CommandUnit] = [command_unit for test in tests for _, command_unit in test.commands]
        candidates: list[CommandUnit] = [candidate for candidate in COMMAND_SCALES if candidate in units]
        unit = max(candidates, key=units.count) if candidates else None
    return covering([range_of_test(test, unit) for test in tests])


def _frequencies(test: DamperTest) -> tuple[float, float] | None:
    """Frequencies of cycles without a gap [Hz], but of the slowest and fastest tenth; `None` without a half cycle."""
    upward = crossing_instants(test.displacement)
    seconds = test.dt * np.diff(upward)
    bridged = np.array([
        any(min(last, end) - max(first, begin) > _BRIDGED * (end - begin) for first, last in test.uncompared)
        for begin, end in pairwise(upward)
    ])  # fmt: skip
    if bridged.any() and not bridged.all():
        seconds = seconds[~bridged]
    if not seconds.size:
        # About the mean of so short a record, halves are of unequal lengths.
        halves = np.diff(np.sort(np.append(upward, crossing_instants(-test.displacement))))
        seconds = 2.0 * test.dt * np.array([halves.mean()] if halves.size else [])
    if not seconds.size:
        return None
    lowest, highest = np.quantile(1.0 / seconds, [_RARE, 1.0 - _RARE])
    return float(lowest), float(highest)
