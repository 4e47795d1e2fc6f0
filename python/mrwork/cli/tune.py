"""`mrwork tune`: settings of control laws, tuned on the training motions of a study and judged on its test motions."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mrwork.cli.options import add_json, add_out, add_quiet, add_seed, add_threads
from mrwork.cli.output import (
    drawn_page,
    print_json,
    stopped_in_words,
    table_lines,
    undrawn_in_words,
)
from mrwork.cli.paths import named_path
from mrwork.cli.progress import PATIENCE, ProgressLine, tuning_described
from mrwork.cli.study_text import command_line, study_manifest
from mrwork.cli.terminal import keep_stdout, note, show
from mrwork.errors import Interrupted
from mrwork.summary import with_decimals

if TYPE_CHECKING:
    from mrwork.store import Journal
    from mrwork.store.output_folder import Destination
    from mrwork.study.schema import TuneTable
    from mrwork.study.study import Study
    from mrwork.tuning.results import LawResult, TuningResults

_QUICK = (48, 12)


def add_parser(verbs: Any) -> None:
    """Declare the verb."""
    parser = verbs.add_parser(
        "tune",
        description="Tune the settings of the laws in the [[tune]] tables of a study file on its training motions, and "
        "judge them on its test motions, beside i = 0, the best constant and the largest command and equal drift "
        "weights. The folder has the chosen settings as a study file for mrwork respond. mrwork respond --schema "
        "prints the keys of [[tune]].",
    )
    parser.add_argument("study", type=named_path, metavar="STUDY.toml", help="study file")
    parser.add_argument(
        "--law",
        action="append",
        default=[],
        metavar="NAME",
        help="tune this law with all keys of [[tune]] at their defaults, instead of the tables of the study; repeat "
        "for more",
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help=f"at most {_QUICK[0]} candidates of each law in generations of {_QUICK[1]}: a first look, not a result",
    )
    add_seed(parser, "the searches, of noise and synthetic motions")
    add_threads(parser)
    add_out(parser, "folder of the results, default out/STUDY-tuned")
    parser.add_argument(
        "--resume",
        action="store_true",
        help="resume a tuning that was killed or interrupted; all other options but --threads as in that tuning",
    )
    add_quiet(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Tune, write the folder, print the result."""
    # SciPy and the simulation are slow to load.
    from mrwork.store.output_folder import Destination, check_destination
    from mrwork.store.run_folder import TUNING_RUN
    from mrwork.store.unfinished import run_journal
    from mrwork.study.reading import read_study

    began = time.perf_counter()
    with keep_stdout():
        study = read_study(options.study, seed=options.seed, on_python=note)
    tables = _tables(study, options)
    place = options.out or Path("out") / f"{options.study.stem}-tuned"
    destination = Destination.of(place, TUNING_RUN, replace=options.replace, resume=options.resume)
    check_destination(destination)
    with run_journal(destination, resume=options.resume, note=note) as journal:
        return _tune(study, tables, destination, journal, options, began)


def _tune(
    study: Study,
    tables: tuple[TuneTable, ...],
    destination: Destination,
    journal: Journal,
    options: argparse.Namespace,
    began: float,
) -> int:
    from mrwork.store.unfinished import discard_journal, is_complete
    from mrwork.tuning.results import tuning_document
    from mrwork.tuning.run import tune

    line = ProgressLine(tuning_described, quiet=options.quiet or options.json, patience=PATIENCE)
    status = 0
    try:
        results = tune(
            study, tables, rng=options.seed, journal=journal, threads=options.threads, on_progress=line
        )
    except Interrupted as interrupt:
        results, status = interrupt.result, 130
    finally:
        line.close()
        journal.finish()
    place = destination.path
    written, drawn = status == 0 or not is_complete(place), False
    if written:
        drawn = _write(destination, options, study, results, journal, time.perf_counter() - began)
        discard_journal(journal)
    if options.json:
        document = tuning_document(results) | {"out": str(place)}
        print_json(document)
    else:
        show(_text(results, place, drawn=drawn))
    if status == 130:
        note(stopped_in_words(place, "what was found", written=written))
    elif not drawn:
        note(undrawn_in_words(place))
        status = 130
    return status


def _tables(study: Study, options: argparse.Namespace) -> tuple[TuneTable, ...]:
    """The tables of the command line or of the study; smaller ones for a quick look."""
    from mrwork.study.schema import TuneTable

    tables = (TuneTable(laws=tuple(options.law)),) if options.law else study.tunes
    if not options.quick:
        return tables
    budget, population = _QUICK
    return tuple(
        replace(each, budget=min(each.budget, budget), population=min(each.population, population))
        for each in tables
    )


def _write(
    destination: Destination,
    options: argparse.Namespace,
    study: Study,
    results: TuningResults,
    journal: Journal,
    seconds: float,
) -> bool:
    """Write the folder; return whether it has a page."""
    from mrwork.store.run_folder import TUNING_RUN
    from mrwork.tuning.results import write_tuning

    manifest = study_manifest(
        options, study.file, kind=TUNING_RUN.kind, title=results.title, status=results.status, seconds=seconds
    )
    page = None
    # After Ctrl-C nothing that takes long: the figures are drawn when the tuning is resumed.
    if results.status == "finished":

        def draw() -> str:
            # Matplotlib is slow to load.
            from mrwork.report.tuning.page import tuning_page

            return tuning_page(results, command=command_line())

        page = drawn_page(draw)
    write_tuning(
        destination, results, study_file=study.file, page=page, manifest=manifest, journal=journal.path
    )
    return page is not None


def _text(results: TuningResults, place: Path, *, drawn: bool) -> str:
    """Scores on training and test motions, the settings, warnings, and where everything is."""
    from mrwork.store.run_folder import CHOSEN
    from mrwork.tuning.results import settings_in_words

    head = ("", "training", "test", "drift", "acc.", "better", "settings")
    rows = [_row(each, settings_in_words(each.settings, results.command_unit)) for each in results.ranked]
    lines = [
        results.title,
        "",
        f"Scores over i = 0 on {len(results.training)} training and {len(results.testing)} test motions, lowest first;",
        "drift, acc.: mean ratios of the peaks; better: motions with both peaks below the best constant command",
        *table_lines([head, *rows]),
        "",
    ]
    lines += [f"{each.label}: {each.certificate or 'no certificate'}" for each in results.laws]
    lines += ["", *(f"warning: {each}" for each in results.warnings)]
    lines.append(
        f"{results.candidates_per_second:.3g} candidates/s, "
        f"{results.share_outside:.0%} of the time outside the simulation"
    )
    lines.append(f"Settings for mrwork respond: {place / CHOSEN}")
    if drawn:
        lines.append(f"Report: {place / 'report.html'}")
    return "\n".join(lines)


def _row(law: LawResult, settings: str) -> tuple[str, ...]:
    found = law.train if law.test is None else law.test
    better = "" if law.better is None else f"{law.better.both} of {law.better.motions}"
    nan = float("nan")
    return (
        law.label,
        with_decimals(law.train.score, 3),
        "-" if law.test is None else with_decimals(law.test.score, 3),
        with_decimals(found.criteria.get("peak_drift", nan), 3),
        with_decimals(found.criteria.get("peak_acceleration", nan), 3),
        better,
        settings,
    )
