"""Shared code of the verbs on a study: its run from journal to folder, and its results on the terminal.

Changes of every quantity come first, then criteria and scores.
"""

from __future__ import annotations

import argparse
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from math import isfinite
from pathlib import Path
from textwrap import wrap
from typing import Any, Generic, Literal, TypeVar

import numpy as np

from mrwork import __version__
from mrwork.base.numbers import MINUS, NOTHING, duration_in_words
from mrwork.base.progress import ProgressLine, ProgressReport
from mrwork.base.table import Table
from mrwork.cli.frame import Frame, command_line
from mrwork.cli.output import in_words, is_quiet, print_result, progress_line, renew_page
from mrwork.cli.terminal import keep_stdout, note
from mrwork.cli.workers import on_workers
from mrwork.store.codec import digest_of
from mrwork.store.journal import Journal
from mrwork.store.run_folder import REPORT, RunKind
from mrwork.store.run_writer import RunAtWork
from mrwork.study.comparison import (
    ADD_BEST_PASSIVE,
    MOST_IN_DETAIL,
    StudyComparison,
    chosen_in_words,
    compared,
    findings,
    judged_in_words,
    motion_groups,
)
from mrwork.study.results import OFF_BALANCE, ON_OFF, StudyResults
from mrwork.study.schema import Use
from mrwork.study.study import Study
from mrwork.study.tables import (
    bands_of_study,
    change_table,
    group_table,
    spread_table,
    step_table,
    value_table,
)

Results = TypeVar("Results", bound=StudyResults)

# Seconds until progress is shown.
_SOON = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyVerb(Generic[Results]):
    """A verb on a study: computes the results and their folder, JSON object and text.

    `text` takes whether the page was drawn and whether the folder was written.
    """

    compute: Callable[[Journal, ProgressLine[Any]], Results]
    write: Callable[..., None]
    document: Callable[[Results], dict[str, Any]]
    text: Callable[[Results, bool, bool], str]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reading(ProgressReport):
    """Progress of reading a study, with the time since it began [s]."""

    seconds: float = 0.0

    @property
    def in_words(self) -> str:
        """Progress in one line."""
        return f"reading the study and designing its laws, {duration_in_words(self.seconds)}"

    def later(self, seconds: float) -> _Reading:
        """The same after some time."""
        return _Reading(seconds=self.seconds + seconds)


def run_on_study(
    options: argparse.Namespace,
    kind: RunKind,
    default: str,
    kept: str,
    verb_of: Callable[[Study, RunAtWork], StudyVerb[Results]],
    *,
    use: Use | Literal["all"] = "all",
) -> int:
    """Run a verb on the motions of a `use` of its study: compute, write the folder, print; return the exit status."""
    # The simulation is slow to load.
    from mrwork.runs.study import read_study

    began = time.perf_counter()
    with progress_line(in_words, quiet=is_quiet(options), patience=_SOON) as line, keep_stdout():
        line(_Reading())
        report = None if is_quiet(options) else line
        study = read_study(options.study, seed=options.seed, on_python=note, on_progress=report)
    study = study if use == "all" else study.of_use(use)
    frame = Frame.of(options, kind, default, kept)
    with RunAtWork(frame.destination, note=note) as work:
        verb, journal = verb_of(study, work), work.journal()
        with keep_stdout(), on_workers(options):
            results, status = frame.compute(lambda line: verb.compute(journal, line), patience=_SOON)
        journal.close()
        frame.note_complete(work)
        assert results is not None  # an interrupted study has the runs so far
        written, interrupted, folder = frame.is_to_write(status), status == 130, frame.folder
        if written:
            assert study.file is not None  # it was read from one
            manifest = {
                "kind": kind.kind,
                "title": results.title,
                "status": results.status,
                "command": command_line(),
                "seed": options.seed,
                "study": {"path": str(options.study), "content": digest_of(study.file.text)},
                "versions": {"mrwork": __version__, "python": platform.python_version()},
                "created": datetime.now(UTC).isoformat(timespec="seconds"),
                "seconds": time.perf_counter() - began,
            }
            verb.write(work, results, study_file=study.file, manifest=manifest)
            # After Ctrl-C nothing that takes long: the page is drawn when the run is resumed.
            if not interrupted:
                status = renew_page(folder, quiet=is_quiet(options))
        document = verb.document(results) | {"out": str(folder)}
        drawn = written and (folder / REPORT).is_file()
        print_result(options, document, verb.text(results, drawn, written))
        if interrupted:
            frame.note_stop(written=written)
        return status


_WIDTH = 100
# Longest line of a table.
_WIDEST = 120
_PLAIN = str.maketrans({MINUS: "-", NOTHING: "-", "²": "2"})


def study_text(results: StudyResults, folder: Path | None) -> str:
    """Changes of every quantity, a table for each motion or of medians, scores, warnings, path of the page."""
    comparison = compared(results)
    lines = [results.title, "", *_leading_lines(comparison)]
    for reference in comparison.references if len(results.rows) > 1 else ():
        lines += _change_lines(comparison, reference)
    if len(results.motions) <= MOST_IN_DETAIL:
        for motion in range(len(results.motions)):
            lines += _motion_lines(results, motion)
    elif rows := _begun_rows(results):
        heading = f"Criteria, median of {judged_in_words(results)}"
        lines += _block(heading, value_table(results, results.judged_motions, rows))
    if any(isfinite(results.score(row)) for row in range(len(results.rows))):
        lines += _score_lines(comparison)
    lines += _band_lines(results)
    lines += _step_lines(results)
    for finding in findings(results):
        lines += wrap(finding, width=_WIDTH)
    lines += [f"warning: {warning}" for warning in results.warnings()]
    lines += [] if results.balanced else [OFF_BALANCE]
    return "\n".join([*lines, *([f"Report: {folder / REPORT}"] if folder else [])])


def _leading_lines(comparison: StudyComparison) -> list[str]:
    """Changes of each quantity by the leading row, and open questions on the passive dampers of the study."""
    lines: list[str] = []
    sentences = [] if comparison.leading is None else comparison.in_words(comparison.leading)
    if comparison.leading is not None and sentences:
        lines.append(comparison.heading(comparison.leading))
        for sentence in sentences:
            lines += wrap(sentence, width=_WIDTH, initial_indent="  ", subsequent_indent="    ")
    lines += wrap(ADD_BEST_PASSIVE, width=_WIDTH) if comparison.lacks_best_passive else []
    return [*lines, ""] if lines else []


def _block(heading: str, table: Table, *below: str) -> list[str]:
    """A table of the page below its heading, in the characters that every terminal has, and paragraphs below it."""
    lines = [line.translate(_PLAIN) for line in table.lines("  ", width=_WIDEST)]
    return [heading, *lines, *(line for text in below for line in wrap(text, width=_WIDTH)), ""]


def _change_lines(comparison: StudyComparison, reference: int) -> list[str]:
    """Changes of every row against a reference, the rows of each rank together."""
    results = comparison.results
    begun = _begun_rows(results)
    if reference not in begun or len(begun) < 2:
        return []
    means = f", mean over {judged_in_words(results)}" if len(results.judged_motions) > 1 else ""
    heading = f"Change in % against {results.rows[reference].label}{means}"
    return _block(heading, change_table(comparison, reference, begun))


def _begun_rows(results: StudyResults, motion: int | None = None) -> list[int]:
    """Rows that were simulated, under this motion or any; after Ctrl-C these are not all."""
    begun = results.quantities.done[:, :, 0]
    return [int(row) for row in np.flatnonzero(begun.any(axis=1) if motion is None else begun[:, motion])]


def _motion_lines(results: StudyResults, motion: int) -> list[str]:
    """Criteria under one motion."""
    rows, name = _begun_rows(results, motion), results.motions[motion].name
    return _block(f"{name}: criteria", value_table(results, (motion,), rows)) if rows else []


def _score_lines(comparison: StudyComparison) -> list[str]:
    """The score of every row, its spread over the motions, how often it beats a constant command, and its groups."""
    results, against = comparison.results, comparison.passive
    ranked = [row for _, rows in comparison.ranks for row in rows]
    begun = _begun_rows(results)
    below = [rank.note for rank, _ in comparison.ranks if rank.note]
    if len(results.judged_motions) > 1 and against is not None:
        below.insert(
            0,
            "Least to most: of single motions. Better: motions with less peak drift, less peak acceleration, or both, "
            f"than {results.rows[against].label}. {chosen_in_words(results)}".rstrip(),
        )
    heading = f"Score (peak and RMS drift and acceleration over those at i = 0), mean over {judged_in_words(results)}:"
    lines = _block(heading, spread_table(comparison, [row for row in ranked if row in begun]), *below)
    if motion_groups(results):
        lines += _block("Score under groups of motions:", group_table(results, ranked))
    return lines


def _band_lines(results: StudyResults) -> list[str]:
    """Bands of the scores over realisations, and of the peak drift."""
    rows = results.realised_rows
    if results.row_of("passive_off") not in rows:
        return []
    heading = f"Over {results.n_realisations} realisations: median and 90 % band of the score, and of ratios over i = 0"
    return _block(heading, bands_of_study(results, rows))


def _step_lines(results: StudyResults) -> list[str]:
    table = step_table(results, _begun_rows(results))
    if not table.rows:
        return []
    lines = _block("Half the step: the largest change of a criterion, over its value", table)
    return [*lines[:-1], ON_OFF, ""]
