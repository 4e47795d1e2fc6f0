"""`mrwork profile`: intervals of the parameters of a fit by profile likelihood."""

from __future__ import annotations

import argparse
from contextlib import suppress
from dataclasses import asdict, replace

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.derived import add_options_of, arguments_of
from mrwork.cli.options import add_run, add_threads, end_parser
from mrwork.cli.output import end_addition, notes_on_verdicts, progress_line, show_results
from mrwork.cli.terminal import note
from mrwork.cli.tests import opened_run
from mrwork.errors import Interrupted, RecordError
from mrwork.identification.fit_file import fit_content, manifest_of
from mrwork.store.codec import json_document
from mrwork.store.run_folder import FIT, PROFILES, REPORT, RunFolder
from mrwork.store.run_writer import add_to_run, adding
from mrwork.uncertainty.identifiability.profile import Profiles, profile


def add_options(parser: CommandParser) -> None:
    """Declare the run, the profiled parameters, and the level of their intervals."""
    parser.description = (
        "Compute the profile likelihood of each parameter of a fit: intervals, which may be open, "
        "verdicts on identifiability, and directions in parameter space that do not change the force."
    )
    parser.epilog = examples("mrwork profile out/demo", "mrwork profile out/demo --parameter k_w --level 0.9")
    add_run(parser)
    add_options_of(parser, profile, "intervals", "parameters", "level")
    add_threads(parser)
    end_parser(parser, run)


def run(options: argparse.Namespace) -> int:
    """Profile, write the document and the figure into the run folder, print the table."""
    from mrwork.runs.load import StoredRun, load

    with adding(options.run_folder, PROFILES):
        opened, remarks = opened_run(options, "profile")
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
        earlier = run.read(Profiles, PROFILES, verb="profile")
    written = earlier is None or earlier.status != "finished"
    if written:
        add_to_run(run.path, {PROFILES: _content(profiles)})
    show_results(options, profiles, document=profiles.document() | {"directions": [], "out": str(path)})
    where = "has the profiles so far" if written else "keeps the complete profiles that it has"
    note(f"interrupted; {path} {where}; run the same command again for all")
    return 130


def _content(profiles: Profiles) -> bytes:
    return json_document(replace(profiles, better=None)).encode()
