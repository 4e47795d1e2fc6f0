"""An identification on the command line: its tests and search, its run folder with the page, and what is printed."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

from mrwork.base.progress import OnProgress, ProgressLine
from mrwork.base.remark import RemarkKind
from mrwork.base.summary import Summarised
from mrwork.cli.frame import Frame, command_line, work_of
from mrwork.cli.output import draw_last, is_quiet, renew_page, show_results
from mrwork.cli.terminal import note, show
from mrwork.cli.tests import read_tests
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import MrworkError, RecordError
from mrwork.identification.fit import Fit
from mrwork.identification.fit_file import manifest_of, others_content, read_fit, write_run
from mrwork.identification.identify import identify_with
from mrwork.identification.settings import FitSettings
from mrwork.records import DamperTest, observed
from mrwork.records.reading import Reading
from mrwork.records.remarks import remarks_for
from mrwork.store.long_call import LongCall
from mrwork.store.run_folder import (
    FIT,
    FIT_RUN,
    INTERRUPTED,
    JOURNAL,
    MODELS,
    NEAR_SETS,
    RANKING,
    REPORT,
    RunFolder,
)
from mrwork.store.run_writer import is_complete, nothing_to_resume

if TYPE_CHECKING:
    from mrwork.uncertainty.choice.choose import Choice

_UNTRIED = RemarkKind("other_models_untried", "other models may leave a smaller residual (--model all)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Identification(Frame):
    """An identification of a command line: its frame, and its tests with their reading.

    A step of another verb is neither shown nor drawn.
    """

    reading: Reading
    tests: tuple[DamperTest, ...]
    is_step: bool = False

    @classmethod
    def of_files(
        cls, options: argparse.Namespace, settings: FitSettings, ending: str, *, kept: str
    ) -> Identification:
        """The identification of the tests of the command line.

        The folder, if none is given, is named by the first test and `ending`.
        """
        reading, tests = read_tests(options, "fit")
        first = tests[0].name.replace(" ", "_").replace(os.sep, "_")
        stem = first if len(tests) == 1 else f"{first}-and-{len(tests) - 1}-more"
        return cls.of_tests(options, settings, reading, tests, f"{stem}-{ending}", kept=kept)

    @classmethod
    def of_tests(
        cls,
        options: argparse.Namespace,
        settings: FitSettings,
        reading: Reading,
        tests: Sequence[DamperTest],
        folder: str,
        *,
        kept: str,
        is_step: bool = False,
    ) -> Identification:
        """The identification of tests as the settings observe them, into `folder` in `out` if none is given."""
        return cls(
            options=options,
            work=work_of(options, FIT_RUN, folder),
            kept=kept,
            reading=reading,
            tests=tuple(observed(test, settings.observing) for test in tests),
            is_step=is_step,
        )

    def fit(self, spec: DamperSpec, settings: FitSettings, *, screens: bool = False) -> int:
        """Fit one model to the tests into the run folder, and show it; return the exit status.

        Where it `screens` other families, because the residual is not noise, a remark names one that predicts visibly
        better; else one says that they were not tried.
        """
        with self.work as work:
            journal, threads = work.journal(), self.options.threads

            def fitted(line: ProgressLine) -> Fit:
                fit = identify_with(
                    spec, self.tests, settings, threads=threads, on_progress=line, journal=journal
                )
                is_noise = bool(fit.force_noise_n) and fit.times_noise is None
                if not screens or is_noise:
                    untried = () if fit.times_noise is None else (_UNTRIED.remark(),)
                    return replace(fit, remarks=(*fit.remarks, *untried))
                from mrwork.uncertainty.choice.screening import better_family, screen_families  # slow to load

                with LongCall[Fit](so_far=lambda: fit).keeping("screening"), suppress(MrworkError):
                    rows = screen_families(self.tests, settings=settings, threads=threads, on_progress=line)
                    return replace(fit, remarks=(*fit.remarks, *better_family(rows, spec.name)))
                return fit

            fit, status = self.compute(fitted, before="any candidate was simulated")
            journal.close()
            self.note_complete()
            return status if fit is None else self._end(self._with_command(fit), status)

    def choose(self, choose: Callable[..., Choice]) -> int:
        """Make a choice of model or laws; the run folder has the best, and what was compared; return the exit status.

        `choose` takes the tests, threads, journals and the line of progress.
        """
        if (status := self._end_complete(RANKING)) is not None:
            return status
        with self.work as work:

            def compared(line: ProgressLine) -> Choice:
                return choose(
                    tests=self.tests,
                    threads=self.options.threads,
                    on_progress=line,
                    journal_of=lambda step: work.journal(f"{MODELS}/{step}.jsonl"),
                )

            choice, status = self.compute(compared, before="anything was compared")
            if choice is None:
                return status
            ranking = choice.ranking
            documents: dict[str, object] = {RANKING: asdict(ranking)}
            if ranking.unit is None:
                best, paths = self._with_command(choice.best), dict[str, str]()
                for fit in choice.fits:
                    path = f"{MODELS}/{fit.model}/{FIT}"
                    paths[fit.model] = str(self.folder / path)
                    documents[path] = self._with_command(fit).as_dict()
                shown = ranking.document() | {"fits": paths}
            else:
                best = self._with_command(replace(choice.best, seconds=choice.seconds))
                shown = best.document() | {"choice_of_laws": ranking.document()}
                if best.others:
                    documents[NEAR_SETS] = others_content(best.others)
            if best.others and not is_quiet(self.options):
                note(
                    f"{len(best.others)} other sets of laws predict nearly as well, within 1 point; predict and "
                    "respond say how far they are apart where the tests end"
                )
            return self._end(
                best,
                status,
                grown=() if status == 0 else work.step_journals,
                results=(ranking, best) if status == 0 else (ranking,),
                document=shown,
                documents=documents,
            )

    def _with_command(self, fit: Fit) -> Fit:
        """The fit with a record of this command line and of how its tests were read, which `reopen` needs."""
        return fit.with_command(command_line(), self.reading)

    def _end_complete(self, table: str) -> int | None:
        """Show the fit of a complete comparison of these tests, which has the `table`, and draw its page.

        Return the exit status, `None` where there is no such comparison or it is not to be resumed.
        """
        if not (self.work.continues and is_complete(self.folder) and (self.work.folder / table).is_file()):
            return None
        fit = read_fit(self.folder)
        if {test.sha256 for test in self.tests} != {*fit.provenance.inputs.values()}:
            raise RecordError(
                f"{self.folder} is of other tests; give the same, or --replace instead of --resume"
            )
        note(nothing_to_resume(self.folder))
        if self.is_step:
            return 0
        self._show((fit,), fit.document())
        return renew_page(self.options, self.folder)

    def _end(
        self,
        fit: Fit,
        status: int,
        *,
        results: Sequence[Summarised] = (),
        document: Mapping[str, object] | None = None,
        documents: Mapping[str, object] | None = None,
        grown: Collection[str] = (JOURNAL,),
    ) -> int:
        """Commit the run folder, show the results, draw the page; return the exit status.

        What is shown are the `results`, with --json the `document`, by default the fit.
        `grown`: the journals that are kept. After Ctrl-C, `status` 130, nothing waits for the disk, no page is drawn,
        and a message says what is written.
        """
        finished, written = status == 0, self.is_to_write(status)
        if written:
            write_run(
                self.work,
                fit=fit,
                manifest=manifest_of(fit, fit.status if finished else INTERRUPTED),
                documents=documents,
                grown=grown,
            )
        if not self.is_step:
            self._show(results or (fit,), fit.document() if document is None else document)
        if not finished:
            self.note_stop(written=written)
        if not finished or self.is_step:
            return status

        def draw(on_progress: OnProgress) -> None:
            from mrwork.report.fit.page import fit_page
            from mrwork.runs.load import with_additions
            from mrwork.uncertainty.bands.prediction import predictions_of

            run = with_additions(RunFolder.open(self.folder), fit)
            fit_page(run, predictions_of(fit, self.tests), on_progress=on_progress).write(self.folder)

        status = draw_last(self.options, self.folder, draw)
        if status == 0 and not self.options.json:
            show(f"\nReport: {self.folder / REPORT}")
        return status

    def _show(self, results: Sequence[Summarised], document: Mapping[str, object]) -> None:
        said = {remark.code for result in results if isinstance(result, Fit) for remark in result.remarks}
        remarks = [each for each in remarks_for("identify", self.tests) if each.code not in said]
        more = {"test_remarks": [asdict(remark) for remark in remarks], "out": str(self.folder)}
        below = ["", *(f"  {remark.in_words}" for remark in remarks)] if remarks else []
        show_results(self.options, *results, document={**document, **more}, below=below)
