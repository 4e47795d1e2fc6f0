"""An identification on the command line: its tests and search, its folder with the page, its text and JSON."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from mrwork.base.progress import ProgressLine
from mrwork.cli.frame import Frame, command_line
from mrwork.cli.options import read_tests
from mrwork.cli.output import (
    as_plain,
    draw_last,
    named,
    print_json,
    print_result,
    renew_page,
    result_lines,
    task_line,
)
from mrwork.cli.terminal import note, show
from mrwork.errors import RecordError, escape_text
from mrwork.identification.fit import Estimate, Fit, step_in_words
from mrwork.identification.fit_file import manifest_of, read_fit, write_run
from mrwork.identification.result import FitSpread
from mrwork.identification.settings import FitSettings
from mrwork.records import DamperTest, observed
from mrwork.records.findings import findings_for, findings_of_set, gathered_findings
from mrwork.records.reading import Reading
from mrwork.store.run_folder import FIT_RUN, INTERRUPTED, JOURNAL, REPORT, RunFolder
from mrwork.store.run_writer import RunAtWork, is_complete, nothing_to_resume

if TYPE_CHECKING:
    from mrwork.report.section import OnDrawn

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True, kw_only=True)
class Identification:
    """An identification of a command line: its frame, and its tests with their reading."""

    frame: Frame
    reading: Reading
    tests: tuple[DamperTest, ...]

    @classmethod
    def of(
        cls, options: argparse.Namespace, settings: FitSettings, ending: str, *, kept: str
    ) -> Identification:
        """That of the tests of the command line, with the observation models of the settings.

        The name of the folder, if none is given, is that of the first test and `ending`.
        """
        reading, read = read_tests(options, "fit")
        tests = tuple(observed(test, settings.observe) for test in read)
        first = tests[0].name.replace(" ", "_").replace(os.sep, "_")
        stem = first if len(tests) == 1 else f"{first}-and-{len(tests) - 1}-more"
        frame = Frame.of(options, FIT_RUN, f"{stem}-{ending}", kept)
        return cls(frame=frame, reading=reading, tests=tests)

    def search(
        self, search: Callable[[ProgressLine[Any]], Result], described: Callable[[Any], str], *, before: str
    ) -> tuple[Result | None, int]:
        """The result of a search, and the exit status; `before` says what has not happened when Ctrl-C leaves none."""
        result, status = self.frame.compute(search, described)
        if result is None:
            note(f"interrupted before {before}; run the same command with --resume to continue")
        return result, status

    def described_fit(self, fit: Fit, status: int) -> Fit:
        """The fit with this command line and the reading of its tests, and at `status` 0 with its identifiability."""
        if status == 0:
            with task_line("identifiability of the parameters", quiet=self.frame.is_quiet):
                # SciPy's optimisers are slow to load.
                from mrwork.uncertainty.identifiability.verdicts import identifiability_of

                threads = self.frame.options.threads
                fit = fit.with_identifiability(identifiability_of(fit, self.tests, threads=threads))
        return self.with_command(fit)

    def with_command(self, fit: Fit) -> Fit:
        """The fit with a record of this command line and of how its tests were read, which `reopen` needs."""
        return fit.with_command(command_line(), self.reading)

    def end_complete(self, table: str) -> int | None:
        """Show the fit of a complete comparison of these tests, which has the `table`, and draw its page.

        Return the exit status, `None` where there is no such comparison or it is not to be resumed.
        """
        destination, folder = self.frame.destination, self.frame.folder
        if not (destination.continues and is_complete(folder) and (destination.place / table).is_file()):
            return None
        fit = read_fit(folder)
        if {test.sha256 for test in self.tests} != {*fit.provenance.inputs.values()}:
            raise RecordError(f"{folder} is of other tests; give the same, or --replace instead of --resume")
        note(nothing_to_resume(folder))
        print_result(self.frame.options, summary_of(fit, self.tests, folder), text_of(fit, self.tests))
        return renew_page(folder, quiet=self.frame.is_quiet)

    def end(
        self,
        fit: Fit,
        status: int,
        *,
        work: RunAtWork,
        text: str,
        document: Mapping[str, object],
        documents: Mapping[str, object] | None = None,
        grown: Collection[str] = (JOURNAL,),
    ) -> int:
        """Commit the run folder, print the result, draw the page; return the exit status.

        `grown`: the journals that are kept. After Ctrl-C, `status` 130, nothing waits for the disk, no page is drawn,
        and a message says what is written.
        """
        options, folder, finished = self.frame.options, self.frame.folder, status == 0
        written = self.frame.is_to_write(status)
        if written:
            write_run(
                work,
                fit=fit,
                manifest=manifest_of(fit, fit.status if finished else INTERRUPTED),
                documents=documents,
                grown=grown,
                flush=finished,
            )
        if not options.json:
            show(text)
        if finished:

            def draw(on_progress: OnDrawn) -> None:
                # Matplotlib is slow to load and needed for reports only.
                from mrwork.report.fit.page import write_fit_page
                from mrwork.runs.load import with_additions
                from mrwork.uncertainty.bands.prediction import predictions_of

                run = with_additions(RunFolder.open(folder), fit)
                write_fit_page(run, predictions_of(fit, self.tests), on_progress=on_progress)

            status = draw_last(folder, draw, quiet=self.frame.is_quiet)
        else:
            self.frame.note_stop(written=written)
        if options.json:
            print_json(document)
        elif status == 0:
            show(f"\nReport: {folder / REPORT}")
        return status


def spread_of(fit: Fit) -> FitSpread:
    """Median and worst fit of the tests of a fit."""
    return FitSpread.of([each.test for each in fit.quality], [each.fit_percent for each in fit.quality])


def summary_of(fit: Fit, tests: tuple[DamperTest, ...], folder: Path) -> dict[str, Any]:
    """Summary of a fit, for --json; `files` name each test as `test` and, as `predict` does, as `file`."""
    spread = spread_of(fit) if len(fit.quality) > 1 else None
    return {
        "model": fit.model,
        "parameters": {estimate.name: _parameter(fit, estimate) for estimate in fit.estimates},
        "uncertainty": fit.uncertainty_heading,
        "current_laws": None if fit.current is None else asdict(fit.current),
        "identifiability": None if fit.identifiability is None else asdict(fit.identifiability),
        "nuisances": fit.nuisances,
        "observation": fit.observation_in_words,
        **named(fit, "fit_percent", "nrmse", "rmse_n"),
        "error_norms": asdict(fit.error_norms),
        **named(fit, "status", "status_reason", "stop_reason"),
        "tested_range": asdict(fit.tested),
        **named(fit, "warnings", "evaluations", "refinement_steps", "seconds", "n_time", "n_effective"),
        "rng": fit.provenance.rng,
        "files": [{"file": quality.test, **asdict(quality)} for quality in fit.quality],
        "median_fit_percent": None if spread is None else spread.median_percent,
        "worst_fit_percent": None if spread is None else spread.worst_percent,
        "spread": None if spread is None else asdict(spread),
        "findings": as_plain(findings_for("identify", tests)),
        "out": str(folder),
    }


def _parameter(fit: Fit, estimate: Estimate) -> dict[str, Any]:
    verdict, reason = fit.verdict_on(estimate.name)
    numbers = named(estimate, "value", "unit", "standard_error", "lower", "upper", "remark")
    return numbers | {"verdict": verdict, "reason": reason}


def text_of(fit: Fit, tests: tuple[DamperTest, ...]) -> str:
    """Summary of a fit, as text."""
    lines = [
        f"{fit.spec.title}, {fit.status_in_words} after {fit.evaluations} simulations, {fit.seconds:.1f} s",
        "",
        *(f"  warning: {each}" for each in fit.warnings),
        *([""] if fit.warnings else []),
        *result_lines(fit),
        "",
        f"  tested: {fit.tested.in_words}",
        *([] if fit.half_step_percent is None else [f"  {step_in_words(fit.half_step_percent)}"]),
        "",
    ]
    if fit.identifiability is not None and fit.identifiability.informative:
        lines += [*(f"  - {each.sentence}" for each in fit.identifiability.informative), ""]
    gathered = gathered_findings(tests)
    for test, quality, findings in zip(tests, fit.quality, gathered.own, strict=True):
        settle = f", first {quality.settle_seconds:.2g} s not compared" if quality.settle_seconds > 0 else ""
        recorded = quality.recorded_in_words
        lines.append(
            f"  {escape_text(test.label)}: fit {quality.fit_percent:.2f} %, RMSE {quality.rmse_n:.4g} N "
            f"over {quality.n_time} samples{settle}{f'; the model force {recorded}' if recorded else ''}"
        )
        lines += [f"    {finding.severity}: {finding.message}" for finding in findings]
    if len(tests) > 1:
        lines += ["", f"  {spread_of(fit).in_words}"]
    lines += [f"  {each.severity}: {each.message}" for each in findings_of_set(tests)]
    lines += [f"  {shared.in_words}" for shared in gathered.shared]
    return "\n".join(lines)
