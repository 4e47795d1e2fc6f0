"""A law of the user in the loop, for rows of runs: asked by the core at every sample, where it is not recorded."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import AnyNumbers, Refusal, accept
from mrwork.base.hints import node_of
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.device import Device
from mrwork.closed_loop.loop_sample import READINGS, RMS_READINGS, LoopSample, RunningRms
from mrwork.closed_loop.recorded_law import LoopShape, RecordedLaw, line_of_no_number, record_law
from mrwork.control.laws.own_formula import OwnFormula
from mrwork.errors import SettingError
from mrwork.store.user_python import error_in_words, place_of, place_raised, start_of

# A command that is not a number fails safe where a reading is not.
_COMMANDS = node_of(AnyNumbers)
Ask = Callable[
    [int, NDArray[np.uintp], Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats, bool],
    Floats,
]
"""The form in which the core asks: number of the sample, places of the runs, readings, and whether all are numbers."""
AskOfRuns = Callable[[NDArray[np.uint32]], Ask]
"""Begins some runs (candidate, motion, draw), shape (n_runs, 3)."""


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
    __eq__, __hash__ = LoopSample.__eq__, None  # type: ignore[assignment] # a class with arrays has no hash

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


@array_dataclass()
class RowsLaw:
    """A law of the user with the settings of each candidate, shape (n_candidates, n_settings)."""

    # As many as the core takes.
    most_at_once: ClassVar[int] = 4096

    formula: OwnFormula
    settings: Floats

    @property
    def in_words(self) -> str:
        """Its name, and what it is."""
        return f"{self.formula.name} in Python"

    @property
    def _title(self) -> str:
        """Name of the law, and where it stands."""
        location = place_of(self.formula.function)
        return f"{self.formula.name} ({location})" if location else self.formula.name

    def recorded(self, shape: LoopShape) -> tuple[RecordedLaw, Floats]:
        """The law on a tape, and numbers that differ from candidate to candidate.

        Raises
        ------
        NotRecordedError
            If it cannot be recorded.
        """
        return record_law(self.formula, shape, self.settings)

    @contextmanager
    def at_work(self, devices: Sequence[Device], sample_time: float) -> Iterator[AskOfRuns]:
        """The law as the core asks it, for some runs after others."""
        yield partial(self._asked, devices, sample_time)

    def _asked(self, devices: Sequence[Device], sample_time: float, runs: NDArray[np.uint32]) -> Ask:
        largest = np.array([device.largest_command for device in devices])
        # A law must not change it for the samples that follow.
        largest.setflags(write=False)
        formula, command = self.formula, self.formula.command
        memory = np.tile(formula.start, (len(runs), 1))
        # Runs that have had a reading that is not a number, which a law may remember.
        lost = np.zeros(len(runs), dtype=bool)
        running = None
        if formula.rms_time is not None:
            running = _Fading(len(runs), math.exp(-sample_time / formula.rms_time))

        def ask(number: int, places: NDArray[np.uintp], *given: Any) -> Floats:
            *measured, are_numbers = given
            readings = dict(zip(READINGS, measured, strict=True))
            memory_rows = np.tile(formula.start, (len(places), 1)) if number == 0 else memory[places]
            sample = (LoopSample if are_numbers else _WatchedSample)(
                time=number * sample_time,
                sample_time=sample_time,
                candidate=runs[places, 0].astype(np.intp),
                motion=runs[places, 1].astype(np.intp),
                **readings,
                largest=largest,
                rms=None
                if running is None
                else running.take(number, places, [readings[name] for name in RMS_READINGS]),
            )
            try:
                returned = command(sample, memory_rows, self.settings[runs[places, 0]])
            except (Exception, SystemExit) as error:
                location = place_raised(error, start_of(formula.function)[0])
                where = f" in {location}" if location else ""
                raise SettingError(
                    f"{formula.name} failed at {sample.time:g} s{where}: {error_in_words(error)}; correct it"
                ) from error
            unknown = sample.unknown if isinstance(sample, _WatchedSample) else None
            if number == 0:
                lost[places] = False
            if unknown is not None:
                lost[places] |= unknown
            # What is kept is replaced below.
            before = partial(self._kept, memory, places, number)
            commands = self._commands(returned, sample, before, lost[places], (len(places), len(devices)))
            memory[places] = memory_rows
            return commands if unknown is None else np.where(unknown[:, None], np.nan, commands)

        return ask

    def _kept(self, memory: Floats, places: NDArray[np.uintp], number: int, run: int) -> Floats:
        """What a run of these places keeps before the sample of that number, shape (n_memory,)."""
        return self.formula.start if number == 0 else memory[places[run]]

    def _commands(
        self,
        returned: object,
        sample: LoopSample,
        before: Callable[[int], Floats],
        lost: NDArray[np.bool_],
        shape: tuple[int, int],
    ) -> Floats:
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
        if invalid.any() and (blamed := invalid.any(axis=1) & ~lost & sample.is_physical).any():
            run = int(blamed.argmax())
            device = int(invalid[run].argmax())
            settings = self.settings[sample.candidate[run]]
            line = line_of_no_number(self.formula, sample, before(run), settings, run=run, device=device)
            raise SettingError(
                f"{self._title} returned a command that is not a number (NaN) for device {device + 1} at "
                f"{sample.time:g} s{line and f', made in {line}'}, and its readings are numbers; correct the law"
            )
        return np.ascontiguousarray(commands)
