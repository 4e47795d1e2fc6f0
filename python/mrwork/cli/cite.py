"""`mrwork cite`: what to cite for a run, as BibTeX."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.numbers import named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import print_result
from mrwork.runs.citations import citations


def add_options(parser: CommandParser) -> None:
    """Declare the run whose sources are listed; without a run only the package is cited."""
    parser.description = (
        "Print what to cite for a run as BibTeX: the package, models, control laws, methods and records."
    )
    parser.epilog = examples("mrwork cite out/demo", "mrwork cite out/demo --json")
    parser.add_argument(
        "folder",
        nargs="?",
        type=named_path,
        metavar="RUN",
        help="folder of a run of any verb; without it, the package alone",
    )
    end_parser(parser, run, quiet="")


def run(options: argparse.Namespace) -> int:
    """Print a BibTeX entry of each work, below what the run uses it for."""
    cited = citations(options.folder)
    document = {"entries": [asdict(work) | {"used_for": reasons} for work, reasons in cited.items()]}
    text = "\n\n".join(f"% {'; '.join(reasons)}\n{work.bibtex}" for work, reasons in cited.items())
    print_result(options, document, text)
    return 0
