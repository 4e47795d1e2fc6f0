"""`mrwork characterise`: from a folder of test records to a damper, by the steps of several verbs."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

from mrwork.base.numbers import counted
from mrwork.base.summary import list_names, named
from mrwork.cli.command_parser import COMPUTATION, CommandParser, examples
from mrwork.cli.derived import add_option_of
from mrwork.cli.frame import command_line
from mrwork.cli.number_texts import named_path
from mrwork.cli.options import add_threads, end_parser
from mrwork.cli.output import is_quiet, print_json, reading_line, renew_page, told_remarks
from mrwork.cli.terminal import note, show
from mrwork.cli.tests import add_observation, command_unit, reading_of_rows
from mrwork.dampers.spec import SCREENED, damper
from mrwork.errors import MrworkError, OutputError, RecordError, escape_text
from mrwork.identification.fit_file import fit_of, read_fit
from mrwork.identification.minimise.driver_lag import LAG_UNFITTED
from mrwork.identification.settings import FitSettings
from mrwork.records import DamperTest, ListedTest, guess_tests, read_test_table, write_test_table
from mrwork.records.checks import ONE_WAY
from mrwork.records.columns import COMMAND
from mrwork.records.contradictions import refuse_velocity
from mrwork.records.observation import DETECT, WEIGH
from mrwork.records.reading import Reading
from mrwork.records.rig_table import TABLE_NAME, UNKNOWN, Use, files_not_read, is_test_table, records_in
from mrwork.store.input_file import is_folder
from mrwork.store.run_folder import CALIBRATION, FIT, FIT_RUN, HELD_OUT, REPORT, SUMMARY, RunFolder
from mrwork.store.run_writer import RunAtWork, adding, is_complete, nothing_to_resume

_NAMED = 3


def add_options(parser: CommandParser) -> None:
    """Declare the folder of tests, the models to choose among, the seed and the run folder."""
    parser.describe(
        "It reads the table of tests, or makes it and decides which motions are kept for test; chooses the model "
        "and its current laws; calibrates on the tests set aside; predicts those kept for test; writes the page "
        "and its front. Where a person must be asked, it says what, and ends with status 2."
    )
    parser.epilog = examples(
        "mrwork characterise rig --out out/damper",
        "mrwork characterise rig --model normalised_bouc_wen --json --out out/one-model",
    )
    parser.add_argument(
        "folder", type=named_path, metavar="FOLDER", help="folder of the test records of one damper"
    )
    models = "damper models to choose among, as A,B,C; by default those that predict a few of the tests best, of all"
    parser.option("model", "--model", models, metavar="NAMES")
    add_observation(parser, usual=f"{DETECT} and {WEIGH}")
    add_option_of(parser, FitSettings, COMPUTATION, "rng")
    add_threads(parser)
    end_parser(
        parser,
        run,
        out="run folder, default out/FOLDER",
        resume="go on with a run that was interrupted; steps that are complete are not repeated",
    )


def run(options: argparse.Namespace) -> int:
    """Do every step that is not done yet; print the verdict and where everything is."""
    try:
        return _characterise(options)
    except MrworkError as error:
        if not error.of_columns:
            raise
        how = f"use mrwork identify, or write the column into its row of {TABLE_NAME}"
        raise type(error)(f"{error}; mrwork characterise has no --column: {how}") from error


def _characterise(options: argparse.Namespace) -> int:
    path = options.out or Path("out") / options.folder.resolve().name
    # What the steps would refuse, before anything is written.
    fitting = RunAtWork(path, FIT_RUN, replace=options.replace, resume=options.resume)
    fitting.run()
    begun = (path / FIT).exists() and not (path / SUMMARY).exists()
    if begun and not (options.resume or options.replace) and is_complete(path):
        raise OutputError(
            f"{path} has a fit, and steps after it are not done; run the same command with --resume to go on with it, "
            "or with --replace to begin anew"
        )
    models = options.model.split(",") if options.model else None
    for name in models or ():
        damper(name)
    rows, asked = _table(options)
    if asked:
        if options.json:
            print_json({"ask": asked, "table": str(options.folder / TABLE_NAME)})
        note(asked)
        return 2
    uses = {use: sum(row.use == use for row in rows) for use in ("fit", "calibration", "test")}
    if not uses["fit"]:
        raise RecordError(
            f"{options.folder / TABLE_NAME}: no row has the use fit; set it for the tests to be fitted"
        )
    quiet = is_quiet(options)
    if not quiet:
        note(
            f"{counted(uses['fit'], 'test')} to fit, {uses['calibration']} to calibrate, {uses['test']} kept for test"
        )
    # A run that was begun in place of a complete one is resumed.
    fitted = fitting.continues and is_complete(path)
    spare, remarks, steps = "", list[dict[str, Any]](), list[_Step]()
    if fitted:
        names = {Path(name).name for name in read_fit(path).provenance.inputs}
        if names != {Path(row.file).name for row in _of_use(rows, "fit")}:
            raise RecordError(
                f"{path} was fitted to other tests than those that the table names; give another --out, or --replace "
                "instead of --resume"
            )
    else:
        step, spare, remarks = _fitting(options, rows, models)
        steps.append(step)
    if uses["calibration"] and not (fitted and (path / CALIBRATION).is_file()):
        steps.append(("calibrating the bands", partial(_calibrate, options, path, rows)))
    if uses["test"] and not (fitted and (path / HELD_OUT).is_file()):
        steps.append(("predicting the tests kept for test", partial(_predict, options, path, rows)))
    if not steps and (path / SUMMARY).is_file():
        note(nothing_to_resume(path))
    steps.append(("writing the page and its summary", partial(_draw, options, path)))
    done = []
    for number, (what, work) in enumerate(steps, start=1):
        if not quiet:
            note(f"step {number} of {len(steps)}: {what}")
        began = time.perf_counter()
        if status := work():
            return status
        done.append({"step": what, "seconds": time.perf_counter() - began})
    return _end(options, path, uses, done, spare, remarks)


# What a step does, and its work, which returns an exit status.
_Step = tuple[str, Callable[[], int]]


def _of_use(rows: Sequence[ListedTest], use: Use) -> list[ListedTest]:
    return [row for row in rows if row.use == use]


def _fitting(
    options: argparse.Namespace, rows: Sequence[ListedTest], models: Sequence[str] | None
) -> tuple[_Step, str, list[dict[str, Any]]]:
    """The step that chooses a model, and its laws where the tests run at several commands.

    With it come why no test is spare, and what the checks found, which is said first.
    """
    from mrwork.cli.identified import Identification
    from mrwork.uncertainty.choice.choose import choose_model
    from mrwork.uncertainty.choice.choose_laws import choose_laws
    from mrwork.uncertainty.choice.splits import can_leave_out

    reading = reading_of_rows(_of_use(rows, "fit"))
    tests = _read(options, reading)
    kept = [row for row in rows if row.use in ("calibration", "test")]
    # Which test is unlike the others is told by all of them.
    remarks = told_remarks(
        "identify", [*tests, *(_read(options, reading_of_rows(kept)) if kept else ())], options
    )
    for test in tests:
        refuse_velocity(test)
    if all(ONE_WAY.code in {remark.code for remark in test.remarks} for test in tests):
        raise RecordError(
            f"{options.folder}: no test to fit turns back ({list_names([test.name for test in tests], _NAMED)}), and "
            "one way shows no loop to choose a model by; add strokes out and back at equal speeds, or fit one model by "
            "mrwork identify FILES --model NAME"
        )
    settings = FitSettings(rng=options.rng, observe=options.observe or (DETECT, WEIGH))
    spare = ""
    verb = Identification.of_tests(
        options, settings, reading, tests, options.folder.resolve().name, kept="the fit", is_step=True
    )
    # Commands that vary show the lag of the driver.
    varies = any(test.has_varying_command for test in tests)
    if varies or len({test.command_in_words for test in tests if test.commands}) > 1:
        _refuse_lone_commands(options, rows, tests)
        if not any(map(can_leave_out, combinations(tests, len(tests) - 1))):
            spare = "; the laws of the command need every fitted test, so record further motions for it"
        unit = command_unit(tests)
        choice = partial(choose_laws, models or SCREENED, settings=settings, unit=unit, lagged=varies)
        work = partial(verb.choose, choice)
    elif models is None or len(models) > 1:
        work = partial(verb.choose, partial(choose_model, models=models or SCREENED, settings=settings))
    else:
        work = partial(verb.fit, damper(models[0]), settings)
    return ("choosing model and laws", work), spare, remarks


def _calibrate(options: argparse.Namespace, path: Path, rows: Sequence[ListedTest]) -> int:
    from mrwork.uncertainty.bands.calibration_files import StoredBands, write_bands
    from mrwork.uncertainty.bands.prediction import UNSEEN
    from mrwork.uncertainty.bands.predictions import predict

    with adding(path, CALIBRATION):
        predicted = predict(read_fit(path), _read(options, reading_of_rows(_of_use(rows, "calibration"))))
        write_bands(path, StoredBands.of(predicted.predictions, held_out=UNSEEN))
    return 0


def _predict(options: argparse.Namespace, path: Path, rows: Sequence[ListedTest]) -> int:
    from mrwork.uncertainty.bands.calibration_files import stored_calibration
    from mrwork.uncertainty.bands.held_out import keep_held_out
    from mrwork.uncertainty.bands.predictions import Predictions

    run = RunFolder.open(path, FIT_RUN)
    keep_held_out(
        path,
        Predictions.of(
            fit_of(run),
            _read(options, reading_of_rows(_of_use(rows, "test"))),
            calibration=stored_calibration(run),
        ),
    )
    return 0


def _draw(options: argparse.Namespace, path: Path) -> int:
    return renew_page(options, path) or renew_page(options, path, summary=True)


def _end(
    options: argparse.Namespace,
    path: Path,
    uses: dict[str, int],
    done: list[Any],
    spare: str,
    test_remarks: list[dict[str, Any]],
) -> int:
    from mrwork.report.fit.front import evidence_of
    from mrwork.report.fit.page import open_run

    opened, compared = open_run(path)
    fit, verdict = opened.fit, evidence_of(opened, compared).in_words
    # What the commands of tests kept for test say of the lag, where it was not fitted.
    told = () if opened.held_out is None else opened.held_out.remarks
    late = [remark for remark in told if remark.code == LAG_UNFITTED.code]
    following = {name: str(law) for name, law in fit.spec.laws_by_name.items() if not law.is_constant}
    if options.json:
        held_out = opened.held_out
        print_json(
            {
                "out": str(path),
                "summary": str(path / SUMMARY),
                "report": str(path / REPORT),
                "model": fit.model,
                "laws": following,
                "verdict": verdict,
                "uses": uses,
                "held_out": None
                if held_out is None
                else named(held_out.spread, "median_percent", "worst_percent", "worst_test"),
                "test_remarks": test_remarks,
                "remarks": [asdict(remark) for remark in (*fit.remarks, *late)],
                "steps": done,
            }
        )
        return 0
    show(
        f"{fit.spec.title}; {', '.join(f'{name} {law}' for name, law in following.items()) or 'constant parameters'}"
    )
    show(verdict)
    show(f"Tested: {fit.tested.in_words}.")
    if not uses["test"]:
        how = f"set the use of some rows of {options.folder / TABLE_NAME} to test, and run the command again with"
        show(f"No test was kept for test{spare or f': {how} --replace'}.")
    for remark in (*fit.remarks, *late):
        show(remark.in_words)
    show(f"Summary: {path / SUMMARY}")
    show(f"Report: {path / REPORT}")
    return 0


def _table(options: argparse.Namespace) -> tuple[tuple[ListedTest, ...], str]:
    """The rows of the table of a folder, which is made where there is none; and what a person must be asked."""
    folder = options.folder
    if not is_folder(folder):
        raise RecordError(f"{folder} is no folder; give the folder of the test records of one damper")
    path = folder / TABLE_NAME
    if is_test_table(path):
        return read_test_table(path), ""
    files = records_in(folder)
    for sentence in files_not_read([folder]).values():
        note(sentence)
    rows = guess_tests(files)
    used = [row for row in rows if row.use is not None]
    if not used:
        raise RecordError(
            f"{folder}: none of {counted(len(rows), 'file')} can be read as a test; {rows[0].doubt}"
        )
    if any(COMMAND in row.columns for row in used):
        # A command that only some of the tests state is a question about the others.
        rows = tuple(
            row if row.use is None else replace(row, columns={COMMAND: UNKNOWN, **row.columns})
            for row in rows
        )
    rows = _with_uses(options, rows)
    write_test_table(path, rows)
    for row in rows:
        if row.doubt:
            note(f"{escape_text(row.file)}: {row.doubt}")
    note(f"written: {path}, {counted(len(rows), 'file')}; its uses may be changed before the next run")
    asked = [row for row in rows if row.is_open]
    if not asked:
        return rows, ""
    names = list_names([Path(row.file).name for row in asked], _NAMED)
    entries = dict.fromkeys(key for row in asked for key, entry in row.columns.items() if UNKNOWN in entry)
    return rows, (
        f"{path} has an open question, the {list_names([*entries])} of {names}: fill in each ? with a column and its "
        "unit, or a number with its unit, or set the use of what is no test to unused, and run the command again"
    )


def _with_uses(options: argparse.Namespace, rows: Sequence[ListedTest]) -> tuple[ListedTest, ...]:
    """Rows whose tests are fitted, set aside or kept by their motions, as far as they can be read."""
    # The tests of prediction bands load SciPy.
    from mrwork.uncertainty.bands.held_out import uses_of

    read = [row for row in rows if row.use is not None and not row.is_open]
    uses = (
        dict(zip([row.file for row in read], uses_of(_read(options, reading_of_rows(read))), strict=True))
        if read
        else {}
    )
    return tuple(replace(row, use=uses.get(row.file, row.use)) for row in rows)


def _read(options: argparse.Namespace, reading: Reading) -> tuple[DamperTest, ...]:
    with reading_line(options) as on_read:
        return reading.tests(on_read=on_read)


def _refuse_lone_commands(
    options: argparse.Namespace, rows: Sequence[ListedTest], tests: Sequence[DamperTest]
) -> None:
    """Refuse fitted tests of which those that remain without one motion run at one command, if a kept one helps."""
    from mrwork.uncertainty.choice.splits import can_leave_out  # loads SciPy

    if can_leave_out(tests):
        return
    for row in rows:
        if row.use in ("calibration", "test") and can_leave_out(
            [*tests, *_read(options, reading_of_rows([row]))]
        ):
            raise RecordError(
                f"{options.folder / TABLE_NAME}: the choice of laws leaves out tests in turn, and the others then "
                f"run at one command; set the use of {Path(row.file).name} back to fit, and type: {command_line()}"
            )
