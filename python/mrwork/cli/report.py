"""`mrwork report`: the page of a run again, its figures as files, and what to cite for it."""

from __future__ import annotations

import argparse
import os
import sys
import webbrowser
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from mrwork.base.progress import OnProgress
from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.derived import add_option_of
from mrwork.cli.options import add_run, end_parser
from mrwork.cli.output import drawing, print_json, print_result, told_remarks
from mrwork.cli.terminal import note, show
from mrwork.errors import SettingError
from mrwork.report.page_options import EveryTest, Summary
from mrwork.store.run_folder import FIGURES, FIT_RUN, RunFolder

if TYPE_CHECKING:
    from mrwork.records import DamperTest


def add_options(parser: CommandParser) -> None:
    """Declare the run, and which of its pages and figures are written or opened."""
    parser.describe(
        "A page is of a fit, a study or a tuning, with everything that the folder holds. Cited are the package, "
        "models, control laws, methods and records."
    )
    parser.epilog = examples(
        "mrwork report out/demo --summary",
        "mrwork report out/demo --figures",
        "mrwork report out/demo --cite",
    )
    add_run(parser)
    add_option_of(parser, Summary, "page", "summary")
    parser.option("page", "--open", "open it in the browser", bool)
    figures = "of a fit: also write every figure of the page as an SVG and a PNG file into RUN/figures"
    parser.option("page", "--figures", figures, bool)
    add_option_of(parser, EveryTest, "page", "every_test", "all-tests")
    parser.option("citation", "--cite", "print what to cite for the run as BibTeX, and draw nothing", bool)
    end_parser(parser, run)


def run(options: argparse.Namespace) -> int:
    """Write the page, and the figures if requested; print where they are."""
    path = options.run_folder
    if options.cite:
        return _cite(options)
    kind = RunFolder.open(path).kind
    if kind is not FIT_RUN and (options.figures or options.every_test):
        option = "--figures" if options.figures else "--all-tests"
        raise SettingError(
            f"{option} is of the tests of a fit, and {path} is of `mrwork {kind.verb}`; leave it out"
        )
    names: list[str] = []
    tests: list[DamperTest] = []
    written: list[Path] = []

    def draw(on_progress: OnProgress) -> None:
        from mrwork.report.fit.page import write_figures
        from mrwork.report.pages import page_of

        page, compared = page_of(
            path, summary=options.summary, every_test=options.every_test, on_progress=on_progress
        )
        tests.extend(prediction.test for prediction in compared)
        written.append(page.write(path, summary=options.summary))
        if options.figures:
            names.extend(write_figures(path, page, on_progress=on_progress))

    status = drawing(options, path, draw)
    if status == 0:
        remarks = told_remarks("report", tests, options)
        if options.json:
            document = {"out": str(path), "report": str(written[0]), "figures": names}
            print_json(document | {"test_remarks": remarks})
        else:
            show(f"Report: {written[0]}")
            if names:
                show(f"Figures: {2 * len(names)} files in {path / FIGURES}")
        if options.open:
            _open(written[0])
    return status


def _cite(options: argparse.Namespace) -> int:
    """Print a BibTeX entry of each work, below what the run uses it for."""
    from mrwork.runs.citations import citations

    cited = citations(options.run_folder)
    document = {"entries": [asdict(work) | {"used_for": reasons} for work, reasons in cited.items()]}
    text = "\n\n".join(f"% {'; '.join(reasons)}\n{work.bibtex}" for work, reasons in cited.items())
    print_result(options, document, text)
    return 0


def _open(page: Path) -> None:
    """Open a page in the browser of a desktop; browsers of a terminal would take it over."""
    desktop = sys.platform in ("darwin", "win32") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    )
    if not (desktop and webbrowser.open_new_tab(page.resolve().as_uri())):
        note(f"no browser was found; open {page} in one")
