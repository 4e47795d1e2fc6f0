"""Shared code of the verbs on a study: its run from journal to folder, and its results on the terminal."""

from __future__ import annotations

import argparse
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Generic, Literal, TypeVar

from mrwork import __version__
from mrwork.base.progress import Progress, ProgressLine
from mrwork.cli.frame import Frame, command_line, work_of
from mrwork.cli.options import on_workers
from mrwork.cli.output import print_json, progress_line, renew_page
from mrwork.cli.terminal import keep_stdout, note, show
from mrwork.runs.read_study import read_study
from mrwork.store.codec import digest_of
from mrwork.store.journal import Journal
from mrwork.store.run_folder import JOURNAL, REPORT, RunKind
from mrwork.store.run_writer import RunAtWork
from mrwork.study.histories import history_names
from mrwork.study.results import StudyResults
from mrwork.study.schema import Use
from mrwork.study.study import Study, StudyFile
from mrwork.study.tables import study_summary
from mrwork.study.trials import designed

Results = TypeVar("Results", bound=StudyResults)

# Seconds until progress is shown.
_SOON = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyVerb(Generic[Results]):
    """A verb on a study: computes the results, their files, JSON object, and text around that of the study."""

    compute: Callable[[Journal, ProgressLine], Results]
    files: Callable[[Results, StudyFile], dict[str, bytes]]
    document: Callable[[Results], dict[str, Any]]
    text: Callable[[Results, str], str]


def run_on_study(
    options: argparse.Namespace,
    kind: RunKind,
    default: str,
    kept: str,
    verb_of: Callable[[Study, RunAtWork], StudyVerb[Results]],
    *,
    use: Use | Literal["all"] = "all",
    check: Callable[[Study], object] = lambda study: None,
) -> int:
    """Run a verb on the motions of a `use` of its study: compute, write the folder, print; return the exit status.

    A `check` refuses the study before its laws are designed.
    """
    began = time.perf_counter()
    with progress_line(options, patience=_SOON) as line, keep_stdout():
        line(Progress(stage="reading", said=("reading the study and designing its laws",)))
        study = read_study(options.study, seed=options.seed, on_python=note)
    study = study if use == "all" else study.of_use(use)
    check(study)
    frame = Frame(options=options, work=work_of(options, kind, default), kept=kept)
    with frame.work as work:
        journal = work.journal()
        with progress_line(options, patience=_SOON) as line, keep_stdout():
            study = designed(study, journal=journal, on_progress=line)
        verb = verb_of(study, work)
        with keep_stdout(), on_workers(options):
            results, status = frame.compute(lambda line: verb.compute(journal, line), patience=_SOON)
        journal.close()
        frame.note_complete()
        assert results is not None  # an interrupted study has the runs so far
        written, interrupted, folder = frame.is_to_write(status), status == 130, frame.folder
        if written:
            assert study.origin.file is not None  # it was read from one
            manifest = {
                "kind": kind.kind,
                "title": results.title,
                "status": results.status,
                "command": command_line(),
                "seed": options.seed,
                "study": {"path": str(options.study), "content": digest_of(study.origin.file.text)},
                "versions": {"mrwork": __version__, "python": platform.python_version()},
                "created": datetime.now(UTC).isoformat(timespec="seconds"),
                "seconds": time.perf_counter() - began,
            }
            histories = history_names(len(results.rows), len(results.motions))
            work.commit(verb.files(results, study.origin.file), manifest, grown=(JOURNAL, *histories))
            # After Ctrl-C nothing that takes long: the page is drawn when the run is resumed.
            if not interrupted:
                status = renew_page(options, folder)
        if options.json:
            print_json(verb.document(results) | {"out": str(folder)})
        else:
            text = study_summary(results).text(whole=True, width=_WIDEST)
            if not written or (folder / REPORT).is_file():
                text = f"{text}\nReport: {folder / REPORT}"
            show(verb.text(results, text))
        if interrupted:
            frame.note_stop(written=written)
        return status


# Longest line of a table.
_WIDEST = 120


def design_lines(study: Study) -> list[str]:
    """Settings that were taken, designed weights and loops of a study: paragraphs that end with an empty line."""
    return [
        line
        for heading, sentences in study.design_notes
        for line in (heading, *(f"  {sentence}" for sentence in sentences), "")
    ]
