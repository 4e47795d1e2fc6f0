"""`mrwork respond`: a building with its dampers and control laws under ground motions, from a study file."""

from __future__ import annotations

import argparse
import json
import platform
import shlex
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mrwork import __version__
from mrwork.cli.identified import note
from mrwork.cli.options import add_json
from mrwork.cli.progress import StudyLine
from mrwork.errors import Interrupted, JournalError, MrworkError, OutputError, SettingError
from mrwork.store import digest_of

if TYPE_CHECKING:
    from mrwork.dampers.spec import DamperSpec
    from mrwork.store import Journal
    from mrwork.study.results import StudyResults
    from mrwork.study.stored_histories import Histories
    from mrwork.study.study import Study


def add_parser(verbs: Any) -> None:
    """Declare the verb."""
    parser = verbs.add_parser(
        "respond",
        description="Simulate a building with its dampers and control laws under ground motions, as a study file says.",
    )
    parser.add_argument("study", nargs="?", type=Path, metavar="STUDY.toml", help="what to simulate")
    parser.add_argument("--schema", action="store_true", help="print what a study file may say, and leave")
    parser.add_argument(
        "--laws", action="store_true", help="print the control laws and their settings, and leave"
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="seed of noise and synthetic motions, default 0"
    )
    parser.add_argument(
        "--check-step", action="store_true", help="run everything again with half the step, and compare"
    )
    parser.add_argument("--threads", type=int, default=0, metavar="N", help="threads, default all")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the results, default out/STUDY")
    parser.add_argument(
        "--resume",
        action="store_true",
        help="go on with a study that was killed or interrupted; all else as it was begun, but for --threads and "
        "--check-step",
    )
    parser.add_argument("--quiet", action="store_true", help="no progress")
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Simulate, write the folder, say what came out."""
    if options.schema or options.laws:
        print(_asked_for(options))
        return 0
    if options.study is None:
        raise SettingError("no study is given; give a STUDY.toml, or --schema to see what it may say")
    if options.seed < 0 or options.threads < 0:
        raise SettingError(
            f"--seed is {options.seed} and --threads {options.threads}; neither can be negative"
        )
    # SciPy and the simulation are slow to load.
    from mrwork.store.run_folder import check_destination
    from mrwork.store.unfinished import begin_journal, discard_journal, is_copy, resume_journal
    from mrwork.study.reading import read_study
    from mrwork.study.run import run_study
    from mrwork.study.stored_histories import Histories

    began = time.perf_counter()
    study = read_study(options.study, _identified, seed=options.seed)
    place = options.out or Path("out") / options.study.stem
    check_destination(place)
    journal = resume_journal(place, note=note) if options.resume else begin_journal(place)
    histories = Histories(place, study, resume=options.resume)
    line = StudyLine(quiet=options.quiet or options.json)
    status = 0
    try:
        results = run_study(
            study,
            journal=journal,
            kept=histories.kept,
            keep=histories.keep,
            on_progress=line,
            check_step=options.check_step,
            threads=options.threads,
        )
    except Interrupted as interrupt:
        results, status = interrupt.result, 130
    except MrworkError as error:
        hopeless = not options.resume and not isinstance(error, JournalError | OutputError)
        if hopeless or is_copy(place, journal):
            histories.discard()
            discard_journal(journal)
        raise
    finally:
        line.close()
        journal.close()
    seconds = time.perf_counter() - began
    _write(place, options, study, results, histories, journal, seconds)
    histories.discard()
    discard_journal(journal)
    print(_said(results, place, as_json=options.json))
    if status == 130:
        note(f"interrupted; the runs that are done are in {place}, the same with --resume goes on")
    return status


def _asked_for(options: argparse.Namespace) -> str:
    if options.schema:
        from mrwork.study.print_schema import schema_text

        return schema_text()
    from mrwork.study.print_schema import laws_text

    return laws_text()


def _identified(run: Path) -> tuple[DamperSpec, tuple[float, ...]]:
    from mrwork.identification.fit_file import read_fit

    fit = read_fit(run)
    return fit.spec, fit.theta


def _write(
    place: Path,
    options: argparse.Namespace,
    study: Study,
    results: StudyResults,
    histories: Histories,
    journal: Journal,
    seconds: float,
) -> None:
    from mrwork.report.study.page import study_page
    from mrwork.study.folder import write_study

    command = shlex.join(["mrwork", *sys.argv[1:]])
    manifest = {
        "kind": "study",
        "title": results.title,
        "status": "finished" if results.complete else "interrupted",
        "command": command,
        "seed": options.seed,
        "study": {
            "path": str(options.study),
            "content": digest_of(options.study.read_text(encoding="utf-8")),
        },
        "versions": {"mrwork": __version__, "python": platform.python_version()},
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "seconds": seconds,
    }
    page = study_page(
        results,
        histories.read,
        motion=study.detailed,
        drawn=study.drawn,
        status=("Runs", f"{results.done} of {results.wanted}", f"in {seconds:.3g} s"),
        command=command,
    )
    write_study(
        place,
        results,
        study_file=options.study,
        page=page,
        manifest=manifest,
        journal=journal.path,
        histories=histories,
    )


def _said(results: StudyResults, place: Path, *, as_json: bool) -> str:
    from mrwork.cli.respond_text import study_text
    from mrwork.study.folder import study_document

    if not as_json:
        return study_text(results, place)
    return json.dumps(study_document(results) | {"out": str(place)}, allow_nan=False, ensure_ascii=False)
