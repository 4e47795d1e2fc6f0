"""`mrwork calibrate`: prediction bands of a fit, calibrated on tests that were not used for it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, get_args

import numpy as np

from mrwork.base.table import Table
from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.options import (
    add_files,
    add_observation,
    add_run,
    add_threads,
    end_parser,
    nuisances_of,
    observation_of,
    opened_run,
    read_tests,
)
from mrwork.cli.output import end_addition, is_quiet, progress_line, told_findings
from mrwork.cli.terminal import note
from mrwork.cli.workers import add_workers, on_workers
from mrwork.errors import SettingError
from mrwork.identification.batch import FitBatch, FitTask
from mrwork.identification.fit import Fit
from mrwork.identification.fit_file import fit_content, read_fit
from mrwork.identification.progress import IdentificationInWords, Progress
from mrwork.records import observed
from mrwork.store.run_folder import CALIBRATION, FOLDS
from mrwork.store.run_writer import add_to_run, adding
from mrwork.uncertainty.bands.calibration_files import name_of_fold, stored_fold, write_bands
from mrwork.uncertainty.bands.conformal import (
    LEVELS,
    Calibration,
    LeftOutCoverage,
    calibrate,
    measured_coverage,
)
from mrwork.uncertainty.bands.prediction import (
    IN_WORDS,
    UNSEEN,
    Fold,
    Prediction,
    folds_of,
    predict_left_out,
    predict_tests,
    rests_of,
)
from mrwork.workers.engine import present_workers

_AS_FITTED = "as in the identification"
# Level of the coverage and the interval score that stand for a calibration.
_LEVEL = 0.9

# The fit, predictions by it, and findings of their tests for --json.
_Predicted = tuple[tuple[Prediction, ...], list[dict[str, Any]]]


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
    parser.description = (
        "Calibrate prediction bands with the errors of the model on tests that were not used for the fit, "
        "and write them into the run folder, where mrwork predict RUN --level uses them. A test with the motion and "
        "command of a fitted one, such as its raw record or a repeated run, has been seen and is not used. Without "
        "files, the tests of the run are left out in turn, and each is predicted by a fit to the others."
    )
    parser.epilog = examples("mrwork calibrate out/rig rig", "mrwork calibrate out/rig --leave-out motion")
    add_run(parser)
    add_files(parser, required=False)
    add_observation(parser, default=_AS_FITTED, nuisances=_AS_FITTED)
    parser.group("cross-validation").add_argument(
        "--leave-out",
        choices=get_args(Fold),
        default="test",
        help="without files: tests that are left out together: each test alone (default), all of one motion, or all at "
        "one command",
    )
    add_threads(parser)
    add_workers(parser, "the fits to the tests that remain")
    end_parser(parser, run)


def run(options: argparse.Namespace) -> int:
    """Predict, calibrate, measure the coverage, and write the result into the run folder."""
    with adding(options.run_folder, CALIBRATION):
        if options.files:
            with on_workers(options, needless="the fit is there, and only predicts the files"):
                pass
            (predictions, findings), held_out = _predict_unseen(options), UNSEEN
        else:
            (predictions, findings), held_out = _predict_held_out(options), IN_WORDS[options.leave_out]
        calibration = calibrate(predictions, held_out=held_out)
        coverage = measured_coverage(predictions) if len(calibration.tests) > 1 else ()
        unseen = [each for each in predictions if each.seen is None]
        write_bands(options.run_folder, calibration, coverage, unseen)
        document = _summary(calibration, coverage) | {"findings": findings}
        return end_addition(options, document, _text(calibration, coverage, options.run_folder))


def _predict_unseen(options: argparse.Namespace) -> _Predicted:
    """Predictions of the files by the fit of the run, for which they must not have been used."""
    fit = read_fit(options.run_folder)
    words = observation_of(options, fit.settings.observe)
    _, read = read_tests(options, "calibration", fit)
    findings = told_findings("calibrate", read, options)
    tests = [observed(test, words) for test in read]
    for condition in filter(None, map(fit.other_condition, tests)):
        note(condition.condition_in_words)
    nuisances = nuisances_of(options, fit.nuisances)
    return predict_tests(fit, tests, nuisances=nuisances), findings


def _predict_held_out(options: argparse.Namespace) -> _Predicted:
    """Cross-validated predictions of the tests of the run, each by a fit to the other tests."""
    opened = opened_run(options)
    findings = told_findings("calibrate", opened.tests, options)
    rests = rests_of(opened.tests, folds_of(opened.tests, options.leave_out))
    names = [name_of_fold(opened.fit, rest) for rest in rests]
    stored = {name: fit for name in names if (fit := stored_fold(opened.run, name)) is not None}
    missing = [number for number, name in enumerate(names) if name not in stored]
    in_words = IdentificationInWords()

    def described(report: tuple[int, Progress | None]) -> str:
        number, progress = report
        if (workers := present_workers()) is not None:
            return workers.in_words
        fold = f"{options.leave_out} {missing[number] + 1} of {len(rests)}"
        return fold if progress is None else f"{fold}: {in_words(progress)}"

    def store(number: int, fit: Fit) -> None:
        add_to_run(opened.run.path, {names[missing[number]]: fit_content(fit)})

    settings = opened.fit.settings.again
    try:
        with on_workers(options), progress_line(described, quiet=is_quiet(options), patience=0.0) as line:
            batch = FitBatch(
                tasks=[
                    FitTask(spec=opened.fit.spec, tests=rests[number], settings=settings)
                    for number in missing
                ],
                threads=options.threads,
                on_progress=lambda number, progress: line((number, progress)),
                on_fit=store,
            )
            made = {names[number]: batch.fit(place) for place, number in enumerate(missing)}
    except KeyboardInterrupt as interrupt:
        interrupt.add_note(
            f"the fits of folds so far are in {opened.run.path / FOLDS}; run the same command again to continue"
        )
        raise
    fits = iter([(stored | made)[name] for name in names])
    left_out = predict_left_out(opened.tests, options.leave_out, lambda _: next(fits))
    if left_out.failures:
        raise SettingError(
            f"{len(left_out.failures)} of {len(opened.tests)} tests cannot be predicted without themselves, first: "
            f"{left_out.failures[0]}; leave out less at a time"
        )
    return left_out.predictions, findings


def _summary(calibration: Calibration, coverage: Sequence[LeftOutCoverage]) -> dict[str, Any]:
    """For --json; `coverage_percent` is the mean over tests at `level`, none of a single test."""
    shares = [row.samples.coverage for row in coverage if row.level == _LEVEL]
    return {
        "level": _LEVEL,
        "coverage_percent": 100.0 * float(np.mean(shares)) if shares else None,
        "tests": calibration.tests,
        "held_out": calibration.held_out,
        "seen": [asdict(each) for each in calibration.seen],
        "shape": asdict(calibration.shape),
        "coverage": [asdict(row) for row in coverage],
    }


def _text(calibration: Calibration, coverage: Sequence[LeftOutCoverage], folder: Path) -> str:
    lines = [f"Bands {calibration.basis}.", "", *calibration.remarks]
    lines += [""] if calibration.remarks else []
    if coverage:
        tests = [coverage[first : first + len(LEVELS)] for first in range(0, len(coverage), len(LEVELS))]
        main = LEVELS.index(_LEVEL)
        values = np.array(
            [
                [*(100 * each.samples.coverage for each in rows), rows[main].samples.interval_score]
                for rows in tests
            ]
        )
        table = Table(
            columns=("test", *(f"in {100 * level:.0f} %" for level in LEVELS), "score"),
            rows=tuple(
                (name, *(f"{share:.1f}" for share in shares), f"{score:.3f}")
                for name, (*shares, score) in zip(
                    [*(rows[0].test for rows in tests), "mean"], [*values, values.mean(axis=0)], strict=True
                )
            ),
        )
        lines += [
            "Share of each test's samples [%] in the bands calibrated on the other tests, and the interval score of "
            "the 90 % band:",
            "",
            *table.lines("  "),
            "",
        ]
    return "\n".join([*lines, f"Written: {folder / CALIBRATION}"])
