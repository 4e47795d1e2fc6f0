"""`mrwork report`: the page of a run again, and its figures as files."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.options import add_run, end_parser
from mrwork.cli.output import drawing, is_quiet, print_json, told_findings
from mrwork.cli.terminal import show
from mrwork.records import DamperTest
from mrwork.store.run_folder import FIGURES, REPORT

if TYPE_CHECKING:
    from mrwork.report.section import OnDrawn


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
    parser.description = "Draw the page of a run again, with everything that its folder holds."
    parser.epilog = examples(
        "mrwork report out/demo",
        "mrwork report out/demo --figures",
    )
    add_run(parser)
    page = parser.group("page")
    page.add_argument(
        "--figures",
        action="store_true",
        help="also write every figure as an SVG and a PNG file into RUN/figures; those of each test for every test",
    )
    page.add_argument(
        "--all-tests",
        action="store_true",
        help="draw every test in full; by default up to four tests, of more the best, the median and the worst fit",
    )
    end_parser(parser, run)


def run(options: argparse.Namespace) -> int:
    """Write the page, and the figures if requested; print where they are."""
    place = options.run_folder
    names: list[str] = []
    tests: list[DamperTest] = []

    def draw(on_progress: OnDrawn) -> None:
        # Matplotlib is slow to load.
        from mrwork.report.fit.page import open_run, write_figures, write_page

        opened, comparisons = open_run(place)
        tests.extend(each.test for each in comparisons)
        write_page(opened, comparisons, every_test=options.all_tests, on_progress=on_progress)
        if options.figures:
            names.extend(write_figures(opened, comparisons, on_progress=on_progress))

    status = drawing(place, draw, quiet=is_quiet(options))
    if status == 0:
        findings = told_findings("report", tests, options)
        if options.json:
            document = {"out": str(place), "report": str(place / REPORT), "figures": names}
            print_json(document | {"findings": findings})
        else:
            show(f"Report: {place / REPORT}")
            if names:
                show(f"Figures: {2 * len(names)} files in {place / FIGURES}")
    return status
