"""`mrwork sample`: draws from the posterior of the parameters of a fit."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING

from mrwork.base.numbers import duration_in_words
from mrwork.cli.command_parser import OUTPUT, CommandParser, examples
from mrwork.cli.numbers import TEMPERING, Range, add_number
from mrwork.cli.options import add_repeated, add_run, add_seed, add_threads, end_parser, opened_run
from mrwork.cli.output import (
    end_addition,
    in_words,
    is_quiet,
    progress_line,
    told_findings,
    verdicts_elsewhere,
)
from mrwork.cli.terminal import note
from mrwork.errors import Interrupted
from mrwork.identification.fit_file import OpenedRun
from mrwork.store.run_folder import CHAIN, DRAWS
from mrwork.store.run_writer import add_to_run, addition_journal, nothing_to_resume
from mrwork.uncertainty.noise import NOISES, names_in_words
from mrwork.uncertainty.posterior.target import Prior, Steps, Walkers, parse_prior

if TYPE_CHECKING:
    from mrwork.store.journal import Journal
    from mrwork.uncertainty.posterior.draws import Draws
    from mrwork.uncertainty.posterior.sample import SamplingProgress

# Seconds beyond which the time of all steps is told after the first ones.
_LONG = 600.0


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
    parser.description = (
        "Sample the posterior of the parameters of a fit, given its tests. Writes the journal of the "
        f"chain, {CHAIN}, and the draws for ArviZ, {DRAWS}, into the run folder."
    )
    parser.epilog = examples(
        "mrwork sample out/demo --steps 200", "mrwork sample out/demo --steps 400 --resume"
    )
    add_run(parser)
    posterior, chain = parser.group("posterior"), parser.group("chain")
    posterior.add_argument(
        "--noise",
        default="iid",
        metavar="NAME",
        help=f"noise model of the force: {names_in_words(list(NOISES.values()))}; default iid",
    )
    add_repeated(
        posterior,
        "--prior",
        "NAME=KIND:A:B",
        "normal:MEAN:DEVIATION, lognormal:MEDIAN:DEVIATION_OF_LOG or uniform:LOWER:UPPER, as in "
        "k_w=normal:650:50; repeat for more. The default is uniform over the range of the parameter",
    )
    add_number(
        posterior,
        "--tempering",
        TEMPERING,
        "factor of the log-likelihood, or effective: the ratio of effective to all samples at the fit. Default "
        "effective, 1 for noise models with correlation",
        metavar="SHARE",
    )
    add_number(
        chain, "--walkers", Range.of(Walkers), "number of walkers, default 64", default=64, metavar="N"
    )
    add_number(
        chain,
        "--steps",
        Range.of(Steps),
        "largest number of steps, default 20000",
        default=20_000,
        metavar="N",
    )
    add_seed(parser, "the walkers")
    add_threads(parser)
    parser.group(OUTPUT).add_argument(
        "--replace", action="store_true", help="begin a new chain in place of an unfinished one"
    )
    end_parser(parser, run, resume=f"continue {CHAIN}; only --steps and --threads may differ")


def run(options: argparse.Namespace) -> int:
    """Sample, write the draws, print the result."""
    priors = dict(parse_prior(text) for text in options.prior)
    # SciPy is slow to load.
    from mrwork.runs.load import StoredRun, load

    opened = opened_run(options)
    findings = told_findings("sample", opened.tests, options)
    place = opened.run.path
    with addition_journal(place, CHAIN, resume=options.resume, replace=options.replace, note=note) as journal:
        draws = _sample(opened, priors, journal, options)
        if draws is None:
            return 130
        journal.close()
        if not journal.path.is_file():
            note(nothing_to_resume(options.run_folder / CHAIN))
        # ArviZ and HDF5 take seconds to load.
        from mrwork.uncertainty.posterior.draws import draws_content

        add_to_run(place, {DRAWS: draws_content(draws)}, grown=[CHAIN])
        fit = load(place, StoredRun).fit
        below = [*verdicts_elsewhere(fit, "posterior"), f"Draws: {place / DRAWS}"]
        return end_addition(options, draws, {"findings": findings, "out": str(place)}, below)


def _sample(
    opened: OpenedRun, priors: Mapping[str, Prior], journal: Journal, options: argparse.Namespace
) -> Draws | None:
    """Sample with a progress line; return the draws, `None` after Ctrl-C."""
    # emcee takes a second to load.
    from mrwork.uncertainty.posterior.sample import sample

    told: list[SamplingProgress] = []
    try:
        with progress_line(in_words, quiet=is_quiet(options)) as line:

            def report(progress: SamplingProgress) -> None:
                most = progress.most_seconds
                if not told and most is not None:
                    told.append(progress)
                    if most > _LONG and not is_quiet(options):
                        note(
                            f"{progress.most_steps:,} steps take about {duration_in_words(most)}; the chain ends "
                            "sooner where it has converged, which its autocorrelation times tell, or at fewer --steps, "
                            "which --resume continues"
                        )
                line(progress)

            return sample(
                opened.fit,
                opened.tests,
                noise=options.noise,
                priors=priors,
                tempering=options.tempering,
                walkers=options.walkers,
                most_steps=options.steps,
                rng=options.seed,
                threads=options.threads,
                journal=journal,
                on_progress=report,
            )
    except Interrupted as interrupt:
        note(
            f"interrupted; {interrupt.result.n_steps} steps are kept in {journal.path}; "
            "run the same command with --resume to continue"
        )
        return None
