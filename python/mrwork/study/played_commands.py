"""The row of the non-causal optimum of a study: its searches, which a journal records, and its runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

from mrwork.closed_loop.clairvoyant_problem import Floats
from mrwork.closed_loop.clairvoyant_search import (
    Clairvoyant,
    ClairvoyantProgress,
    ClairvoyantStart,
    clairvoyant,
)
from mrwork.closed_loop.prescribed import PrescribedCommands, simulate_prescribed
from mrwork.closed_loop.simulate import simulate_loop
from mrwork.store import Journal, digest_of
from mrwork.study.results import StudyResults
from mrwork.study.run_result import RunHistory, RunResult, history_of, result_of
from mrwork.study.study import Arrangement, Study, digest_of_run


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayedCommands:
    """The non-causal optimum of a study that asks for it, under each of its motions."""

    study: Study
    threads: int

    def searched(
        self,
        motion: int,
        arrangements: Sequence[Arrangement],
        results: StudyResults,
        journal: Journal | None,
        report: Callable[[str], None],
    ) -> Clairvoyant:
        """The optimum under a motion; one of the starts are the commands of the best law of `results`."""
        asked, base = self.study.clairvoyant, self.study.at_zero
        assert asked is not None
        ground = self.study.grounds[motion]

        def recall(name: str, start: Floats, search: Callable[[], ClairvoyantStart]) -> ClairvoyantStart:
            report(f"{asked.row.label}, {ground.name}: {name}")
            if journal is None:
                return search()
            inputs = digest_of(digest_of_run(base, ground), asdict(asked.settings), name, start)
            return journal.once("clairvoyant", inputs, ClairvoyantStart, search)

        def on_progress(progress: ClairvoyantProgress) -> None:
            report(
                f"{asked.row.label}, {ground.name}: {progress.start}, iteration {progress.iteration} of "
                f"{progress.iterations}, score about {progress.smooth_score:.3f}"
            )

        return clairvoyant(
            base.building,
            base.devices,
            ground,
            self.study.hardware,
            settings=asked.settings,
            starts=self._law_starts(motion, arrangements, results),
            floors=base.floors,
            storeys=base.storeys,
            on_progress=on_progress,
            recall=recall,
            threads=self.threads,
        )

    def run(
        self, motion: int, found: Clairvoyant, *, histories: bool = False, step_factor: int = 1
    ) -> tuple[RunResult, RunHistory | None]:
        """The run of the loop with the commands that were found, and its history."""
        base = self.study.at_zero
        responses = simulate_prescribed(
            base.building,
            base.devices,
            found.commands,
            self.study.grounds[motion],
            self.study.hardware,
            histories=histories,
            step_factor=step_factor,
            threads=self.threads,
        )
        kept = None if responses.histories is None else history_of(responses.histories[0], base)
        return result_of(responses, 0, base), kept

    def _law_starts(
        self, motion: int, arrangements: Sequence[Arrangement], results: StudyResults
    ) -> dict[str, PrescribedCommands]:
        """Commands of the control law with the lowest score under a motion, if there is one."""
        asked = self.study.clairvoyant
        assert asked is not None
        laws = [
            (results.score_under(row, (motion,)), row)
            for row, each in enumerate(arrangements)
            if each.row.kind == "controller" and row in results.finished(motion)
        ]
        if not laws:
            return {}
        best = arrangements[min(laws)[1]]
        assert best.law is not None
        run = simulate_loop(
            best.building,
            best.devices,
            best.law,
            [self.study.grounds[motion]],
            self.study.hardware,
            histories=True,
            threads=self.threads,
        )
        assert run.histories is not None
        return {
            best.row.label: PrescribedCommands.of_history(
                run.histories[0].command, self.study.hardware.sample_time, asked.settings.interval
            )
        }
