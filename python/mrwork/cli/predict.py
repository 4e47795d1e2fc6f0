"""`mrwork predict`: free-run simulations of other tests with a stored fit."""

from __future__ import annotations

import argparse
import os
from dataclasses import asdict
from typing import Any

import numpy as np

from mrwork.base.table import TableColumn, text_table
from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.numbers import SHARE, SUBSTEP_FACTOR, add_number
from mrwork.cli.options import (
    add_files,
    add_observation,
    add_run,
    end_parser,
    nuisances_of,
    observation_of,
    read_tests,
)
from mrwork.cli.output import is_quiet, named, print_json, renew_page, told_findings
from mrwork.cli.terminal import show
from mrwork.dampers.law_sets import SetsApart
from mrwork.dampers.spec import LawLimit, worst_laws
from mrwork.dampers.tested_range import Exceedance, worst_of
from mrwork.identification.fit import Fit
from mrwork.identification.fit_file import fit_of, read_others
from mrwork.identification.problem import prediction_warning
from mrwork.identification.residual import estimated_in_words, missing_warnings
from mrwork.identification.result import FitSpread, explain_failures, free_run
from mrwork.records import Likeness, observed
from mrwork.records.likeness import likenesses_in_words
from mrwork.store.run_folder import FIT_RUN, HELD_OUT, RunFolder
from mrwork.store.run_writer import adding
from mrwork.uncertainty.bands.band import score
from mrwork.uncertainty.bands.calibration_files import read_calibration, stored_calibration
from mrwork.uncertainty.bands.conformal import BEYOND_TESTED
from mrwork.uncertainty.bands.held_out import write_held_out
from mrwork.uncertainty.bands.prediction import Prediction, with_others

_AS_FITTED = "as in the identification"

_COLUMNS = (
    TableColumn(heading="file", cell=lambda row: row["file"]),
    TableColumn(heading="fit %", cell=lambda row: f"{row['fit_percent']:.2f}"),
    TableColumn(heading="NRMSE", cell=lambda row: f"{row['nrmse']:.4f}"),
    TableColumn(heading="RMSE", unit="N", cell=lambda row: f"{row['rmse_n']:.2f}"),
    TableColumn(heading="samples", cell=lambda row: str(row["n_time"])),
    TableColumn(heading="sub-steps", cell=lambda row: str(row["substeps"])),
)
_BAND_COLUMNS = (
    TableColumn(heading="+-", unit="N", cell=lambda row: f"{row['band']['half_width_n']:.4g}"),
    TableColumn(heading="inside %", cell=lambda row: f"{100.0 * row['band']['inside']:.1f}"),
)


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
    parser.description = (
        "Simulate other tests with a stored fit and compare the simulated force with the measured one. "
        "Tests with the motion and command of a fitted one are named as seen; the others of every call stand on the "
        "page of RUN. "
        "Where --law auto has found other sets of laws that predict nearly as well, within 1 point, a sentence says "
        "how far they are apart where the tests end and between their commands."
    )
    parser.epilog = examples(
        "mrwork predict out/rig rig --level 0.9",
        "mrwork predict out/demo synthetic:spencer1997_slow --substep-factor 4",
    )
    add_run(parser)
    add_files(parser)
    add_observation(parser, default=_AS_FITTED, nuisances=_AS_FITTED)
    prediction = parser.group("prediction")
    add_number(
        prediction,
        "--substep-factor",
        SUBSTEP_FACTOR,
        "multiply the integration steps by N = 2, 4, ... to check that the result does not change",
        default=1,
        metavar="N",
    )
    add_number(
        prediction,
        "--level",
        SHARE,
        "also print the half width and the coverage of the prediction band of this level, such as 0.9; needs mrwork "
        "calibrate RUN",
        metavar="SHARE",
    )
    end_parser(parser, run)


def run(options: argparse.Namespace) -> int:
    """Predict every test and print how the forces compare."""
    run = RunFolder.open(options.run_folder, FIT_RUN)
    fit = fit_of(run)
    calibration = None if options.level is None else read_calibration(run)
    # Tests of a calibration are not kept for test, whether its bands are printed or not.
    calibrated = calibration or stored_calibration(run)
    spec, theta = fit.spec, np.array(fit.theta)
    rows: list[dict[str, Any]] = []
    known: list[Likeness] = []
    conditions: list[Likeness] = []
    calibrated_on: list[Likeness] = []
    exceeded: list[tuple[str, Exceedance]] = []
    limited: list[LawLimit] = []
    others = read_others(run) or ()
    apart: list[tuple[str, SetsApart]] = []
    held_out: list[Prediction] = []
    nuisances = nuisances_of(options, fit.nuisances)
    words = observation_of(options, fit.settings.observe)
    _, tests = read_tests(options, "test", fit)
    findings = told_findings("predict", tests, options)
    for test in (observed(test, words) for test in tests):
        with explain_failures(fit, test):
            force, quality = free_run(
                spec, theta, test, nuisances=nuisances, substep_factor=options.substep_factor
            )
        seen, condition, outside = fit.seen(test), fit.other_condition(test), fit.outside(test, force)
        exceeded += [(test.label, each) for each in outside.exceedances]
        limited += outside.laws
        prediction = with_others(
            Prediction(test=test, model_force=force, outside=outside), fit, others, nuisances
        )
        sets = prediction.sets_apart
        apart += [] if sets is None else [(test.label, sets)]
        rows.append(
            {
                "file": test.label,
                **named(quality, "fit_percent", "nrmse", "rmse_n"),
                "error_norms": asdict(quality.error_norms),
                **named(quality, "n_time", "settle_seconds", "substeps"),
                "seen": None if seen is None else asdict(seen),
                "other_condition": None if condition is None else asdict(condition),
                "nuisance": asdict(quality.nuisance) if nuisances else None,
                "outside_tested_range": list(outside.names) if outside.known else None,
                "warnings": list(outside.sentences),
                "sets_apart_percent": None if sets is None else sets.percent,
            }
        )
        known += [] if seen is None else [seen]
        conditions += [] if condition is None else [condition]
        used = None if calibrated is None else calibrated.knows(test)
        if calibration is not None:
            band = calibration.band(prediction, options.level)
            scored = score(band, test.force[test.counted])
            calibrated_on += [] if used is None else [used]
            rows[-1] |= {
                "coverage_percent": 100.0 * scored.coverage,
                "mean_width_n": scored.width,
                "interval_score": scored.interval_score,
                "band": {
                    "level": band.level,
                    "half_width_n": 0.5 * scored.width,
                    "inside": scored.coverage,
                    "basis": band.basis,
                    "calibrated_on": None if used is None else asdict(used),
                },
            }
        if seen is None and used is None:
            held_out.append(prediction)
    warnings = [
        *missing_warnings(fit.nuisances, nuisances),
        *prediction_warning(spec, tests),
        *_warnings(exceeded, limited, len(rows)),
        *(each.condition_in_words for each in conditions),
    ]
    spread = _spread(rows) if len(rows) > 1 else None
    unseen = [row for row in rows if row["seen"] is None]
    spread_unseen = _spread(unseen) if unseen and len(unseen) < len(rows) else None
    basis = None if calibration is None else calibration.basis
    as_fitted = options.substep_factor == 1 and nuisances == fit.nuisances
    stored = as_fitted and _store(options, fit, held_out)
    if options.json:
        document: dict[str, Any] = {
            "model": fit.model,
            "files": rows,
            "nuisances": nuisances,
            "warnings": warnings,
            "findings": findings,
        }
        document |= {"sets_apart": _apart_in_words(apart)} if apart else {}
        document |= {"spread": asdict(spread)} if spread is not None else {}
        document |= {"spread_unseen": asdict(spread_unseen)} if spread_unseen is not None else {}
        document |= {"stored": str(options.run_folder / HELD_OUT)} if stored else {}
        print_json(document | ({"basis": basis} if basis else {}))
        return 0
    show("\n".join(text_table((*_COLUMNS, *(_BAND_COLUMNS if basis else ())), rows).lines()))
    if spread is not None:
        show(spread.in_words)
    if nuisances:
        show(f"Estimated from the measured force of each test: {estimated_in_words(nuisances)}.")
    for warning in warnings:
        show(f"warning: {warning}")
    if apart:
        show(f"{_apart_in_words(apart)}.")
    if basis:
        show(f"Bands of {100.0 * options.level:g} %, {basis}.")
        beyond = sum(bool(row["outside_tested_range"]) for row in rows)
        if beyond:
            show(f"{beyond} of {len(rows)} files are outside the tested range of the fit: {BEYOND_TESTED}.")
    if known:
        show(f"Seen by the fit: {likenesses_in_words(known)}.")
    if spread_unseen is not None:
        show(f"Not seen by the fit: {spread_unseen.in_words}")
    if calibrated_on:
        show(f"Used for the calibration of the bands: {likenesses_in_words(calibrated_on)}.")
    return 0


def _store(options: argparse.Namespace, fit: Fit, held_out: list[Prediction]) -> bool:
    """Keep what the fit predicts of tests that it has not seen, for its page; whether it was kept."""
    place = options.run_folder
    if not held_out or not os.access(place, os.W_OK):
        return False
    with adding(place, HELD_OUT):
        write_held_out(RunFolder.open(place), fit, held_out)
    renew_page(place, quiet=is_quiet(options))
    return True


def _spread(rows: list[dict[str, Any]]) -> FitSpread:
    return FitSpread.of([row["file"] for row in rows], [row["fit_percent"] for row in rows])


def _apart_in_words(apart: list[tuple[str, SetsApart]]) -> str:
    """The test on which sets of laws are farthest apart, and on how many they reach the end of the tests."""
    label, worst = max(apart, key=lambda each: each[1].percent)
    files = f"; the farthest of {len(apart)} files" if len(apart) > 1 else ""
    return f"{worst.in_words}, {label}{files}"


def _warnings(exceeded: list[tuple[str, Exceedance]], limited: list[LawLimit], n_files: int) -> list[str]:
    """A sentence for each quantity, with the worst file and the number of files, and for each law."""
    sentences = []
    for worst, label, count in worst_of(exceeded):
        files = f"; outside on {count} of {n_files} files" if n_files > 1 else ""
        sentences.append(f"{worst.in_words}, {label}{files}")
    sentences += [each.in_words for each in worst_laws(limited)]
    return [f"{each}; test there before you rely on it" for each in sentences]
