"""Control laws in Python: a function of what is measured, asked by the loop at every control sample.

The loop itself is the same for every law. It waits for Python at each sample, some tens of microseconds: a run of the
five-storey frame at 1 ms takes some seven times as long as one with a law of the registry. Candidates in one batch
share the waiting. What a function raises has file and line.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import partial
from typing import Annotated, ClassVar, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.base.arguments import AnyNumbers, Positive, Refusal, accept, checked
from mrwork.base.hints import Within, node_of
from mrwork.base.summary import Summarised, Summary
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.device import Device
from mrwork.control.laws.control_law import ControlLaw
from mrwork.errors import SettingError
from mrwork.store.user_python import in_words, place_of, place_raised, start_of

MOST_MEMORY = 1_000_000
"""Most numbers that a run may keep from sample to sample."""
# A command that is not a number fails safe where a reading is not.
_COMMANDS = node_of(AnyNumbers)
# A run with larger readings [m, m/s, N] diverges, and a law may overflow on them.
_LARGEST_READING = 1e30

Ask = Callable[
    [int, NDArray[np.uintp], Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats], Floats
]
"""The form in which the core asks: number of the sample, places of the runs, and what is measured."""
AskOfRuns = Callable[[NDArray[np.uint32]], Ask]
"""Begins some runs (candidate, motion, draw), shape (n_runs, 3)."""


@array_dataclass(repr=False)
class RunningRms(Summarised):
    """Running root mean squares of the readings of a law in Python, in the shapes and units of `LoopSample`.

    The mean of the squares fades: `s = a s + (1 - a) y^2` at each sample, `a = exp(-Ts / rms_time)`, from zero on. A
    reading that is not finite leaves it as it is.
    """

    _units: ClassVar[dict[str, str]] = {
        "deformation": "m",
        "rate": "m/s",
        "force": "N",
        "acceleration": "m/s^2",
        "ground_acceleration": "m/s^2",
        "drift": "m",
    }

    deformation: Floats
    rate: Floats
    force: Floats
    acceleration: Floats
    ground_acceleration: Floats
    drift: Floats


@array_dataclass(repr=False)
class LoopSample(Summarised):
    """Input of a law in Python at a control sample, one row per run.

    Attributes
    ----------
    time
        Time from the start of the motions [s].
    candidate, motion
        Index of the candidate and of the motion of each run, shape (n_runs,).
    displacement, velocity
        Of the coordinates relative to the ground, true or estimated by the observer, shape (n_runs, n) [m, m/s].
    deformation, rate, force
        Elongation of each device, its rate, and the force with which it resists, shape (n_runs, n_devices) [m, m/s, N].
    acceleration
        Absolute accelerations of the floors as their sensors read them, shape (n_runs, n_floors) [m/s^2].
    ground_acceleration
        Acceleration of the ground as its sensor reads it, shape (n_runs,) [m/s^2]; of a record finer than the
        integration step the mean over the step before.
    ground_velocity
        Its integral from rest, shape (n_runs,) [m/s]: coordinates that are moved by the ground have this velocity more
        than that relative to it.
    drift
        Drifts of the storeys with a sensor, in the order of the hardware, shape (n_runs, n_measured_storeys) [m].
    largest
        Largest command of each device, shape (n_devices,) [A or V]; of an actuator its largest force [N].
    rms
        Running root mean squares of the readings, where the law has an `rms_time`; otherwise `None`.
    """

    _units: ClassVar[dict[str, str]] = {
        "time": "s",
        "displacement": "m",
        "velocity": "m/s",
        **RunningRms._units,
        "ground_velocity": "m/s",
        "largest": "A, V or N",
    }

    time: float
    candidate: NDArray[np.intp]
    motion: NDArray[np.intp]
    displacement: Floats
    velocity: Floats
    deformation: Floats
    rate: Floats
    force: Floats
    acceleration: Floats
    ground_acceleration: Floats
    ground_velocity: Floats
    drift: Floats
    largest: Floats
    rms: RunningRms | None = None

    @property
    def state(self) -> Floats:
        """Displacements and velocities, shape (n_runs, 2n)."""
        return np.hstack([self.displacement, self.velocity])

    @property
    def is_physical(self) -> NDArray[np.bool_]:
        """Whether every reading of a run is a number that a building can have, shape (n_runs,)."""
        measured = (self.deformation, self.rate, self.force, self.acceleration, self.drift)
        readings = np.hstack([self.state, *measured, self.ground_acceleration[:, None]])
        return np.asarray((np.abs(readings) < _LARGEST_READING).all(axis=1))


READINGS: Final = {
    entry.name: LoopSample._units[entry.name]
    for entry in fields(LoopSample)
    if entry.name in LoopSample._units and entry.name not in ("time", "largest")
}
"""Readings of a `LoopSample` with their units, in its order, which is that of an `Ask`."""
Command = Callable[[LoopSample, Floats], ArrayLike]
"""A law in Python: takes what is measured and the memory of each run, and returns the commands."""


class _Fading:
    """Mean squares of the readings of all runs, which fade from sample to sample by the share `left`."""

    __slots__ = ("_left", "_n_runs", "_squares")

    def __init__(self, n_runs: int, left: float) -> None:
        self._n_runs, self._left = n_runs, left
        self._squares: Floats = np.zeros((n_runs, 0))

    def take(self, number: int, places: NDArray[np.uintp], readings: Sequence[Floats]) -> RunningRms:
        """The root mean squares of the runs at `places` after a sample, with readings in the order of `RunningRms`."""
        columns = [reading.reshape(len(places), -1) for reading in readings]
        taken = np.hstack(columns)
        if self._squares.shape[1] != taken.shape[1]:
            self._squares = np.zeros((self._n_runs, taken.shape[1]))
        before = self._squares[places] if number else np.zeros_like(taken)
        finite = np.isfinite(taken)
        # A run that diverges has readings of any size.
        with np.errstate(over="ignore"):
            fresh = np.square(taken, where=finite, out=np.zeros_like(taken))
        squares = np.where(finite, self._left * before + (1.0 - self._left) * fresh, before)
        self._squares[places] = squares
        roots = np.split(np.sqrt(squares), np.cumsum([column.shape[1] for column in columns])[:-1], axis=1)
        named = zip(RunningRms._units, roots, readings, strict=True)
        return RunningRms(**{name: root.reshape(reading.shape) for name, root, reading in named})


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class UserLaw(Summarised):
    """A control law in Python, for `simulate_loop`; slower than a law of the registry, see `control_laws`.

    Parameters
    ----------
    name
        Name in messages.
    command
        Takes a `LoopSample` and the memory, and returns the command of each run and device, shape (n_runs, n_devices),
        or (n_runs,) for one device. The command of an actuator is a force of either sign that resists its lengthening
        [N]. The loop limits it to the range of the device, delays and holds it. It is called
        with several runs at once: candidates, motions, draws. A command that is not a number is an error, unless a
        reading of its run is not one either. The working directory, stdout and stderr are after each call what they
        were before.
    n_candidates
        Number of candidates, which differ by `LoopSample.candidate`.
    n_memory
        Numbers that each run keeps from sample to sample: the second argument, shape (n_runs, n_memory), zero at the
        start and changed in place. A law must keep nothing elsewhere, since a run is repeated with a shorter step where
        a damper requires it.
    rms_time
        Time constant of the running root mean squares that the loop keeps for each run, `LoopSample.rms` [s].
    source
        Digest of the text that `command` is from, by which a journal tells laws apart.

    Raises
    ------
    SettingError
        If a number is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> import mrwork as mr
    >>> frame, rd1005 = mr.building("uts"), mr.damper("static_hysteretic").preset("kwok2006")
    >>> damper = mr.Device(
    ...     name="storey 1", spec=rd1005.spec, theta=rd1005.theta, row=frame.storeys[0], largest_command=1.88
    ... )
    >>> gains = np.array([1.0, 10.0, 100.0])
    >>> def proportional(sample, memory):
    ...     return gains[sample.candidate, None] * np.abs(sample.rate)
    >>> law = mr.closed_loop.UserLaw(name="proportional", command=proportional, n_candidates=3)
    >>> mr.simulate_loop(frame, [damper], law, [mr.synthetic_motion(duration=2.0)]).shape
    (3, 1, 1)
    """

    _made_by: ClassVar[str] = "mr.closed_loop.UserLaw(name=..., command=...)"
    # As many as the core takes.
    most_at_once: ClassVar[int] = 4096
    readings: ClassVar[tuple[str, ...]] = tuple(READINGS)

    name: str
    command: Command
    n_candidates: Annotated[int, Within(least=1, most=1_000_000)] = 1
    n_memory: Annotated[int, Within(least=0, most=MOST_MEMORY)] = 0
    rms_time: Positive | None = None
    source: str = ""

    @property
    def in_words(self) -> str:
        """Its name, and what it is."""
        return f"{self.name} in Python"

    @property
    def _title(self) -> str:
        """Name of the law, and where it stands."""
        location = place_of(self.command)
        return f"{self.name} ({location})" if location else self.name

    @checked
    def placeholder(self, devices: Sequence[Device]) -> ControlLaw:
        """The law that the core has in place of this one: its candidates, without a command."""
        return ControlLaw(name="passive", gains={"command": np.zeros((self.n_candidates, len(devices)))})

    @checked
    @contextmanager
    def at_work(self, devices: Sequence[Device], sample_time: float) -> Iterator[AskOfRuns]:
        """The law as the core asks it, for some runs after others."""
        yield partial(self._asked, devices, sample_time)

    def _asked(self, devices: Sequence[Device], sample_time: float, runs: NDArray[np.uint32]) -> Ask:
        largest = np.array([device.largest_command for device in devices])
        # A law must not change it for the samples that follow.
        largest.setflags(write=False)
        memory = np.zeros((len(runs), self.n_memory))
        running = (
            None if self.rms_time is None else _Fading(len(runs), math.exp(-sample_time / self.rms_time))
        )

        def ask(number: int, places: NDArray[np.uintp], *measured: Floats) -> Floats:
            readings = dict(zip(READINGS, measured, strict=True))
            memory_rows = np.zeros((len(places), self.n_memory)) if number == 0 else memory[places]
            sample = LoopSample(
                time=number * sample_time,
                candidate=runs[places, 0].astype(np.intp),
                motion=runs[places, 1].astype(np.intp),
                **readings,
                largest=largest,
                rms=None
                if running is None
                else running.take(number, places, [readings[name] for name in RunningRms._units]),
            )
            try:
                returned = self.command(sample, memory_rows)
            except (Exception, SystemExit) as error:
                location = place_raised(error, start_of(self.command)[0])
                where = f" in {location}" if location else ""
                raise SettingError(
                    f"{self.name} failed at {sample.time:g} s{where}: {in_words(error)}; correct it"
                ) from error
            commands = self._commands(returned, sample, (len(places), len(devices)))
            memory[places] = memory_rows
            return commands

        return ask

    def _commands(self, returned: object, sample: LoopSample, shape: tuple[int, int]) -> Floats:
        """Commands that the law returned, checked; (n_runs,) is taken for the one device of (n_runs, 1)."""
        try:
            commands: Floats = accept(_COMMANDS, returned)
        except Refusal as refusal:
            raise SettingError(
                f"{self._title}: what it returned at {sample.time:g} s {refusal.in_words()}"
            ) from None
        if commands.shape == shape[:1] and shape[1] == 1:
            commands = commands[:, None]
        if commands.shape != shape:
            raise SettingError(
                f"{self._title} returned commands of shape {commands.shape} at {sample.time:g} s; give {shape}, a row "
                "for each run and a column for each device"
            )
        invalid = np.isnan(commands)
        if invalid.any() and (blamed := invalid.any(axis=1) & sample.is_physical).any():
            run = int(blamed.argmax())
            raise SettingError(
                f"{self._title} returned a command that is not a number (NaN) for device "
                f"{int(invalid[run].argmax()) + 1} at {sample.time:g} s, and its readings are numbers; correct the law"
            )
        return np.ascontiguousarray(commands)

    def _summary(self) -> Summary:
        return Summary(
            title=f"Control law {self.name}, in Python",
            facts=(
                ("candidates", str(self.n_candidates)),
                ("memory", f"{self.n_memory} numbers for each run"),
            ),
            notes=("The loop waits for it at every control sample: slower than a law of the registry.",),
        )
