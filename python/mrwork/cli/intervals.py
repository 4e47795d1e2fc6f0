"""`mrwork intervals`: how well the tests of a fit determine its parameters, by profile likelihood or by draws."""

from __future__ import annotations

import argparse
from contextlib import suppress
from dataclasses import asdict, replace
from functools import partial
from typing import TYPE_CHECKING

from mrwork.base.numbers import duration_in_words
from mrwork.base.progress import Progress
from mrwork.cli.command_parser import COMPUTATION, OUTPUT, CommandParser, examples, given_options
from mrwork.cli.derived import add_option_of, add_options_of, arguments_of
from mrwork.cli.options import add_run, add_threads, end_parser
from mrwork.cli.output import end_addition, is_quiet, notes_on_verdicts, progress_line, show_results
from mrwork.cli.terminal import note
from mrwork.cli.tests import opened_run
from mrwork.errors import Interrupted, RecordError, SettingError
from mrwork.identification.fit_file import fit_content, manifest_of
from mrwork.store.codec import json_document
from mrwork.store.run_folder import CHAIN, DRAWS, FIT, PROFILES, REPORT, RunFolder
from mrwork.store.run_writer import add_to_run, adding, addition_journal, nothing_to_resume
from mrwork.uncertainty.identifiability.profile import Profiles, profile
from mrwork.uncertainty.noise import NOISES
from mrwork.uncertainty.posterior.sample import sample
from mrwork.uncertainty.posterior.target import PRIORS_IN_WORDS, prior_of_text

if TYPE_CHECKING:
    from mrwork.identification.fit_file import OpenedRun
    from mrwork.store.journal import Journal
    from mrwork.uncertainty.posterior.draws import Draws

# Seconds beyond which the time of all steps is told after the first ones.
_LONG = 600.0
_PROFILE, _POSTERIOR, _CHAIN = "profile likelihood", "posterior", "chain"
# Options that are of one of both ways alone, by their destinations.
_OF_PROFILES = ("parameters", "level")
_OF_DRAWS = ("noise", "priors", "tempering", "walkers", "most_steps", "rng", "replace", "resume")


def add_options(parser: CommandParser) -> None:
    """Declare the run, the profiled parameters with their level, and the noise, priors and chain of a posterior."""
    parser.describe(
        "By profile likelihood they may be open, and come with verdicts on identifiability and with directions in "
        "parameter space that do not change the force. With --posterior parameters are drawn from their "
        f"posterior: the journal of the chain, {CHAIN}, and the draws for ArviZ, {DRAWS}, are written into the run "
        "folder."
    )
    parser.epilog = examples(
        "mrwork intervals out/demo --parameter k_w --level 0.9",
        "mrwork intervals out/demo --posterior --steps 200",
        "mrwork intervals out/demo --posterior --steps 400 --resume",
    )
    add_run(parser)
    add_options_of(parser, profile, _PROFILE, "parameters", "level")
    parser.option(_POSTERIOR, "--posterior", "draw parameters from their posterior", bool)
    of_posterior = partial(add_option_of, parser, sample, _POSTERIOR)
    of_posterior("noise", more=" or ".join(NOISES))
    of_posterior(
        "priors",
        default={},
        reads=prior_of_text,
        metavar="NAME=KIND:A:B",
        more=f"{PRIORS_IN_WORDS}, as in k_w=normal:650:50",
    )
    of_posterior("tempering", metavar="SHARE")
    add_options_of(parser, sample, _CHAIN, "walkers")
    add_option_of(parser, sample, _CHAIN, "most_steps", "steps")
    add_options_of(parser, sample, COMPUTATION, "rng")
    add_threads(parser)
    parser.option(OUTPUT, "--replace", "begin a new chain in place of an unfinished one", bool)
    end_parser(parser, run, resume=f"continue {CHAIN}; only --steps and --threads may differ")


def run(options: argparse.Namespace) -> int:
    """Profile, or draw; write what was found into the run folder, and print it."""
    given = given_options(options)
    others = [given[name] for name in (_OF_PROFILES if options.posterior else _OF_DRAWS) if name in given]
    if others and options.posterior:
        raise SettingError(f"{others[0]} is of profile likelihoods; leave it out, or --posterior")
    if others:
        raise SettingError(
            f"{others[0]} is of draws from the posterior; give --posterior, too, or leave it out"
        )
    return _draw(options) if options.posterior else _profile(options)


def _profile(options: argparse.Namespace) -> int:
    """Profile, write the document and the figure into the run folder, print the table."""
    from mrwork.runs.load import StoredRun, load

    with adding(options.run_folder, PROFILES):
        opened, remarks = opened_run(options, "intervals")
        path = opened.run.path
        try:
            with progress_line(options) as line:
                profiles = profile(
                    opened.fit,
                    opened.tests,
                    threads=options.threads,
                    on_progress=line,
                    **arguments_of(options, profile),
                )
        except Interrupted as interrupt:
            return _write_interrupted(opened.run, interrupt.result, options)
        contents = {PROFILES: _content(profiles)}
        facts: dict[str, object] = {}
        if profiles.better is not None:
            contents[FIT] = fit_content(profiles.better)
            facts = manifest_of(profiles.better, profiles.better.status)
        add_to_run(path, contents, facts=facts)
        fit = load(path, StoredRun).fit
        more = {"directions": [asdict(direction) for direction in fit.informative], "test_remarks": remarks}
        below = [
            *(f"  {direction.sentence}" for direction in fit.informative),
            *notes_on_verdicts(fit, "profile"),
            f"Report: {path / REPORT}",
        ]
        return end_addition(options, profiles, more | {"out": str(path / PROFILES)}, below)


def _write_interrupted(run: RunFolder, profiles: Profiles, options: argparse.Namespace) -> int:
    """Write and print the profiles of an interrupted run, not in place of complete ones; return the exit status."""
    path, earlier = run.path / PROFILES, None
    # Damaged ones are none, as for a run to its end.
    with suppress(RecordError):
        earlier = run.read(Profiles, PROFILES, verb="intervals")
    written = earlier is None or earlier.status != "finished"
    if written:
        add_to_run(run.path, {PROFILES: _content(profiles)})
    show_results(options, profiles, document=profiles.document() | {"directions": [], "out": str(path)})
    where = "has the profiles so far" if written else "keeps the complete profiles that it has"
    note(f"interrupted; {path} {where}; run the same command again for all")
    return 130


def _content(profiles: Profiles) -> bytes:
    return json_document(replace(profiles, better=None)).encode()


def _draw(options: argparse.Namespace) -> int:
    """Sample, write the draws, print the result."""
    from mrwork.runs.load import StoredRun, load

    opened, remarks = opened_run(options, "intervals")
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
