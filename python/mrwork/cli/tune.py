"""`mrwork tune`: settings of control laws, or numbers of dampers, by the motions of a study."""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from mrwork.cli.command_parser import SEARCH, CommandParser, examples, given_options
from mrwork.cli.derived import add_option_of
from mrwork.cli.number_texts import named_path
from mrwork.cli.options import add_seed, add_threads, end_parser
from mrwork.cli.output import check_figure, progress_line, show_results, write_figure
from mrwork.cli.terminal import note
from mrwork.errors import Interrupted, SettingError
from mrwork.store.run_folder import CHOSEN, TUNING_RUN
from mrwork.study.run_options import TunedLaws

if TYPE_CHECKING:
    from mrwork.base.progress import ProgressLine
    from mrwork.cli.study_text import StudyVerb
    from mrwork.store.journal import Journal
    from mrwork.store.run_writer import RunAtWork
    from mrwork.study.schema import TuneTable
    from mrwork.study.study import Study
    from mrwork.tuning.judging import TunedStudy

_QUICK = (48, 12)
_SIZE = "numbers of dampers"


def add_options(parser: CommandParser) -> None:
    """Declare the study, the laws to tune, and the effort of the searches."""
    parser.describe(
        "The laws are those of the [[tune]] tables of a study file; the study is run with them on all its "
        "motions, beside i = 0, the best constant and the largest command and equal drift weights. With [places], "
        "the storeys of its dampers are compared first, each placement with its best constant command. The folder "
        "has the chosen settings as a study file for mrwork respond. mrwork help study prints the keys of "
        "[[tune]]. With --size the least dampers that keep the limit of the study are found in place of that."
    )
    parser.epilog = examples(
        "mrwork tune study.toml --quick", "mrwork tune study.toml --law lyapunov --quick --out out/lyapunov"
    )
    parser.add_argument("study", type=named_path, metavar="STUDY.toml", help="study file")
    add_option_of(parser, TunedLaws, SEARCH, "laws", default=())
    quick = f"at most {_QUICK[0]} candidates of each law in generations of {_QUICK[1]}: a first look, not a result"
    parser.option(SEARCH, "--quick", quick, bool)
    parser.option(
        _SIZE,
        "--size",
        "find the least dampers that keep the limit of the study, report.limit or drift_limit of its building, on its "
        "test motions: with count as many in each [[damper]], or of the viscous or tuned_mass of a [[baseline]], with "
        "storey a count of each; print them and exit",
        choices=("count", "storey"),
    )
    figure = "with --size, draw the criterion over the number of dampers, as an .svg or a .png file"
    parser.option(_SIZE, "--figure", figure, named_path, metavar="FILE")
    parser.option(
        _SIZE,
        "--motions",
        "with --size, use of the motions under which the limit is kept, default test",
        choices=("test", "training", "all"),
        default="test",
    )
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
    """Tune, write the folder, print the result; or print numbers of dampers."""
    if options.size is not None:
        return _find_counts(options)
    if others := [given for name, given in given_options(options).items() if name in ("figure", "motions")]:
        raise SettingError(f"{others[0]} is of --size; leave it out, or give --size count")
    from mrwork.cli.study_text import run_on_study
    from mrwork.tuning.tuning_run import check_tables, tables_of

    def check(study: Study) -> None:
        check_tables(study, tables_of(study, _tables(study, options)))

    default, verb_of = f"{options.study.stem}-tuned", partial(_verb, options)
    return run_on_study(options, TUNING_RUN, default, "what was found", verb_of, check=check)


def _verb(options: argparse.Namespace, study: Study, work: RunAtWork) -> StudyVerb[TunedStudy]:
    """The tuning of the tables of a study, or of the command line, and the study that judges it."""
    from mrwork.cli.study_text import StudyVerb, design_lines
    from mrwork.study.histories import Histories
    from mrwork.study.running import unrun
    from mrwork.study.study_folder import design_document
    from mrwork.tuning.judging import judge, with_tuned_rows, with_tuning
    from mrwork.tuning.tuning_folder import tuning_document, tuning_files
    from mrwork.tuning.tuning_run import tune

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


def _find_counts(options: argparse.Namespace) -> int:
    """Find the least dampers, print them, and draw their figure if requested."""
    of_tuning = {"laws", "quick", "out", "resume", "replace", "workers", "cluster"}
    if others := [given for name, given in given_options(options).items() if name in of_tuning]:
        raise SettingError(f"{others[0]} is of a tuning, and --size writes no folder; leave one of both out")
    if options.figure is not None:
        check_figure(options.figure)
    from mrwork.runs.read_study import read_study
    from mrwork.study.least_counts import damper_counts

    study = read_study(options.study, seed=options.seed, on_python=note)
    study = study if options.motions == "all" else study.of_use(options.motions)
    with progress_line(options) as line:
        counts = damper_counts(
            study,
            by="uniform" if options.size == "count" else "storey",
            on_progress=line,
            threads=options.threads,
        )
    drawn: dict[str, str] = {}
    if options.figure is not None:
        drawn = {"figure": str(options.figure)}
        from mrwork.plots import style
        from mrwork.plots.canvas import column_axes
        from mrwork.plots.of_studies import damper_counts as figure_of

        with style.drawn_in_style():
            figure, axes = column_axes()
            figure_of(counts, axes)
        write_figure(options.figure, figure)
    below = [f"Figure: {path}" for path in drawn.values()]
    show_results(options, counts, document=counts.document() | drawn, below=below)
    return 0


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
