"""Shared code of the verbs on a study: its run from journal to folder, and its results on the terminal.

Changes of every quantity come first, then criteria and scores.
"""

from __future__ import annotations

import argparse
import platform
import shlex
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from math import isfinite
from pathlib import Path
from textwrap import wrap
from typing import Any, Generic, Literal, TypeVar

from mrwork import __version__
from mrwork.cli.output import print_result, stopped_in_words, table_lines
from mrwork.cli.terminal import keep_stdout, note
from mrwork.closed_loop.evaluation import SCORE, criterion
from mrwork.errors import Interrupted
from mrwork.numbers import with_decimals
from mrwork.store.codec import digest_of
from mrwork.store.journal import Journal
from mrwork.store.output_folder import Destination, check_destination
from mrwork.store.run_folder import REPORT, RunKind
from mrwork.store.unfinished import discard_journal, is_complete, run_journal
from mrwork.study.comparison import (
    ADD_BEST_PASSIVE,
    MOST_IN_DETAIL,
    StudyComparison,
    chosen_in_words,
    compared,
    in_percent,
    judged_in_words,
    motion_groups,
    times_better,
)
from mrwork.study.results import OFF_BALANCE, ON_OFF, StudyResults, largest_step_changes
from mrwork.study.schema import Use
from mrwork.study.study import Kind, Study, StudyFile
from mrwork.tuning.results import TuningResults


def command_line() -> str:
    """The command as it was given."""
    return shlex.join(["mrwork", *sys.argv[1:]])


Results = TypeVar("Results", StudyResults, TuningResults)


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyVerb(Generic[Results]):
    """A verb on a study: computes the results and their page, folder, JSON object and text.

    `page` takes the seconds so far, `text` whether the page was drawn and whether the folder was written; `kept` says
    what a folder has after Ctrl-C.
    """

    kind: RunKind
    kept: str
    compute: Callable[[Journal], Results]
    page: Callable[[Results, float], str | None]
    write: Callable[..., None]
    document: Callable[[Results], dict[str, Any]]
    text: Callable[[Results, bool, bool], str]

    def run(
        self,
        options: argparse.Namespace,
        study: Study,
        destination: Destination,
        journal: Journal,
        began: float,
    ) -> int:
        """Compute, write the folder, print the result; return the exit status."""
        place, status, drawn = destination.path, 0, False
        try:
            results = self.compute(journal)
        except Interrupted as interrupt:
            results, status = interrupt.result, 130
        finally:
            journal.finish()
        written = status == 0 or not is_complete(place)
        if written:
            seconds = time.perf_counter() - began
            manifest = self._manifest(options, study.file, results, seconds)
            try:
                page = self.page(results, seconds)
            except KeyboardInterrupt:
                page = None
            self.write(
                destination,
                results,
                study_file=study.file,
                page=page,
                manifest=manifest,
                journal=journal.path,
            )
            drawn = page is not None
            discard_journal(journal)
        document = self.document(results) | {"out": str(place)}
        print_result(options, document, self.text(results, drawn, written))
        if status == 130:
            note(stopped_in_words(place, self.kept, written=written))
        elif not drawn:
            note(
                f"interrupted while the page was drawn; the results are in {place}; run the same command with --resume "
                "to draw it"
            )
            status = 130
        return status

    def _manifest(
        self, options: argparse.Namespace, study_file: StudyFile, results: Results, seconds: float
    ) -> dict[str, Any]:
        """The manifest of a run on the file `options.study`, as it was read, with the seed `options.seed`."""
        return {
            "kind": self.kind.kind,
            "title": results.title,
            "status": results.status,
            "command": command_line(),
            "seed": options.seed,
            "study": {"path": str(options.study), "content": digest_of(study_file.text)},
            "versions": {"mrwork": __version__, "python": platform.python_version()},
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "seconds": seconds,
        }


def run_on_study(
    options: argparse.Namespace,
    kind: RunKind,
    default: str,
    verb_of: Callable[[Study, Path], StudyVerb[Results]],
    *,
    use: Use | Literal["all"] = "all",
) -> int:
    """Run a verb on the motions of a `use` of its study, in a folder, by default `default` in `out`; its status."""
    # The simulation is slow to load.
    from mrwork.study.reading import read_study

    began = time.perf_counter()
    with keep_stdout():
        study = read_study(options.study, seed=options.seed, on_python=note)
    study = study if use == "all" else study.of_use(use)
    place = options.out or Path("out") / default
    destination = Destination.of(place, kind, replace=options.replace, resume=options.resume)
    check_destination(destination)
    with run_journal(destination, resume=options.resume, note=note) as journal:
        return verb_of(study, destination.path).run(options, study, destination, journal, began)


_WIDTH = 100
# Quantities whose changes the tables show; the page and the results file have all.
_QUANTITIES = (
    "peak_displacement",
    "peak_drift",
    "peak_acceleration",
    "peak_base_shear",
    "rms_drift",
    "rms_acceleration",
)


def study_text(results: StudyResults, folder: Path | None) -> str:
    """Changes of every quantity, a table for each motion, scores, check of the step, warnings, path of the page."""
    comparison = compared(results)
    lines = [results.title, "", *_leading_lines(comparison)]
    for reference in comparison.references if len(results.rows) > 1 else ():
        lines += [*_change_lines(comparison, reference), ""]
    motions = range(len(results.motions))
    if len(motions) <= MOST_IN_DETAIL:
        for motion in motions:
            lines += [*_motion_lines(results, motion), ""]
    for block in (
        _score_lines(comparison),
        _group_lines(comparison),
        _band_lines(results),
        _step_lines(results),
    ):
        lines += [*block, ""] if block else []
    lines += [f"warning: {warning}" for warning in results.warnings()]
    lines += [] if results.balanced else [OFF_BALANCE]
    return "\n".join([*lines, *([f"Report: {folder / REPORT}"] if folder else [])])


def _leading_lines(comparison: StudyComparison) -> list[str]:
    """Changes of each quantity by the leading row, and open questions on the passive dampers of the study."""
    lines: list[str] = []
    if comparison.leading is not None:
        lines.append(comparison.heading(comparison.leading))
        for sentence in comparison.in_words(comparison.leading):
            lines += wrap(sentence, width=_WIDTH, initial_indent="  ", subsequent_indent="    ")
    lines += wrap(ADD_BEST_PASSIVE, width=_WIDTH) if comparison.lacks_best_passive else []
    return [*lines, ""] if lines else []


def _change_lines(comparison: StudyComparison, reference: int) -> list[str]:
    """Changes of every row against a reference, the rows of each rank together."""
    results = comparison.results
    several = len(results.judged_motions) > 1
    table = [("", *(criterion(name).short for name in _QUANTITIES))]
    for rank, rows in comparison.ranks:
        others = [row for row in rows if row != reference]
        table += [(rank.title, *[""] * len(_QUANTITIES))] if others else []
        for row in others:
            changes = [comparison.changes(row, reference)[name] for name in _QUANTITIES]
            cells = [
                f"{in_percent(each.mean):>4}" + (f" ({in_percent(each.largest):>3})" if several else "")
                for each in changes
            ]
            table.append((f"  {results.rows[row].label}", *cells))
    means = f", mean of {judged_in_words(results)} (largest of one motion)" if several else ""
    return [f"Change in % against {results.rows[reference].label}{means}", *table_lines(table)]


def _motion_lines(results: StudyResults, motion: int) -> list[str]:
    """Criteria under one motion, and their ratios to those of the dampers without a command, or without dampers."""
    reference = results.row_of("passive_off")
    against: Kind = "uncontrolled" if reference is None else "passive_off"
    over = "uncontrolled" if reference is None else results.rows[reference].label
    table = [("", "drift mm", "m/s2", "force N", *(criterion(name).short for name in SCORE))]
    for row, each in enumerate(results.rows):
        criteria = results.criteria(row, motion)
        if criteria is None:
            run = results.runs.get((row, motion))
            table.append((each.label, "not run" if run is None else run.outcome, *[""] * (2 + len(SCORE))))
            continue
        ratios = results.ratios(row, motion, against)
        table.append(
            (
                each.label,
                f"{1e3 * criteria['peak_drift']:.4g}",
                f"{criteria['peak_acceleration']:.3g}",
                "-" if each.kind in ("uncontrolled", "baseline") else f"{criteria['peak_force']:.4g}",
                *(with_decimals(ratios[name], 3) for name in SCORE),
            )
        )
    return [f"{results.motions[motion].name}: criteria, and over {over}", *table_lines(table)]


def _score_lines(comparison: StudyComparison) -> list[str]:
    """The score of every row, its spread over the motions, and how often the row is better than a constant command."""
    results = comparison.results
    if not any(isfinite(results.score(row)) for row in range(len(results.rows))):
        return []
    several = len(results.judged_motions) > 1
    against = comparison.passive
    heads = ("least", "25 %", "median", "75 %", "most", "better") if several else ()
    table = [("", "score", *heads)]
    for rank, rows in comparison.ranks:
        table.append((rank.title, *[""] * (1 + len(heads))))
        for row in rows:
            spread = results.spread(row)
            numbers = (
                (spread.least, spread.lower_quartile, spread.median, spread.upper_quartile, spread.most)
                if several
                else ()
            )
            better = None if against in (None, row) else times_better(results, row, against)
            counts = ("" if better is None else f"{better}/{len(results.judged_motions)}",) if several else ()
            cells = (with_decimals(number, 3) for number in (results.score(row), *numbers))
            table.append((f"  {results.rows[row].label}", *cells, *counts))
    lines = [
        f"Score, the mean of these ratios over {judged_in_words(results)}, lowest first:",
        *table_lines(table),
    ]
    if several and against is not None:
        lines += wrap(
            "Least to most: of single motions. Better: motions with less peak drift and less peak acceleration than "
            f"{results.rows[against].label}. {chosen_in_words(results)}".rstrip(),
            width=_WIDTH,
        )
    notes = [rank.note for rank, _ in comparison.ranks if rank.note]
    return [*lines, *(line for note in notes for line in wrap(note, width=_WIDTH))]


def _group_lines(comparison: StudyComparison) -> list[str]:
    """The score of every row under each group of motions."""
    results = comparison.results
    groups = motion_groups(results)
    if not groups or not any(isfinite(results.score(row)) for row in range(len(results.rows))):
        return []
    table = [("", *(f"{group.name} ({len(group.motions)})" for group in groups))]
    for _, rows in comparison.ranks:
        for row in rows:
            scores = (results.score_under(row, group.motions) for group in groups)
            table.append((results.rows[row].label, *(with_decimals(score, 3) for score in scores)))
    return ["Score under groups of motions, with the number of motions:", *table_lines(table)]


def _band_lines(results: StudyResults) -> list[str]:
    """Bands of the scores over realisations, and of the peak drift."""
    varied = results.varied
    if varied is None or not varied.rows:
        return []
    off = results.row_of("passive_off")
    table: list[tuple[str, ...]] = [("", "score", "peak drift")]
    for number, row in enumerate(results.rows):
        bands = (
            varied.score_band(number, off, results.judged_motions),
            varied.ratio_band(number, off, results.judged_motions, "peak_drift"),
        )
        cells = [
            "-" if each is None else f"{each.median:.3f} ({each.lower:.3f} to {each.upper:.3f})"
            for each in bands
        ]
        table.append((row.label, *cells))
    heading = (
        f"Over {varied.count} realisations: median and 90 % band of the score, and of peak drift over i = 0"
    )
    return [heading, *table_lines(table)]


def _step_lines(results: StudyResults) -> list[str]:

    changes = largest_step_changes(results)
    if not changes:
        return []
    table = [
        (
            results.rows[each.row].label,
            f"{each.change:.1e}" if each.criterion else "-",
            each.in_words(results),
        )
        for each in changes
    ]
    heading = "Half the step: the largest change of a criterion, over its value"
    return [heading, *table_lines([("", "change", ""), *table]), ON_OFF]
