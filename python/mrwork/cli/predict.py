"""`mrwork predict`: free-run simulations of other tests with a stored fit."""

from __future__ import annotations

import argparse

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.derived import add_option_of, arguments_of
from mrwork.cli.options import add_run, end_parser
from mrwork.cli.output import renew_page, show_results, told_remarks
from mrwork.cli.tests import add_files, add_observation, read_tests
from mrwork.records.observation import Observing
from mrwork.store.run_folder import FIT_RUN, HELD_OUT, RunFolder
from mrwork.uncertainty.bands.predictions import Predictions


def add_options(parser: CommandParser) -> None:
    """Declare the run, the tests with their observation, and the level of the bands."""
    parser.describe(
        "Tests with the motion and command of a fitted one are named as seen; the others of every call stand on "
        "the page of RUN. Where --law auto has found other sets of laws that predict nearly as well, within 1 "
        "point, a sentence says how far they are apart where the tests end and between their commands."
    )
    parser.epilog = examples(
        "mrwork predict out/rig rig --level 0.9",
        "mrwork predict out/demo synthetic:spencer1997_slow --substep-factor 4",
    )
    add_run(parser)
    add_files(parser)
    add_observation(parser, usual="as in the identification")
    add_option_of(parser, Predictions.of, "prediction", "substep_factor")
    add_option_of(
        parser, Predictions.of, "prediction", "level", metavar="SHARE", more="given by mrwork calibrate RUN"
    )
    end_parser(parser, run)


def run(options: argparse.Namespace) -> int:
    """Predict every test, keep what the fit has not seen for its page, and print how the forces compare."""
    from mrwork.identification.fit_file import fit_of
    from mrwork.uncertainty.bands.calibration_files import read_calibration, stored_calibration
    from mrwork.uncertainty.bands.held_out import keep_held_out

    folder = RunFolder.open(options.run_folder, FIT_RUN)
    fit = fit_of(folder)
    observing = Observing.of(options.observe or fit.settings.observe)
    # Tests of a calibration are not kept for test, whether its bands are printed or not.
    calibration = stored_calibration(folder) if options.level is None else read_calibration(folder)
    _, tests = read_tests(options, "test", fit)
    remarks = told_remarks("predict", tests, options)
    predictions = Predictions.of(
        fit, tests, observe=observing, calibration=calibration, **arguments_of(options, Predictions.of)
    )
    as_fitted = options.substep_factor == 1 and observing == fit.settings.observing
    stored = as_fitted and keep_held_out(options.run_folder, predictions)
    if stored:
        renew_page(options, options.run_folder)
    more = {"stored": str(options.run_folder / HELD_OUT)} if stored else {}
    show_results(options, predictions, document=predictions.document() | {"test_remarks": remarks} | more)
    return 0
