"""`mrwork identify --law auto`: choose the current laws of a model, or of several, by the fit to tests left out."""

from __future__ import annotations

import argparse
import textwrap
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

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
from mrwork.cli.options import command_unit, laws_of, models_of, reading_of, tests_of
from mrwork.cli.progress import laws_described
from mrwork.cli.terminal import note
from mrwork.errors import SettingError
from mrwork.identification.settings import FitSettings
from mrwork.records import observed
from mrwork.store.run_folder import LAWS
from mrwork.store.unfinished import StepJournals

if TYPE_CHECKING:
    from mrwork.uncertainty.choice.law_table import LawTable

_WIDTH = 118


def run(options: argparse.Namespace, settings: FitSettings, *, several: bool) -> int:
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
