"""`mrwork calibrate`: prediction bands of a fit, calibrated on tests that were not used for it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.derived import add_options_of
from mrwork.cli.options import add_run, add_threads, end_parser, on_workers
from mrwork.cli.output import end_addition, progress_line, told_remarks
from mrwork.cli.terminal import note
from mrwork.cli.tests import add_files, add_observation, opened_run, read_tests
from mrwork.records.observation import Observing
from mrwork.store.run_folder import CALIBRATION, FOLDS, RANKING
from mrwork.store.run_writer import adding
from mrwork.uncertainty.bands.calibration_files import StoredBands, cross_validated, write_bands
from mrwork.uncertainty.bands.prediction import CHOSEN_WITH_ALL, IN_WORDS, UNSEEN, Prediction
from mrwork.uncertainty.bands.predictions import predict


def add_options(parser: CommandParser) -> None:
    """Declare the run, the tests to predict or those to leave out of its fit, and the observation."""
    parser.describe(
        "Bands are calibrated with the errors of the model on these tests and written into the run folder, where "
        "mrwork predict RUN --level uses them. A test with the motion and command of a fitted one, such as its "
        "raw record or a repeated run, has been seen and is not used. Without files, the tests of the run are "
        "left out in turn, and each is predicted by a fit to the others; so are the fastest, the slowest and the "
        "largest together, which says how far beyond the tests bands are known."
    )
    parser.epilog = examples("mrwork calibrate out/rig rig", "mrwork calibrate out/rig --leave-out motion")
    add_run(parser)
    add_files(parser, required=False)
    add_observation(parser, usual="as in the identification")
    add_options_of(parser, cross_validated, "cross-validation", "leave_out")
    add_threads(parser, "the fits to the tests that remain")
    end_parser(parser, run)


def run(options: argparse.Namespace) -> int:
    """Predict, calibrate, measure the coverage, and write the result into the run folder."""
    with adding(options.run_folder, CALIBRATION):
        if options.files:
            with on_workers(options, needless="the fit is there, and only predicts the files"):
                pass
            predictions, remarks = _predict_unseen(options)
            bands = StoredBands.of(predictions, held_out=UNSEEN)
        else:
            (predictions, beyond), remarks = _predict_held_out(options)
            chosen = CHOSEN_WITH_ALL if (options.run_folder / RANKING).is_file() else ""
            held_out = f"{IN_WORDS[options.leave_out]}{chosen}"
            bands = StoredBands.of(predictions, held_out=held_out, beyond=beyond)
        write_bands(options.run_folder, bands)
        below = [f"Written: {options.run_folder / CALIBRATION}"]
        return end_addition(options, bands, {"test_remarks": remarks}, below)


def _predict_unseen(options: argparse.Namespace) -> tuple[Sequence[Prediction], Sequence[object]]:
    """Predictions of the files by the fit of the run, for which they must not have been used; what checks found."""
    from mrwork.identification.fit_file import read_fit
    from mrwork.records import observed

    fit = read_fit(options.run_folder)
    observing = Observing.of(options.observe or fit.settings.observe)
    _, read = read_tests(options, "calibration", fit)
    remarks = told_remarks("calibrate", read, options)
    tests = [observed(test, observing) for test in read]
    for condition in filter(None, map(fit.other_condition, tests)):
        note(condition.condition.in_words)
    return predict(fit, tests, observe=observing).predictions, remarks


def _predict_held_out(
    options: argparse.Namespace,
) -> tuple[tuple[Sequence[Prediction], Sequence[Prediction]], Sequence[object]]:
    """Cross-validated predictions of the tests of the run, and those beyond the others; what checks found."""
    opened, remarks = opened_run(options, "calibrate")
    try:
        with on_workers(options), progress_line(options, patience=0.0) as line:
            predictions = cross_validated(
                opened, options.leave_out, threads=options.threads, on_progress=line
            )
    except KeyboardInterrupt as interrupt:
        interrupt.add_note(
            f"the fits of folds so far are in {opened.run.path / FOLDS}; run the same command again to continue"
        )
        raise
    return predictions, remarks
