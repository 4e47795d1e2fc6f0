"""`mrwork plan`: rank possible next tests by the variance reduction of a band."""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import numpy as np

from mrwork.base.values import Floats
from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.numbers import AMPLITUDES, COMMANDS, FREQUENCIES, STROKE, VELOCITY, add_number, named_path
from mrwork.cli.options import add_run, add_seed, add_threads, end_parser, opened_run
from mrwork.cli.output import end_addition, told_findings
from mrwork.cli.terminal import note
from mrwork.errors import SettingError
from mrwork.identification.equivalent import identifiable_form
from mrwork.identification.fit_file import OpenedRun
from mrwork.store.codec import json_document
from mrwork.store.run_folder import PLAN, REPORT
from mrwork.store.run_writer import add_to_run, adding
from mrwork.uncertainty.candidate_tests import Candidate, Limits, candidate_grid, read_candidates

if TYPE_CHECKING:
    from mrwork.uncertainty.planning import LinearisedPosterior

_DRAWS = 400


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
    parser.description = "Rank sinusoidal tests by how much each would reduce the variance of a band."
    parser.epilog = examples(
        "mrwork plan out/demo",
        "mrwork plan out/rig --band k_w@1.2A --amplitudes 0.005,0.01 --frequencies 1,2 --currents 0.3,0.9",
    )
    add_run(parser)
    band, candidates = parser.group("band"), parser.group("candidates")
    band.add_argument(
        "--band",
        default="force",
        metavar="BAND",
        help="quantity whose band is to be narrowed: force (default) or energy, mean over the targets, or a parameter",
    )
    candidates.add_argument(
        "--candidates",
        type=named_path,
        metavar="FILE",
        help="CSV with the columns amplitude [m], frequency [Hz] and, with current laws, current",
    )
    for name, numbers, what in (
        ("amplitudes", AMPLITUDES, "amplitudes of the candidates, as in 0.005,0.01"),
        ("frequencies", FREQUENCIES, "their frequencies"),
        ("currents", COMMANDS, "their currents or voltages, where the model has current laws"),
    ):
        add_number(
            candidates,
            f"--{name}",
            numbers,
            f"{what}; default: about those of the tests",
            default=(),
            metavar="LIST",
        )
    add_number(candidates, "--stroke", STROKE, "largest stroke of the rig, peak to peak", metavar="M")
    add_number(candidates, "--peak-velocity", VELOCITY, "largest velocity of the rig", metavar="V")
    band.add_argument(
        "--targets",
        type=named_path,
        metavar="FILE",
        help="CSV as in --candidates with the excitations for which the band is computed; default: the candidates",
    )
    add_seed(parser, "the draws that check the ranking")
    add_threads(parser)
    end_parser(parser, run, quiet="no note on candidates that could not be simulated")


def run(options: argparse.Namespace) -> int:
    """Rank the candidates, check the reductions with draws, write and print."""
    with adding(options.run_folder, PLAN):
        return _plan(opened_run(options), options)


def _plan(opened: OpenedRun, options: argparse.Namespace) -> int:
    # SciPy's optimisers are slow to load, and the help does not need them.
    from mrwork.uncertainty.planning import LinearisedPosterior, checked_with_draws, plan

    findings = told_findings("plan", opened.tests, options)
    spec = opened.fit.spec
    limits = Limits(stroke=options.stroke, peak_velocity=options.peak_velocity)
    candidates = _candidates(options, opened, limits)
    targets = () if options.targets is None else read_candidates(options.targets, spec, limits=None)
    ranked = plan(
        opened.fit, opened.tests, candidates, band=options.band, targets=targets, threads=options.threads
    )
    posterior = LinearisedPosterior.of(opened.fit, opened.tests, threads=options.threads)
    rng = np.random.default_rng(options.seed)
    draws, origin = _draws(opened, posterior, rng)
    check = replace(checked_with_draws(ranked, posterior, draws, targets=targets, rng=rng), draws=origin)
    place, document = opened.run.path, {"limits": asdict(limits)}
    add_to_run(place, {PLAN: json_document(check.document() | document).encode()})
    if ranked.left_out and not options.quiet:
        unit = spec.command_unit
        failed = "; ".join(each.in_words(unit) for each in ranked.left_out)
        note(f"not ranked, as they could not be simulated: {failed}")
    more = document | {"findings": findings, "out": str(place / PLAN)}
    return end_addition(options, check, more, [f"Report: {place / REPORT}"])


def _candidates(options: argparse.Namespace, opened: OpenedRun, limits: Limits) -> tuple[Candidate, ...]:
    if options.candidates is None:
        return candidate_grid(
            opened.fit.spec,
            opened.tests,
            amplitudes=options.amplitudes,
            frequencies=options.frequencies,
            commands=options.currents,
            limits=limits,
        )
    if options.amplitudes or options.frequencies or options.currents:
        raise SettingError(
            "--candidates comes with --amplitudes, --frequencies or --currents; give one or the other"
        )
    return read_candidates(options.candidates, opened.fit.spec, limits)


def _draws(opened: OpenedRun, posterior: LinearisedPosterior, rng: np.random.Generator) -> tuple[Floats, str]:
    """Draws of the parameters in the order of `posterior`, and the name of their distribution."""
    from mrwork.uncertainty.planning import normal_draws
    from mrwork.uncertainty.posterior.draws import read_draws

    draws = read_draws(opened.run, opened.fit)
    if draws is None:
        return normal_draws(posterior, _DRAWS, rng), "the linearised posterior"
    stored = draws.theta
    chosen = stored[rng.choice(len(stored), size=min(2 * _DRAWS, len(stored)), replace=False)]
    form = identifiable_form(opened.fit.spec, opened.fit.settings.bounds)
    return np.asarray(form.from_model(chosen)), "the posterior"
