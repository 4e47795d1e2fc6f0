"""Control laws in Python: a function of what is measured, recorded as operations of the core or asked at every sample.

The loop itself is the same for every law. A function that is recorded runs as one of the registry does. One that cannot
be is asked at each sample, some tens of microseconds: a run of the five-storey frame at 1 ms takes some nine times as
long. Candidates in one batch share the waiting. What a function raises has file and line.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.base.arguments import AnyNumbers, Positive, Refusal, accept, checked
from mrwork.base.effects import with_numpy
from mrwork.base.hints import Within, node_of
from mrwork.base.summary import Summarised, Summary
from mrwork.base.values import Floats
from mrwork.buildings.device import Device
from mrwork.closed_loop.loop_sample import READINGS, RMS_READINGS, LoopSample, RunningRms
from mrwork.closed_loop.recorded_law import LoopShape, RecordedLaw, record_law
from mrwork.control.laws.control_law import ControlLaw
from mrwork.errors import SettingError
from mrwork.store.user_python import in_words, place_of, place_raised, start_of

MOST_MEMORY = 1_000_000
"""Most numbers that a run may keep from sample to sample."""
# A command that is not a number fails safe where a reading is not.
_COMMANDS = node_of(AnyNumbers)
Ask = Callable[
    [int, NDArray[np.uintp], Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats, bool],
    Floats,
]
"""The form in which the core asks: number of the sample, places of the runs, readings, and whether all are numbers."""
AskOfRuns = Callable[[NDArray[np.uint32]], Ask]
"""Begins some runs (candidate, motion, draw), shape (n_runs, 3)."""


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
        named = zip(RMS_READINGS, roots, readings, strict=True)
        return RunningRms(**{name: root.reshape(reading.shape) for name, root, reading in named})


class _WatchedSample(LoopSample):
    """A sample in which a reading is not a number; it knows which readings a law has looked at."""

    __slots__ = ("_seen",)

    def __getattribute__(self, name: str) -> Any:
        if name in READINGS:
            try:
                object.__getattribute__(self, "_seen").add(name)
            except AttributeError:  # before the first look
                object.__setattr__(self, "_seen", {name})
        return object.__getattribute__(self, name)

    @property
    def unknown(self) -> NDArray[np.bool_]:
        """Runs of which a reading that was looked at is not a number, shape (n_runs,)."""
        unknown = np.zeros(len(self.candidate), dtype=bool)
        for name in tuple(getattr(self, "_seen", ())):
            unknown |= np.isnan(getattr(self, name)).reshape(len(unknown), -1).any(axis=1)
        return unknown


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class UserLaw(Summarised):
    """A control law in Python, for `simulate_loop`, beside those of the registry, see `control_laws`.

    Parameters
    ----------
    name
        Name in messages.
    command
        Takes a `LoopSample` and the memory, and returns the command of each run and device, shape (n_runs, n_devices),
        or (n_runs,) for one device. The command of an actuator is a force of either sign that resists its lengthening
        [N]. The loop limits it to the range of the device, delays and holds it. It is called
        with several runs at once: candidates, motions, draws. A command that is not a number is an error. Where a
        reading that it looks at is not one, its run has no command at that sample, and ends as `failed_safe`. The
        working directory, stdout and stderr are after each call what they were before.
    n_candidates
        Number of candidates, which differ by `LoopSample.candidate`.
    n_memory
        Numbers that each run keeps from sample to sample: the second argument, shape (n_runs, n_memory), zero at the
        start and changed in place. A law must keep nothing elsewhere, since a run is repeated with a shorter step where
        a damper requires it.
    rms_time
        Time constant of the running root mean squares that the loop keeps for each run, `LoopSample.rms` [s].
    record
        Whether it is recorded as operations of the core and then runs as a law of the registry: by default where that
        can be done, and a remark of the responses says why it cannot. `False` calls the function at every sample, as to
        print what it does; `True` refuses one that cannot be recorded.
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
    record: bool | None = None
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

    def recorded(self, shape: LoopShape, n_candidates: int) -> tuple[RecordedLaw, Floats]:
        """The law on a tape, and numbers that differ from candidate to candidate.

        Raises
        ------
        NotRecordedError
            If it cannot be recorded.
        """
        command = with_numpy(self.command)
        return record_law(
            lambda sample, memory, _: command(sample, memory),
            self.command,
            replace(shape, rms_time=self.rms_time),
            np.zeros(self.n_memory),
            np.zeros((n_candidates, 0)),
            (),
        )

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

        def ask(number: int, places: NDArray[np.uintp], *given: Any) -> Floats:
            *measured, are_numbers = given
            readings = dict(zip(READINGS, measured, strict=True))
            memory_rows = np.zeros((len(places), self.n_memory)) if number == 0 else memory[places]
            sample = (LoopSample if are_numbers else _WatchedSample)(
                time=number * sample_time,
                candidate=runs[places, 0].astype(np.intp),
                motion=runs[places, 1].astype(np.intp),
                **readings,
                largest=largest,
                rms=None
                if running is None
                else running.take(number, places, [readings[name] for name in RMS_READINGS]),
            )
            try:
                returned = self.command(sample, memory_rows)
            except (Exception, SystemExit) as error:
                location = place_raised(error, start_of(self.command)[0])
                where = f" in {location}" if location else ""
                raise SettingError(
                    f"{self.name} failed at {sample.time:g} s{where}: {in_words(error)}; correct it"
                ) from error
            unknown = sample.unknown if isinstance(sample, _WatchedSample) else None
            commands = self._commands(returned, sample, (len(places), len(devices)))
            memory[places] = memory_rows
            return commands if unknown is None else np.where(unknown[:, None], np.nan, commands)

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
            notes=(
                ()
                if self.record
                else ("Where it cannot be recorded, the loop waits for Python at every control sample.",)
            ),
        )
