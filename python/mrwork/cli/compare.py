"""`mrwork compare`: several runs of one verb on one page."""

from __future__ import annotations

import argparse
from pathlib import Path

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.numbers import named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import named, print_json, undrawn_warned
from mrwork.cli.terminal import show
from mrwork.store.output_file import replacing
from mrwork.store.output_folder import check_output


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
    parser.description = (
        "Compare runs of one verb: of fits the accuracy on tests that none of them was fitted to, models, bands and "
        "parameters; of studies and tunings the laws and motions that they have in common."
    )
    parser.epilog = examples(
        "mrwork compare out/rig out/demo --held-out rig", "mrwork compare out/demo out/rig --json"
    )
    parser.add_argument("runs", nargs="+", type=named_path, metavar="RUN", help="run folders, two or more")
    parser.group("tests").add_argument(
        "--held-out",
        dest="tests",
        nargs="+",
        type=named_path,
        default=[],
        metavar="TESTS",
        help="of fits: files, folders or tables of tests that each run predicts, of tables those kept for test; "
        "default: the tests that mrwork predict has predicted by every run",
    )
    parser.group("output").add_argument(
        "--out",
        type=named_path,
        default=Path("out/compare.html"),
        dest="page",
        metavar="PAGE",
        help="file of the page, which is replaced; default out/compare.html",
    )
    end_parser(parser, run, quiet="")


def run(options: argparse.Namespace) -> int:
    """Compare, write the page, print the tables."""
    # The wings of both verbs are slow to load.
    from mrwork.records import read_damper_tests
    from mrwork.report.compare_page import compare_page
    from mrwork.runs.compare import compare_runs

    tests = read_damper_tests([str(each) for each in options.tests], use="test") if options.tests else ()
    check_output(options.page, replace=True, otherwise="")
    found = compare_runs(options.runs, tests=tests)
    with undrawn_warned(f"{options.page}", "the tables stand without it") as failed:
        page = compare_page(found, options.runs).encode()
    if not failed:
        with replacing(options.page) as stream:
            stream.write(page)
    if options.json:
        tables = [named(table, "title", "columns", "rows", "foot") for table in found.tables]
        further = {"tables": tables, "page": None if failed else str(options.page)}
        print_json(named(found, "title", "verdict", "remarks") | further)
        return 0
    show(found.verdict)
    for table in found.tables:
        show("\n".join(["", table.title, *table.lines("  ", width=120)]))
    for remark in found.remarks:
        show(remark)
    if not failed:
        show(f"\nPage: {options.page}")
    return 0
