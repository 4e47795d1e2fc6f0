"""`mrwork identify --model all` and `--law auto`: models, or current laws, chosen by the fit to tests left out."""

from __future__ import annotations

import argparse
import textwrap
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from mrwork.cli.identified import (
    close_run,
    destination_of,
    run_search,
    stem_of,
    summary_of,
    text_of,
    with_command,
    with_identifiability,
    write_identification,
)
from mrwork.cli.options import command_unit, laws_are_chosen, laws_of, models_of, reading_of, tests_of
from mrwork.cli.output import as_plain
from mrwork.cli.progress import choice_described, laws_described
from mrwork.cli.terminal import note
from mrwork.errors import SettingError
from mrwork.identification.settings import FitSettings
from mrwork.records import observed
from mrwork.records.findings import findings_for
from mrwork.store.run_folder import FIT, LAWS, MODELS, RANKING
from mrwork.store.unfinished import StepJournals
from mrwork.summary import aligned
from mrwork.uncertainty.bands.prediction import Fold
from mrwork.uncertainty.choice.choose import ALL

if TYPE_CHECKING:
    from mrwork.uncertainty.choice.choose import Choice
    from mrwork.uncertainty.choice.law_table import LawTable
    from mrwork.uncertainty.choice.ranking import Ranking


_WIDTH = 118


def add_choice(parser: argparse.ArgumentParser) -> None:
    """Declare the options that only a comparison takes."""
    parser.add_argument(
        "--leave-out",
        choices=get_args(Fold),
        help="with several models or --law auto: tests that are left out together and predicted: each test alone "
        "(default), all of one motion (default of --law auto from three motions on), or all at one command",
    )
    parser.add_argument(
        "--posterior",
        action="store_true",
        help="with several models: draw for PSIS-LOO from a Markov chain of the posterior, not from a normal "
        "approximation about the fit",
    )


def is_choice(options: argparse.Namespace) -> bool:
    """Whether the command line is for a comparison of models.

    Raises
    ------
    SettingError
        Where an option belongs only to a comparison and there is none, or is impossible in a comparison.
    """
    models = models_of(options)
    several = models == ALL or not isinstance(models, str)
    if not several and (options.posterior or (options.leave_out and not laws_are_chosen(options))):
        raise SettingError("--leave-out and --posterior belong to a comparison; give --model all, or A,B,C")
    if several and laws_are_chosen(options) and options.posterior:
        raise SettingError("--posterior is for PSIS-LOO, by which --law auto does not judge; leave it out")
    if several and options.starts:
        raise SettingError("--start gives one model's parameters; leave it out where models are compared")
    return several


def run(options: argparse.Namespace, settings: FitSettings) -> int:
    """Identify and rank the models, write the run folder with the report of the best, print the ranking."""
    # SciPy's optimisers are slow to load.
    from mrwork.uncertainty.choice.choose import choose_model

    reading = reading_of(options, "fit")
    read = tests_of(reading, quiet=options.quiet or options.json)
    tests = tuple(observed(test, settings.observe) for test in read)
    folder = options.out or Path("out") / f"{stem_of(tests)}-models"
    destination = destination_of(folder, options)
    with StepJournals(destination, resume=options.resume, note=note) as journals:
        choice, status = run_search(
            lambda line: choose_model(
                tests,
                models_of(options),
                leave_out=options.leave_out or "test",
                laws=laws_of(options),
                unit=command_unit(tests, options),
                lagged=options.driver_lag,
                settings=settings,
                sampled=options.posterior,
                threads=options.threads,
                on_progress=line,
                journal_of=journals,
            ),
            choice_described,
            options,
            before="any model was identified",
        )
        if choice is None:
            return status
        fits = {fit.model: with_command(fit, reading) for fit in choice.fits}
        best = fits[choice.ranking.chosen]
        if status == 0:
            best = with_identifiability(best, tests, options)
        documents: dict[str, object] = {f"{MODELS}/{name}/{FIT}": fit.as_dict() for name, fit in fits.items()}
        written = write_identification(
            destination,
            best,
            journals.path(f"{best.model}/fit"),
            finished=status == 0,
            documents=documents | {RANKING: asdict(choice.ranking)},
        )
        if status == 0:
            journals.discard()
        text = _text(choice.ranking, folder)
        return close_run(
            folder,
            best,
            tests,
            status,
            options,
            text=f"{text}\n\n{text_of(best, tests)}" if status == 0 else text,
            kept="what was identified",
            written=written,
            document=_summary(choice, folder) | {"findings": as_plain(findings_for("identify", tests))},
            ranking=choice.ranking,
        )


def _summary(choice: Choice, folder: Path) -> dict[str, Any]:
    fits = {fit.model: str(folder / MODELS / fit.model / FIT) for fit in choice.fits}
    return asdict(choice.ranking) | {"fits": fits, "out": str(folder)}


def _text(ranking: Ranking, folder: Path) -> str:
    from mrwork.report.ranking_rows import HEADINGS, ranking_rows

    lines = aligned([HEADINGS, *((row.model, *row.cells) for row in ranking_rows(ranking))])
    for sentence in (ranking.sentence, *(f"Note: {remark}." for remark in ranking.remarks)):
        lines += ["", *textwrap.wrap(sentence, _WIDTH)]
    return "\n".join([*lines, "", f"Ranking: {folder / RANKING}"])


def run_choice_of_laws(options: argparse.Namespace, settings: FitSettings, *, several: bool) -> int:
    """Choose the laws of one or `several` models, write the run folder of their fit, print what was tried."""
    # SciPy's optimisers are slow to load.
    from mrwork.uncertainty.choice.laws import choose_laws

    if options.starts:
        raise SettingError("--law auto finds its own starts; leave --start out")
    reading = reading_of(options, "fit")
    read = tests_of(reading, quiet=options.quiet or options.json)
    tests = tuple(observed(test, settings.observe) for test in read)
    folder = options.out or Path("out") / f"{stem_of(tests)}-{'models' if several else options.model}"
    destination = destination_of(folder, options)
    with StepJournals(destination, resume=options.resume, note=note) as journals:
        choice, status = run_search(
            lambda line: choose_laws(
                models_of(options),
                tests,
                laws=laws_of(options),
                unit=command_unit(tests, options),
                leave_out=options.leave_out,
                settings=settings,
                threads=options.threads,
                on_progress=line,
                journal_of=journals,
            ),
            laws_described,
            options,
            before="any laws were fitted",
        )
        if choice is None:
            return status
        fit = replace(choice.fit, seconds=choice.seconds)
        if status == 0:
            fit = with_identifiability(fit, tests, options)
        fit = with_command(fit, reading)
        # The last step that has begun: after an interrupt that may be the choice.
        steps = [journals.path(f"{fit.model}/{step}") for step in ("fit", "laws")]
        written = write_identification(
            destination,
            fit,
            next(path for path in steps if path.is_file()),
            finished=status == 0,
            documents={LAWS: asdict(choice.table)},
        )
        if status == 0:
            journals.discard()
        return close_run(
            folder,
            fit,
            tests,
            status,
            options,
            text="\n".join([*_lines(choice.table, folder), "", text_of(fit, tests)]),
            kept="the best of what was fitted",
            written=written,
            document=summary_of(fit, tests, folder) | {"choice_of_laws": asdict(choice.table)},
            laws=choice.table,
        )


def _lines(table: LawTable, folder: Path) -> list[str]:
    lines = table.lines
    for sentence in (table.sentence, *(f"Note: {remark}." for remark in table.notes)):
        lines += ["", *textwrap.wrap(sentence, _WIDTH)]
    return [*lines, "", f"Laws: {folder / LAWS}"]
