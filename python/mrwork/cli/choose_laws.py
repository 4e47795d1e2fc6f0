"""`mrwork identify --law auto`: choose the current laws of a model by the fit to tests left out."""

from __future__ import annotations

import argparse
import json
import textwrap
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from mrwork.cli.identified import (
    report_line,
    stem_of,
    summary_of,
    text_of,
    with_command,
    with_identifiability,
    write_fit_page,
    write_identification,
)
from mrwork.cli.options import cannot_be_resumed, command_unit, laws_of, reading_of
from mrwork.cli.output import note
from mrwork.cli.progress import ProgressLine, laws_described
from mrwork.errors import Interrupted, MrworkError, SettingError
from mrwork.identification.settings import FitSettings
from mrwork.records import observed
from mrwork.store.run_folder import LAWS, check_destination
from mrwork.store.unfinished import StepJournals

if TYPE_CHECKING:
    from mrwork.uncertainty.choice.law_table import LawTable

_WIDTH = 118


def run(options: argparse.Namespace, settings: FitSettings) -> int:
    """Choose the laws, write the run folder of the fit with the chosen ones, print the table of what was tried."""
    # SciPy's optimisers are slow to load.
    from mrwork.uncertainty.choice.laws import choose_laws

    if options.starts:
        raise SettingError("--law auto finds its own starts; leave --start out")
    reading = reading_of(options)
    tests = tuple(observed(test, settings.observe) for test in reading.tests())
    folder = options.out or Path("out") / f"{stem_of(tests)}-{options.model}"
    check_destination(folder)
    journals = StepJournals(folder, resume=options.resume, note=note)
    line = ProgressLine(laws_described, quiet=options.quiet or options.json)
    status = 0
    try:
        choice = choose_laws(
            options.model,
            tests,
            laws=laws_of(options),
            unit=command_unit(tests, options),
            leave_out=options.leave_out,
            settings=settings,
            threads=options.threads,
            on_progress=line,
            journal_of=journals,
        )
    except Interrupted as interrupt:
        if interrupt.result is None:
            line.close()
            note("interrupted before any laws were fitted; run the same command with --resume to continue")
            return 130
        choice, status = interrupt.result, 130
    except MrworkError as error:
        if cannot_be_resumed(error, options):
            journals.discard()
        raise
    finally:
        line.close()
    fit = replace(choice.fit, seconds=choice.seconds)
    if status == 0:
        fit = with_identifiability(fit, tests, threads=options.threads)
    fit = with_command(fit, reading)
    # The last step that has begun: after an interrupt that may be the choice.
    steps = [journals.path(f"{fit.model}/{step}") for step in ("fit", "laws")]
    write_identification(
        folder,
        fit,
        next(path for path in steps if path.is_file()),
        finished=status == 0,
        documents={LAWS: asdict(choice.table)},
    )
    if status == 0:
        journals.discard()
    if not options.json:
        print("\n".join([*_lines(choice.table, folder), "", text_of(fit, tests)]), flush=True)
    if status == 130:
        note(
            f"interrupted; the best laws so far are in {folder}; run the same command with --resume to continue"
        )
    else:
        quiet = options.quiet or options.json
        status = write_fit_page(folder, fit, tests, quiet=quiet, laws=choice.table)
        if status == 0 and not options.json:
            print(report_line(folder))
    if options.json:
        print(json.dumps(summary_of(fit, tests, folder) | {"choice_of_laws": asdict(choice.table)}))
    return status


def _lines(table: LawTable, folder: Path) -> list[str]:
    return [*table.lines, "", *textwrap.wrap(table.sentence, _WIDTH), "", f"Laws: {folder / LAWS}"]
