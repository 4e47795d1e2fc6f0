"""A law of the user as a tape that the core walks: recorded with one run, and compared with the function itself.

The function is called with arrays whose numbers are written down (`base/traced`): twice, so that a clock or a random
number is found, and once for each further candidate, whose other numbers become settings. Then the tape is compared
with the function at random readings. What cannot be recorded is a `NotRecordedError`.
"""

from __future__ import annotations

import gc
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from mrwork.base.recording import Cell, Node, NotRecordedError, Recording
from mrwork.base.side_effects import effect_of, with_numpy
from mrwork.base.tape import Tape, tape_of
from mrwork.base.traced import bare, inputs
from mrwork.base.values import Floats
from mrwork.closed_loop.loop_sample import READINGS, RMS_READINGS, LoopSample, RunningRms
from mrwork.control.laws.own_formula import OwnFormula
from mrwork.store.user_python import error_in_words, place_of, place_raised, start_of

# An input that a law reads through its running root mean square alone, which leaves out what is not a number.
_FADING: Final = "fading "
# A local variable, and the argument of the count itself.
_REFERENCES: Final = 2
# Runs at which a tape is compared with its function.
_CHECKED: Final = 16
_SAME: Final = 1e-9
# Sizes of the readings at which they are compared, in SI.
_SIZES: Final = {
    "displacement": 0.02,
    "velocity": 0.2,
    "deformation": 0.02,
    "rate": 0.2,
    "force": 1e3,
    "acceleration": 3.0,
    "ground_acceleration": 3.0,
    "ground_velocity": 0.2,
    "drift": 0.02,
}
_ANOTHER: Final = "it is another one each time that it is recorded: a random number, a clock or a counter"


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopShape:
    """What a law is recorded for: numbers of entries of its readings, the sampling, and the largest commands.

    `lengths` are of the readings by name in the order of `LoopSample`; those of one number for a run have `None`.
    """

    lengths: Mapping[str, int | None]
    largest: tuple[float, ...]
    sample_time: float

    def rows(self, name: str, n_runs: int) -> tuple[int, ...]:
        """Shape of a reading of several runs."""
        length = self.lengths[name]
        return (n_runs,) if length is None else (n_runs, length)

    @property
    def largest_commands(self) -> Floats:
        """Largest command of each device, which no law can change."""
        largest = np.array(self.largest)
        largest.setflags(write=False)
        return largest


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedLaw:
    """A law on a tape.

    Attributes
    ----------
    tape
        The formula; its first inputs and ends are the memory, its other ends the commands.
    inputs
        Name and place of each input, and whether the law is without a command where it is not a number.
    start
        Memory at the start.
    names
        Names of the settings that it has as inputs.
    """

    tape: Tape
    inputs: tuple[tuple[str, int, bool], ...]
    start: tuple[float, ...]
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Graph:
    """A recording of a law: nodes of its memory, before and after a sample, and of its commands."""

    recording: Recording
    kept: tuple[tuple[int, int], ...]
    start: tuple[float, ...]
    commands: tuple[int, ...]

    def same_ends_as(self, other: Graph) -> bool:
        """Whether the same nodes are kept and sent."""
        return (self.kept, self.commands) == (other.kept, other.commands)


def record_law(formula: OwnFormula, shape: LoopShape, settings: Floats) -> tuple[RecordedLaw, Floats]:
    """The tape of a law, and its settings for each candidate, shape (n_candidates, n_settings).

    Settings of the formula are inputs, of which `settings` has a row for each candidate; numbers that differ from
    candidate to candidate by themselves become further ones.

    Raises
    ------
    NotRecordedError
        If it cannot be recorded.
    """
    function = formula.function
    if effect := effect_of(function):
        raise NotRecordedError(effect, "")
    law = _Law(formula, shape)
    try:
        first, again = law.graph(0), law.graph(0)
        if not (first.recording.same_as(again.recording) and first.same_ends_as(again)):
            raise NotRecordedError(_ANOTHER, place_of(function))
        graphs = [first, *(law.graph(candidate) for candidate in range(1, len(settings)))]
        if not all(first.recording.alike(each.recording) and first.same_ends_as(each) for each in graphs):
            raise NotRecordedError("its operations differ from candidate to candidate", place_of(function))
        law.compare(first, settings[0])
        return _on_tape(graphs, formula.names, settings)
    except NotRecordedError:
        raise
    except (Exception, SystemExit) as error:
        # Where the loop calls the function too, the sentence of the loop follows.
        raise NotRecordedError(error_in_words(error), place_raised(error, start_of(function)[0])) from error


class _Law:
    """A law with what it is recorded for."""

    def __init__(self, formula: OwnFormula, shape: LoopShape) -> None:
        self._command, self._shape = formula.rows(with_numpy(formula.function)), shape
        self._start, self._names, self._rms_time = formula.start, formula.names, formula.rms_time

    def graph(self, candidate: int) -> Graph:
        """What the law does for a candidate.

        Raises
        ------
        NotRecordedError
            If it cannot be recorded, or keeps a number of the loop elsewhere than in its memory.
        """
        recording = Recording()
        kept, start, commands = self._nodes(recording, candidate)
        if sys.getrefcount(recording) > _REFERENCES:
            # What refers to itself in a circle is not freed at once.
            gc.collect()
        if sys.getrefcount(recording) > _REFERENCES:
            raise NotRecordedError(
                "it keeps a reading outside, which would be that of one sample for ever; keep it in the memory",
                "",
            )
        return Graph(recording=recording, kept=kept, start=start, commands=commands)

    def _nodes(
        self, recording: Recording, candidate: int
    ) -> tuple[tuple[tuple[int, int], ...], tuple[float, ...], tuple[int, ...]]:
        """Nodes of the memory before and after, its start, and nodes of the commands."""
        shape, n_memory = self._shape, len(self._start)
        memory = inputs(recording, "memory", (1, n_memory))
        before = [cell.at for cell in memory.cells.ravel()]
        readings = {name: inputs(recording, name, shape.rows(name, 1)) for name in shape.lengths}
        rms, squares = self._running(recording)
        sample: Any = LoopSample(
            time=inputs(recording, "time", ()),  # type: ignore[arg-type] # cells in the place of numbers
            sample_time=shape.sample_time,
            candidate=np.array([candidate]),
            motion=inputs(recording, "motion", (1,)),  # type: ignore[arg-type]
            **readings,  # type: ignore[arg-type]
            largest=shape.largest_commands,
            rms=rms,
        )
        settings = inputs(recording, "setting", (1, len(self._names)))
        returned = bare(self._command(sample, memory, settings))
        n_devices = len(shape.largest)
        if returned.shape not in {(1, n_devices), *([(1,)] if n_devices == 1 else [])}:
            raise NotRecordedError(
                f"it returns an array of shape {returned.shape}; give (n_runs, n_devices)", ""
            )
        nodes = []
        for number in (*memory.cells.ravel(), *returned.ravel()):
            if not isinstance(number, (Cell, float, int, np.floating, np.integer)):
                raise NotRecordedError(f"it returns {number!r}, which is no number", "")
            nodes.append(recording.cell(number).at)
        pairs = (*zip(before, nodes, strict=False), *squares)
        return pairs, (*self._start.tolist(), *(0.0 for _ in squares)), tuple(nodes[n_memory:])

    def _running(self, recording: Recording) -> tuple[RunningRms | None, tuple[tuple[int, int], ...]]:
        """Running root mean squares by the operations of the loop, and their squares before and after."""
        shape = self._shape
        if self._rms_time is None:
            return None, ()
        left = math.exp(-shape.sample_time / self._rms_time)
        roots, squares = {}, list[tuple[int, int]]()
        for name in RMS_READINGS:
            rows = shape.rows(name, 1)
            before, taken = (
                inputs(recording, f"square {name}", rows),
                inputs(recording, f"{_FADING}{name}", rows),
            )
            faded = left * before + (1.0 - left) * np.square(taken)
            after: Any = np.where(np.isfinite(taken), faded, before)
            squares += ((b.at, a.at) for b, a in zip(before.cells.ravel(), after.cells.ravel(), strict=True))
            roots[name] = np.sqrt(after)
        return RunningRms(**roots), tuple(squares)

    def compare(self, graph: Graph, settings: Floats) -> None:
        """Refuse a graph with other numbers than the law has, for several runs at once.

        Raises
        ------
        NotRecordedError
            If one differs.
        """
        rng, shape, n = np.random.default_rng(0), self._shape, _CHECKED
        readings = {name: rng.normal(0.0, _SIZES[name], shape.rows(name, n)) for name in shape.lengths}
        memory = rng.normal(0.0, 0.1, (n, len(self._start)))
        time = float(rng.uniform(0.0, 10.0))
        given: dict[tuple[str, int], Any] = {("time", 0): np.full(n, time), ("motion", 0): np.zeros(n)}
        columns = readings | {
            "memory": memory.copy(),
            "setting": np.broadcast_to(settings, (n, len(settings))),
        }
        roots = {}
        for name in RMS_READINGS if self._rms_time is not None else ():
            squares = rng.uniform(0.0, _SIZES[name] ** 2, shape.rows(name, n))
            columns |= {f"square {name}": squares, f"{_FADING}{name}": readings[name]}
            left = math.exp(-shape.sample_time / (self._rms_time or 1.0))
            roots[name] = np.sqrt(left * squares + (1.0 - left) * np.square(readings[name]))
        for name, rows in columns.items():
            given |= {(name, place): column for place, column in enumerate(rows.reshape(n, -1).T)}
        sample = LoopSample(
            time=time,
            sample_time=shape.sample_time,
            candidate=np.zeros(n, dtype=np.intp),
            motion=np.zeros(n, dtype=np.intp),
            **{name: reading.copy() for name, reading in readings.items()},
            largest=shape.largest_commands,
            rms=RunningRms(**roots) if roots else None,
        )
        n_memory, n_devices = len(self._start), len(shape.largest)
        with np.errstate(all="ignore"):
            returned = np.asarray(self._command(sample, memory, columns["setting"]), dtype=np.float64)
        ends = (*(after for _, after in graph.kept[:n_memory]), *graph.commands)
        found = [np.broadcast_to(end, n) for end in graph.recording.values(given, ends)]
        if returned.shape not in {(n, n_devices), *([(n,)] if n_devices == 1 else [])}:
            raise NotRecordedError(f"for {n} runs it returns an array of shape {returned.shape}", "")
        truth = [*memory.T, *returned.reshape(n, n_devices).T]
        for mine, its in zip(found, truth, strict=True):
            size = np.abs(its[np.isfinite(its)]).max(initial=0.0)
            if not np.allclose(mine, its, rtol=_SAME, atol=_SAME * size, equal_nan=True):
                raise NotRecordedError(
                    "for several runs at once it has other numbers than for each alone; write it for rows of runs",
                    "",
                )


def line_of_no_number(
    formula: OwnFormula, sample: LoopSample, memory: Floats, settings: Floats, *, run: int, device: int
) -> str:
    """The line that makes the command of a run no number, as "line 7"; empty where the law cannot be recorded.

    Parameters
    ----------
    memory, settings
        Of the run before the sample, shapes (n_memory,) and (n_settings,).
    """
    readings = {name: getattr(sample, name) for name in READINGS}
    shape = LoopShape(
        lengths={name: None if each.ndim == 1 else each.shape[1] for name, each in readings.items()},
        largest=tuple(sample.largest.tolist()),
        sample_time=sample.sample_time,
    )
    try:
        graph = _Law(formula, shape).graph(int(sample.candidate[run]))
    except Exception:
        return ""
    columns = {name: np.ravel(each[run]) for name, each in readings.items()}
    columns |= {"memory": memory, "setting": settings, "time": np.array([sample.time])}
    given = {
        (name, place): number for name, numbers in columns.items() for place, number in enumerate(numbers)
    }
    nodes, end = graph.recording.nodes, graph.commands[device]
    used = graph.recording.used_by([end])
    if any(nodes[at].op == "input" and nodes[at].of not in given for at in used):
        return ""
    values = dict(zip(used, graph.recording.values(given, used), strict=True))
    while True:
        node = nodes[end]
        of = node.of if node.op not in ("const", "input") else ()
        if node.op == "where":
            of = (of[1] if values[of[0]] > 0.0 else of[2],)
        made = [at for at in of if np.isnan(values[at]) and nodes[at].op not in ("const", "input")]
        if not made:
            return node.line
        end = made[0]


def _on_tape(graphs: Sequence[Graph], names: tuple[str, ...], settings: Floats) -> tuple[RecordedLaw, Floats]:
    """The tape of graphs that are alike, and settings: their own, then numbers that differ from graph to graph."""
    first = graphs[0]
    recording = Recording()
    recording.nodes = list(first.recording.nodes)
    constants: dict[tuple[str, ...], int] = {}
    for at, node in enumerate(first.recording.nodes):
        values = (
            tuple(graph.recording.nodes[at].of[0].hex() for graph in graphs) if node.op == "const" else ()
        )
        if len({*values}) > 1:
            place = len(names) + constants.setdefault(values, len(constants))
            recording.nodes[at] = Node("input", ("setting", place), "")
    differing = np.array([[*map(float.fromhex, values)] for values in constants]).reshape(-1, len(graphs)).T
    live, used = list[int](), recording.used_by(first.commands)
    while further := [
        place for place, (before, _) in enumerate(first.kept) if before in {*used} and place not in live
    ]:
        live += further
        used = recording.used_by((*first.commands, *(first.kept[place][1] for place in live)))
    live.sort()
    kept = [first.kept[place] for place in live]
    memory = [before for before, _ in kept]
    others = [at for at in used if recording.nodes[at].op == "input" and at not in memory]
    described = []
    for at in others:
        name, place = recording.nodes[at].of
        if name == "motion":
            raise NotRecordedError("it reads sample.motion, which differs from run to run", "")
        described.append((name.removeprefix(_FADING), place, name in READINGS))
    recorded = RecordedLaw(
        tape=tape_of(recording, (*memory, *others), (*(after for _, after in kept), *first.commands)),
        inputs=(*(("memory", place, False) for place in range(len(kept))), *described),
        start=tuple(first.start[place] for place in live),
        names=(*names, *(f"constant_{number + 1}" for number in range(len(constants)))),
    )
    return recorded, np.ascontiguousarray(np.hstack([settings, differing]))
