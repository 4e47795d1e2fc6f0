"""`mrwork profile`: intervals of the parameters of a fit by profile likelihood."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.numbers import SHARE, add_number
from mrwork.cli.options import add_repeated, add_run, add_threads, end_parser, opened_run
from mrwork.cli.output import (
    end_addition,
    in_words,
    is_quiet,
    print_result,
    progress_line,
    result_lines,
    told_findings,
    verdicts_elsewhere,
)
from mrwork.cli.terminal import note
from mrwork.errors import Interrupted, RecordError
from mrwork.identification.fit import Direction, Fit
from mrwork.identification.fit_file import OpenedRun, fit_content
from mrwork.store.codec import json_document
from mrwork.store.run_folder import FIT, PROFILES, REPORT
from mrwork.store.run_writer import add_to_run, adding

if TYPE_CHECKING:
    from mrwork.uncertainty.identifiability.profile import Profiles


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
    parser.description = (
        "Compute the profile likelihood of each parameter of a fit: intervals, which may be open, "
        "verdicts on identifiability, and directions in parameter space that do not change the force."
    )
    parser.epilog = examples("mrwork profile out/demo", "mrwork profile out/demo --parameter k_w --level 0.9")
    add_run(parser)
    intervals = parser.group("intervals")
    add_repeated(
        intervals, "--parameter", "NAME", "profile this parameter only; repeat for more", dest="parameters"
    )
    add_number(intervals, "--level", SHARE, "level of the intervals, default 0.95", default=0.95, metavar="P")
    add_threads(parser)
    end_parser(parser, run)


def run(options: argparse.Namespace) -> int:
    """Profile, write the document and the figure into the run folder, print the table."""
    with adding(options.run_folder, PROFILES):
        return _profile(opened_run(options), options)


def _profile(opened: OpenedRun, options: argparse.Namespace) -> int:
    # SciPy's optimisers are slow to load, and the help does not need them.
    from mrwork.runs.load import judged_by_additions
    from mrwork.uncertainty.identifiability.profile import profile
    from mrwork.uncertainty.identifiability.verdicts import identifiability_of
    from mrwork.uncertainty.posterior.draws import read_draws

    findings = told_findings("profile", opened.tests, options)
    # The file of the fit has the intervals of the draws: damaged ones are refused before the profiles are computed.
    draws = read_draws(opened.run, opened.fit)
    try:
        with progress_line(in_words, quiet=is_quiet(options)) as line:
            profiles = profile(
                opened.fit,
                opened.tests,
                parameters=options.parameters,
                level=options.level,
                threads=options.threads,
                on_progress=line,
            )
    except Interrupted as interrupt:
        return write_interrupted(opened, interrupt.result, options)
    fit = opened.fit.with_identifiability(
        identifiability_of(opened.fit, opened.tests, threads=options.threads)
    )
    fit = judged_by_additions(opened.run.path, fit, draws=draws, profiles=profiles)
    directions = () if fit.identifiability is None else fit.identifiability.informative
    document = asdict(profiles) | {"directions": [asdict(each) for each in directions]}
    contents = {PROFILES: json_document(document).encode(), FIT: fit_content(fit)}
    add_to_run(opened.run.path, contents)
    printed = document | {"findings": findings, "out": str(opened.run.path / PROFILES)}
    return end_addition(options, printed, _text(fit, profiles, directions, opened.run.path))


def write_interrupted(opened: OpenedRun, profiles: Profiles, options: argparse.Namespace) -> int:
    """Write and print the profiles of an interrupted run, not in place of complete ones; return the exit status."""
    document = asdict(profiles) | {"directions": []}
    written = not _has_complete(opened)
    if written:
        add_to_run(opened.run.path, {PROFILES: json_document(document).encode()})
    printed = document | {"out": str(opened.run.path / PROFILES)}
    print_result(options, printed, _text(opened.fit, profiles, (), opened.run.path))
    where = "has the profiles so far" if written else "keeps the complete profiles that it has"
    note(f"interrupted; {opened.run.path / PROFILES} {where}; run the same command again for all")
    return 130


def _has_complete(opened: OpenedRun) -> bool:
    """Whether the run has profiles of its fit that are complete; damaged ones are none, as for a run to its end."""
    from mrwork.runs.load import read_profiles

    try:
        earlier = read_profiles(opened.run)
    except RecordError:
        return False
    return earlier is not None and earlier.status == "finished"


def _text(fit: Fit, profiles: Profiles, directions: Sequence[Direction], place: Path) -> str:
    share = 100.0 * profiles.level
    form = "" if profiles.model == fit.model else f", in the form {profiles.model}"
    lines = [
        f"{share:g} % intervals by profile likelihood{form}; {profiles.n_time} samples with correlated residuals "
        f"count as {profiles.n_effective:.0f}",
        "",
        *result_lines(profiles),
        "",
    ]
    sentences = [
        *(each.sentence for each in directions),
        *filter(None, [profiles.remark, verdicts_elsewhere(fit, "profile")]),
    ]
    if sentences:
        lines += [*(f"- {sentence}" for sentence in sentences), ""]
    lines += [f"{profiles.evaluations} simulations, {profiles.seconds:.1f} s. Report: {place / REPORT}"]
    return "\n".join(lines)
