"""The runs of a row of a study: nominal ones, of which histories are stored, with half the step, with realisations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrwork.closed_loop.responses import history_signals
from mrwork.study.histories import RunHistory, history_of
from mrwork.study.loop_case import LoopCase
from mrwork.study.run_reports import What
from mrwork.study.runs import Runs, asks_for_weighted, knows_least_strokes, runs_of
from mrwork.workers.engine import present_workers

# Histories that are simulated together need about so much memory [bytes].
_MOST_BYTES = 2.0**28


@dataclass(frozen=True, slots=True, kw_only=True)
class RowRuns:
    """Runs of a case in the place of empty ones; `keep` takes the histories under the motions that are `stored`."""

    case: LoopCase
    stored: Sequence[int]
    keep: Callable[[int, RunHistory], None]

    def simulate(self, what: What, empty: Runs) -> Runs:
        """The runs of a step, of which histories are kept; or criteria of the realisations of the case."""
        if what == "realisations":
            return self.case.criteria()
        if what == "runs with half the step":
            return self._simulate(empty, [*range(len(self.case.motions))], step_factor=2)
        runs = Runs.empty(empty.axes, empty.declared)
        for motions, detailed in self._batches():
            runs.put(self._simulate(empty, motions, detailed=detailed, before=runs.n_done), 0, motions)
        return runs

    def store(self, runs: Runs, kept: Callable[[int], bool]) -> None:
        """Store the histories of recalled runs that are not kept, each simulated again."""
        for motion in self._stored(range(len(self.case.motions)), runs):
            if not kept(motion):
                self._simulate(runs, [motion], detailed=True)

    def _stored(self, motions: Sequence[int], runs: Runs) -> list[int]:
        """Motions of which the history of a run is stored; without an end, it has infinite numbers."""
        ended = zip(motions, runs.finished[0, :, 0], strict=True)
        return [motion for motion, finished in ended if finished and motion in self.stored]

    def _simulate(
        self,
        among: Runs,
        motions: list[int],
        *,
        detailed: bool = False,
        step_factor: int = 1,
        before: int = 0,
    ) -> Runs:
        """Runs under some motions, with their histories where they are `detailed`."""
        case = self.case
        on_block, total = case.on_block, len(case.motions)
        part = replace(
            case,
            motions=[case.motions[motion] for motion in motions],
            on_block=on_block and (lambda done, _: on_block(before + done, total)),
        )
        responses = part.responses(motion_numbers=motions, histories=detailed, step_factor=step_factor)
        runs = runs_of(responses, case.arrangement, among.part(motions=motions).axes, case.asked)
        if responses.histories is not None:
            histories = dict(zip(motions, responses.histories, strict=True))
            for motion in self._stored(motions, runs):
                self.keep(motion, history_of(histories[motion], case.arrangement, case.motions[motion]))
        return runs

    def _batches(self) -> Iterator[tuple[list[int], bool]]:
        """Motions that are simulated together, and whether with their histories; these must fit into memory together.

        Small strokes leave the tested range of some dampers: the least stroke of a run is known from its history, as
        are weighted accelerations.
        """
        case, every = self.case, list(range(len(self.case.motions)))
        from_all = knows_least_strokes(case.arrangement) or asks_for_weighted(case.asked)
        detailed = every if from_all else [*self.stored]
        needed = self._bytes_per_second * np.array([motion.duration for motion in case.motions])
        # Workers send none back: this process simulates the runs with histories.
        if not detailed or (needed.sum() < _MOST_BYTES and present_workers() is None):
            yield every, bool(detailed)
            return
        filled = np.cumsum(needed[detailed]) // _MOST_BYTES
        for batch in np.split(detailed, np.flatnonzero(np.diff(filled)) + 1):
            yield batch.tolist(), True
        if others := [motion for motion in every if motion not in detailed]:
            yield others, False

    @property
    def _bytes_per_second(self) -> float:
        """Memory of a run's history per second of motion [bytes/s]."""
        building = self.case.arrangement.building
        sizes = {
            "floor": len(building.floors),
            "storey": len(building.storeys),
            "element": len(building.elements),
            "run": 1,
            "device": max(len(self.case.arrangement.devices), 1),
            "state": 2 * building.n_coordinates,
        }
        columns = sum(sizes[signal.axis] for signal in history_signals())
        return 8.0 * columns / self.case.hardware.sample_time
