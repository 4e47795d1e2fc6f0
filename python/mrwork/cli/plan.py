"""`mrwork plan`: rank possible next tests by the variance reduction of a band."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.derived import add_option_of, add_options_of, arguments_of
from mrwork.cli.number_texts import named_path
from mrwork.cli.options import add_run, add_threads, end_parser
from mrwork.cli.output import end_addition
from mrwork.cli.tests import opened_run
from mrwork.errors import SettingError
from mrwork.store.codec import json_document
from mrwork.store.run_folder import PLAN, REPORT
from mrwork.store.run_writer import add_to_run, adding
from mrwork.uncertainty.candidate_tests import Candidate, Limits, candidate_grid, read_candidates
from mrwork.uncertainty.planning import plan

if TYPE_CHECKING:
    from mrwork.identification.fit_file import OpenedRun


def add_options(parser: CommandParser) -> None:
    """Declare the run, the band to narrow, and the candidate tests with their limits."""
    parser.describe("The tests are sinusoids, and the band is that of a force that the fit predicts.")
    parser.epilog = examples(
        "mrwork plan out/demo",
        "mrwork plan out/rig --band k_w@1.2A --amplitudes 0.005,0.01 --frequencies 1,2 --currents 0.3,0.9",
    )
    add_run(parser)
    add_options_of(parser, plan, "band", "band")
    file = "CSV with the columns amplitude [m], frequency [Hz] and, with current laws, current"
    parser.option("candidates", "--candidates", file, named_path, metavar="FILE")
    add_options_of(parser, candidate_grid, "candidates", "amplitudes", "frequencies")
    add_option_of(parser, candidate_grid, "candidates", "commands", "currents")
    add_options_of(parser, Limits, "candidates", "stroke", "peak_velocity")
    file = (
        "CSV as in --candidates with the excitations for which the band is computed; default: the candidates"
    )
    parser.option("band", "--targets", file, named_path, metavar="FILE")
    add_threads(parser)
    end_parser(parser, run, quiet="no note on candidates that could not be simulated")


def run(options: argparse.Namespace) -> int:
    """Rank the candidates, write and print."""
    with adding(options.run_folder, PLAN):
        opened, remarks = opened_run(options, "plan")
        spec = opened.fit.spec
        limits = Limits(**arguments_of(options, Limits))
        candidates = _candidates(options, opened, limits)
        targets = () if options.targets is None else read_candidates(options.targets, spec, limits=None)
        ranked = plan(
            opened.fit,
            opened.tests,
            candidates,
            targets=targets,
            threads=options.threads,
            **arguments_of(options, plan),
        )
        path, document = opened.run.path, {"limits": asdict(limits)}
        add_to_run(path, {PLAN: json_document(ranked.document() | document).encode()})
        more = document | {"test_remarks": remarks, "out": str(path / PLAN)}
        return end_addition(options, ranked, more, [f"Report: {path / REPORT}"])


def _candidates(options: argparse.Namespace, opened: OpenedRun, limits: Limits) -> tuple[Candidate, ...]:
    kwargs = arguments_of(options, candidate_grid)
    if options.candidates is None:
        return candidate_grid(opened.fit.spec, opened.tests, **kwargs, limits=limits)
    if any(kwargs.values()):
        raise SettingError(
            "--candidates comes with --amplitudes, --frequencies or --currents; give one or the other"
        )
    return read_candidates(options.candidates, opened.fit.spec, limits)
