"""`mrwork respond`: response of a building with MR dampers to ground motions, as defined in a study file."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mrwork.cli.options import add_json, add_out, add_quiet, add_seed, add_threads
from mrwork.cli.output import drawn_page, print_json, stopped_in_words, undrawn_in_words
from mrwork.cli.paths import named_path
from mrwork.cli.progress import PATIENCE, ProgressLine, study_described
from mrwork.cli.study_text import command_line, study_manifest
from mrwork.cli.terminal import keep_stdout, note, show
from mrwork.errors import Interrupted, SettingError

if TYPE_CHECKING:
    from mrwork.store import Journal
    from mrwork.store.output_folder import Destination
    from mrwork.study.results import StudyResults
    from mrwork.study.stored_histories import Histories
    from mrwork.study.study import Study


def add_parser(verbs: Any) -> None:
    """Declare the verb."""
    parser = verbs.add_parser(
        "respond",
        description="Simulate a building with dampers and control laws under ground motions, as described in a study "
        "file.",
    )
    parser.add_argument("study", nargs="?", type=named_path, metavar="STUDY.toml", help="study file")
    parser.add_argument("--schema", action="store_true", help="print the keys of a study file and exit")
    parser.add_argument(
        "--laws", action="store_true", help="print the control laws with their settings and exit"
    )
    add_seed(parser, "noise and synthetic motions")
    parser.add_argument(
        "--motions",
        choices=("test", "training", "all"),
        default="test",
        help="use of the motions that are simulated, default test; with all, scores are those of the test motions",
    )
    parser.add_argument(
        "--check-step",
        action="store_true",
        help="repeat every run with half the integration step and compare",
    )
    add_threads(parser)
    add_out(parser, "folder of the results, default out/STUDY")
    parser.add_argument(
        "--resume",
        action="store_true",
        help="resume a study that was killed or interrupted; all other options but --threads and --check-step as in "
        "that study",
    )
    add_quiet(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Simulate, write the folder, print the result."""
    if options.schema or options.laws:
        if options.json:
            raise SettingError("--schema and --laws print text; leave --json out")
        show(_listing(options))
        return 0
    if options.study is None:
        raise SettingError("no study is given; give a STUDY.toml, or --schema to print its keys")
    # SciPy and the simulation are slow to load.
    from mrwork.store.output_folder import Destination, check_destination
    from mrwork.store.run_folder import STUDY_RUN
    from mrwork.store.unfinished import run_journal
    from mrwork.study.reading import read_study

    began = time.perf_counter()
    with keep_stdout():
        whole = read_study(options.study, seed=options.seed, on_python=note)
    study = whole if options.motions == "all" else whole.of_use(options.motions)
    place = options.out or Path("out") / options.study.stem
    destination = Destination.of(place, STUDY_RUN, replace=options.replace, resume=options.resume)
    check_destination(destination)
    with run_journal(destination, resume=options.resume, note=note) as journal:
        return _respond(study, destination, journal, options, began)


def _respond(
    study: Study, destination: Destination, journal: Journal, options: argparse.Namespace, began: float
) -> int:
    from mrwork.store.unfinished import discard_journal, is_complete
    from mrwork.study.run import run_study
    from mrwork.study.stored_histories import Histories

    place = destination.path
    histories = Histories(place, study, resume=options.resume)
    line = ProgressLine(study_described, quiet=options.quiet or options.json, patience=PATIENCE)
    status = 0
    try:
        with keep_stdout():
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
    finally:
        line.close()
        journal.finish()
    written, drawn = status == 0 or not is_complete(place), False
    if written:
        drawn = _write(destination, options, study, results, histories, journal, time.perf_counter() - began)
        discard_journal(journal)
    if options.json:
        from mrwork.study.folder import study_document

        notes = [{"controller": label, "notes": list(each)} for label, each in study.design_notes]
        document = study_document(results) | ({"weights": notes} if notes else {}) | {"out": str(place)}
        print_json(document)
    else:
        from mrwork.cli.study_text import study_text

        for label, each in study.design_notes:
            show("\n".join([f"Weights of {label}", *(f"  {sentence}" for sentence in each), ""]))
        show(study_text(results, place if drawn or not written else None))
    if status == 130:
        note(stopped_in_words(place, "what was simulated", written=written))
    elif not drawn:
        note(undrawn_in_words(place))
        status = 130
    return status


def _listing(options: argparse.Namespace) -> str:
    if options.schema:
        from mrwork.study.print_schema import schema_text

        return schema_text()
    from mrwork.study.print_schema import laws_text

    return laws_text()


def _write(
    destination: Destination,
    options: argparse.Namespace,
    study: Study,
    results: StudyResults,
    histories: Histories,
    journal: Journal,
    seconds: float,
) -> bool:
    """Write the folder; return whether its page was drawn."""
    from mrwork.store.run_folder import STUDY_RUN
    from mrwork.study.folder import write_study

    manifest = study_manifest(
        options,
        study.file,
        kind=STUDY_RUN.kind,
        title=results.title,
        status="finished" if results.complete else "interrupted",
        seconds=seconds,
    )

    def draw() -> str:
        # Matplotlib is slow to load.
        from mrwork.report.study.page import study_page

        return study_page(
            results,
            histories.read,
            motion=study.detailed,
            drawn=study.drawn,
            status=("Runs", f"{results.done} of {results.total}", f"in {seconds:.3g} s"),
            command=command_line(),
        )

    page = drawn_page(draw)
    write_study(
        destination,
        results,
        study_file=study.file,
        page=page,
        manifest=manifest,
        journal=journal.path,
        histories=histories,
    )
    return page is not None
