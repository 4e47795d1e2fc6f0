"""`mrwork sample`: draws from the posterior of the parameters of a fit."""

from __future__ import annotations

import argparse
from functools import partial
from typing import TYPE_CHECKING

from mrwork.base.numbers import duration_in_words
from mrwork.base.progress import Progress
from mrwork.cli.command_parser import COMPUTATION, OUTPUT, CommandParser, examples
from mrwork.cli.derived import add_option_of, add_options_of, arguments_of
from mrwork.cli.options import add_run, add_threads, end_parser
from mrwork.cli.output import end_addition, is_quiet, notes_on_verdicts, progress_line
from mrwork.cli.terminal import note
from mrwork.cli.tests import opened_run
from mrwork.errors import Interrupted
from mrwork.store.run_folder import CHAIN, DRAWS
from mrwork.store.run_writer import add_to_run, addition_journal, nothing_to_resume
from mrwork.uncertainty.noise import NOISES
from mrwork.uncertainty.posterior.sample import sample
from mrwork.uncertainty.posterior.target import PRIORS_IN_WORDS, prior_of_text

if TYPE_CHECKING:
    from mrwork.identification.fit_file import OpenedRun
    from mrwork.store.journal import Journal
    from mrwork.uncertainty.posterior.draws import Draws

# Seconds beyond which the time of all steps is told after the first ones.
_LONG = 600.0


def add_options(parser: CommandParser) -> None:
    """Declare the run, the noise and the priors of the posterior, and the chain."""
    parser.description = (
        "Sample the posterior of the parameters of a fit, given its tests. Writes the journal of the "
        f"chain, {CHAIN}, and the draws for ArviZ, {DRAWS}, into the run folder."
    )
    parser.epilog = examples(
        "mrwork sample out/demo --steps 200", "mrwork sample out/demo --steps 400 --resume"
    )
    add_run(parser)
    of_posterior = partial(add_option_of, parser, sample, "posterior")
    of_posterior("noise", more=" or ".join(NOISES))
    of_posterior(
        "priors",
        default={},
        reads=prior_of_text,
        metavar="NAME=KIND:A:B",
        more=f"{PRIORS_IN_WORDS}, as in k_w=normal:650:50",
    )
    of_posterior("tempering", metavar="SHARE")
    add_options_of(parser, sample, "chain", "walkers")
    add_option_of(parser, sample, "chain", "most_steps", "steps")
    add_options_of(parser, sample, COMPUTATION, "rng")
    add_threads(parser)
    parser.option(OUTPUT, "--replace", "begin a new chain in place of an unfinished one", bool)
    end_parser(parser, run, resume=f"continue {CHAIN}; only --steps and --threads may differ")


def run(options: argparse.Namespace) -> int:
    """Sample, write the draws, print the result."""
    from mrwork.runs.load import StoredRun, load

    opened, remarks = opened_run(options, "sample")
    path = opened.run.path
    with addition_journal(path, CHAIN, resume=options.resume, replace=options.replace, note=note) as journal:
        draws = _sample(opened, journal, options)
        if draws is None:
            return 130
        journal.close()
        if not journal.path.is_file():
            note(nothing_to_resume(options.run_folder / CHAIN))
        from mrwork.uncertainty.posterior.draws import draws_content

        add_to_run(path, {DRAWS: draws_content(draws)}, grown=[CHAIN])
        fit = load(path, StoredRun).fit
        below = [*notes_on_verdicts(fit, "posterior"), f"Draws: {path / DRAWS}"]
        return end_addition(options, draws, {"test_remarks": remarks, "out": str(path)}, below)


def _sample(opened: OpenedRun, journal: Journal, options: argparse.Namespace) -> Draws | None:
    """Sample with a progress line; return the draws, `None` after Ctrl-C."""
    told = False
    try:
        with progress_line(options) as line:

            def report(progress: Progress) -> None:
                nonlocal told
                if not told and progress.left is not None:
                    told = True
                    if progress.left > _LONG and not is_quiet(options):
                        note(
                            f"{options.steps:,} steps take about {duration_in_words(progress.left)}; the chain ends "
                            "sooner where it has converged, which its autocorrelation times tell, or at fewer --steps, "
                            "which --resume continues"
                        )
                line(progress)

            return sample(
                opened.fit,
                opened.tests,
                **arguments_of(options, sample),
                threads=options.threads,
                journal=journal,
                on_progress=report,
            )
    except Interrupted as interrupt:
        if interrupt.result is None:
            raise
        note(
            f"interrupted; {interrupt.result.n_steps} steps are kept in {journal.path}; "
            "run the same command with --resume to continue"
        )
        return None
