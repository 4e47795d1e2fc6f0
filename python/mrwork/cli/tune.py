"""`mrwork tune`: settings of control laws, tuned on the training motions of a study and judged on its test motions."""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from mrwork.cli.command_parser import SEARCH, CommandParser, examples
from mrwork.cli.derived import add_option_of
from mrwork.cli.numbers import named_path
from mrwork.cli.options import add_seed, add_threads, end_parser
from mrwork.errors import Interrupted
from mrwork.store.run_folder import CHOSEN, TUNING_RUN
from mrwork.study.options import TunedLaws

if TYPE_CHECKING:
    from mrwork.base.progress import ProgressLine
    from mrwork.cli.study_text import StudyVerb
    from mrwork.store.journal import Journal
    from mrwork.store.run_writer import RunAtWork
    from mrwork.study.schema import TuneTable
    from mrwork.study.study import Study
    from mrwork.tuning.judging import TunedStudy

_QUICK = (48, 12)


def add_options(parser: CommandParser) -> None:
    """Declare the study, the laws to tune, and the effort of the searches."""
    parser.description = (
        "Tune the settings of the laws in the [[tune]] tables of a study file on its training motions, and run the "
        "study with them on all its motions, beside i = 0, the best constant and the largest command and equal drift "
        "weights. With [places], the storeys of its dampers are compared first, each placement with its best constant "
        "command. The folder has the chosen settings as a study file for mrwork respond. mrwork respond --schema "
        "prints the keys of [[tune]]."
    )
    parser.epilog = examples(
        "mrwork tune study.toml --quick", "mrwork tune study.toml --law lyapunov --quick --out out/lyapunov"
    )
    parser.add_argument("study", type=named_path, metavar="STUDY.toml", help="study file")
    add_option_of(parser, TunedLaws, SEARCH, "laws", default=())
    quick = f"at most {_QUICK[0]} candidates of each law in generations of {_QUICK[1]}: a first look, not a result"
    parser.option(SEARCH, "--quick", quick, bool)
    add_seed(parser, "also of the searches")
    add_threads(parser, "the runs without histories")
    end_parser(
        parser,
        run,
        out="folder of the results, default out/STUDY-tuned",
        resume="resume a tuning that was killed or interrupted; all other options as in that tuning, but "
        "--threads, --workers and --cluster",
    )


def run(options: argparse.Namespace) -> int:
    """Tune, write the folder, print the result."""
    from mrwork.cli.study_text import run_on_study
    from mrwork.tuning.run import check_tables, tables_of

    def check(study: Study) -> None:
        check_tables(study, tables_of(study, _tables(study, options)))

    default, verb_of = f"{options.study.stem}-tuned", partial(_verb, options)
    return run_on_study(options, TUNING_RUN, default, "what was found", verb_of, check=check)


def _verb(options: argparse.Namespace, study: Study, work: RunAtWork) -> StudyVerb[TunedStudy]:
    """The tuning of the tables of a study, or of the command line, and the study that judges it."""
    from mrwork.cli.study_text import StudyVerb, design_lines
    from mrwork.study.folder import design_document
    from mrwork.study.histories import Histories
    from mrwork.study.run import unrun
    from mrwork.tuning.folder import tuning_document, tuning_files
    from mrwork.tuning.judging import judge, with_tuned_rows, with_tuning
    from mrwork.tuning.run import tune

    tables, wider = _tables(study, options), study

    def compute(journal: Journal, line: ProgressLine) -> TunedStudy:
        nonlocal wider
        try:
            tuned = tune(
                study, tables, rng=options.seed, journal=journal, threads=options.threads, on_progress=line
            )
        except Interrupted as interrupt:
            raise Interrupted(with_tuning(unrun(study), interrupt.result), "tuning") from None
        # Histories are named by the rows.
        wider = with_tuned_rows(study, tuned)
        stored = Histories(work, wider)
        return judge(
            wider,
            tuned,
            journal=journal,
            kept=stored.is_stored,
            keep=stored.keep,
            on_progress=line,
            threads=options.threads,
        )

    def text(results: TunedStudy, judged: str) -> str:
        summary = results.tuned._found().text(whole=True)
        settings = f"Settings for mrwork respond: {work.path / CHOSEN}"
        return "\n".join([summary, "", *design_lines(wider), judged, settings])

    return StudyVerb(
        compute=compute,
        files=tuning_files,
        document=lambda results: tuning_document(results) | design_document(wider),
        text=text,
    )


def _tables(study: Study, options: argparse.Namespace) -> tuple[TuneTable, ...]:
    """The tables of the command line or of the study; smaller ones for a quick look."""
    from mrwork.study.schema import TuneTable

    tables = (TuneTable(laws=options.laws),) if options.laws else study.tunes
    if not options.quick:
        return tables
    budget, population = _QUICK
    return tuple(
        replace(table, budget=min(table.budget, budget), population=min(table.population, population))
        for table in tables
    )
