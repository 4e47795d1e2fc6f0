"""`mrwork tune`: settings of control laws, tuned on the training motions of a study and judged on its test motions."""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mrwork.base.numbers import with_decimals
from mrwork.cli.command_parser import SEARCH, CommandParser, examples
from mrwork.cli.numbers import named_path
from mrwork.cli.options import add_out, add_repeated, add_seed, add_threads, end_parser
from mrwork.cli.output import table_lines
from mrwork.cli.own_models import add_trust
from mrwork.cli.workers import add_workers
from mrwork.store.run_folder import CHOSEN, REPORT, TUNING_RUN

if TYPE_CHECKING:
    from mrwork.base.progress import ProgressLine
    from mrwork.cli.study_text import StudyVerb
    from mrwork.store.journal import Journal
    from mrwork.store.run_writer import RunAtWork
    from mrwork.study.schema import TuneTable
    from mrwork.study.study import Study
    from mrwork.tuning.results import TuningResults

_QUICK = (48, 12)


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
    parser.description = (
        "Tune the settings of the laws in the [[tune]] tables of a study file on its training motions, and "
        "judge them on its test motions, beside i = 0, the best constant and the largest command and equal drift "
        "weights. With [places], the storeys of its dampers are compared first, each placement with its best constant "
        "command. The folder has the chosen settings as a study file for mrwork respond. mrwork respond --schema "
        "prints the keys of [[tune]]."
    )
    parser.epilog = examples(
        "mrwork tune study.toml --quick", "mrwork tune study.toml --law lyapunov --quick --out out/lyapunov"
    )
    parser.add_argument("study", type=named_path, metavar="STUDY.toml", help="study file")
    search = parser.group(SEARCH)
    add_repeated(
        search,
        "--law",
        "NAME",
        "tune this law with all keys of [[tune]] at their defaults, instead of the tables of the study; repeat "
        "for more",
    )
    search.add_argument(
        "--quick",
        action="store_true",
        help=f"at most {_QUICK[0]} candidates of each law in generations of {_QUICK[1]}: a first look, not a result",
    )
    add_seed(parser, "the searches, of noise and synthetic motions")
    add_threads(parser)
    add_workers(parser, "the runs without histories")
    add_trust(parser)
    add_out(parser, "folder of the results, default out/STUDY-tuned")
    end_parser(
        parser,
        run,
        resume="resume a tuning that was killed or interrupted; all other options as in that tuning, but "
        "--threads, --workers and --cluster",
    )


def run(options: argparse.Namespace) -> int:
    """Tune, write the folder, print the result."""
    # Results and simulation are slow to load.
    from mrwork.cli.study_text import run_on_study

    default = f"{options.study.stem}-tuned"
    return run_on_study(options, TUNING_RUN, default, "what was found", partial(_verb, options))


def _verb(options: argparse.Namespace, study: Study, work: RunAtWork) -> StudyVerb[TuningResults]:
    """The tuning of the tables of a study, or of the command line."""
    from mrwork.cli.study_text import StudyVerb
    from mrwork.tuning.results import tuning_document, write_tuning

    tables, place = _tables(study, options), work.destination.path

    def compute(journal: Journal, line: ProgressLine[Any]) -> TuningResults:
        from mrwork.tuning.run import tune

        return tune(
            study, tables, rng=options.seed, journal=journal, threads=options.threads, on_progress=line
        )

    return StudyVerb(
        compute=compute,
        write=write_tuning,
        document=tuning_document,
        text=lambda results, drawn, _: _text(results, place, drawn=drawn),
    )


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


def _text(results: TuningResults, place: Path, *, drawn: bool) -> str:
    """Scores on training and test motions, the settings, warnings, and where everything is."""
    from mrwork.tuning.results import motions_in_words, places_table, settings_in_words, speed_in_words

    head = ("", "training", "test", "drift", "acc.", "better", "settings")
    rows = [
        (
            each.label,
            with_decimals(each.train.score, 3),
            "-" if each.test is None else with_decimals(each.test.score, 3),
            *(
                with_decimals(each.judged.criteria.get(f"peak_{name}", nan), 3)
                for name in ("drift", "acceleration")
            ),
            "" if each.better is None else each.better.in_words,
            settings_in_words(each.settings, results.command_unit),
        )
        for each in results.ranked
    ]
    lines = [
        results.title,
        "",
        *([] if (places := places_table(results)) is None else [places.title, *places.lines("  "), ""]),
        f"Scores over i = 0 on {motions_in_words(results)}, lowest first;",
        "drift, acc.: mean ratios of the peaks; better: motions with both peaks below the best constant command",
        *table_lines([head, *rows]),
        "",
    ]
    lines += [f"{each.label}: {each.certificate or 'no certificate'}" for each in results.laws]
    for labels, sentences in results.designs:
        lines += ["", f"Weights of {', '.join(labels)}", *(f"  {sentence}" for sentence in sentences)]
    for each in results.laws:
        if each.design.loop:
            lines += ["", f"Loop of {each.label}", *(f"  {sentence}" for sentence in each.design.loop)]
    lines += ["", *results.findings] if results.findings else []
    lines += ["", *(f"warning: {each}" for each in results.warnings)]
    lines.append(speed_in_words(results))
    lines.append(f"Settings for mrwork respond: {place / CHOSEN}")
    if drawn:
        lines.append(f"Report: {place / REPORT}")
    return "\n".join(lines)
