"""`mrwork convert`: Bouc-Wen parameters from one convention to another that gives the same force."""

from __future__ import annotations

import argparse
from functools import partial
from typing import get_args

from mrwork.cli.command_parser import Collect, CommandParser, examples
from mrwork.cli.derived import add_option_of, arguments_of, read_entry
from mrwork.cli.numbers import finite_number
from mrwork.cli.options import end_parser
from mrwork.cli.output import show_results
from mrwork.dampers.conventions import NAMES, Convention, convert
from mrwork.errors import SettingError


def add_options(parser: CommandParser) -> None:
    """Declare both conventions, the parameters as NAME=VALUE, the scale, and the error of the target solver."""
    conventions = "; ".join(f"{name}: {' '.join(parameters)}" for name, parameters in NAMES.items())
    parser.description = (
        "Convert Bouc-Wen parameters to another convention that gives the same force. "
        f"{conventions} (c0 is a dashpot in parallel). SI units."
    )
    parser.epilog = examples(
        "mrwork convert spencer alpha=1e5 A=120 n=2 gamma=1e6 beta=1e6 c0=5000 --to normalised",
        "mrwork convert normalised k_w=680 rho=15500 sigma=0.5 n=2 --to opensees",
    )
    parser.add_argument(
        "source", choices=get_args(Convention), metavar="FROM", help="convention of the values"
    )
    to = "spencer, normalised or opensees"
    parser.option("conversion", "--to", to, metavar="TO", choices=get_args(Convention), required=True)
    parser.add_argument(
        "values",
        nargs="+",
        action=Collect,
        type=partial(read_entry, finite_number, "NUMBER"),
        metavar="NAME=VALUE",
        help="parameters, as in n=2",
    )
    add_option_of(parser, convert, "conversion", "scale", metavar="VALUE")
    add_option_of(parser, convert, "conversion", "error", metavar="SHARE")
    end_parser(parser, run, quiet="")


def run(options: argparse.Namespace) -> int:
    """Print the converted parameters."""
    _check_options(options)
    converted = convert(options.source, options.values, options.to, **arguments_of(options, convert))
    below = [f"\n{converted.material}"] if converted.material else []
    show_results(options, converted, document=converted.document(), below=below)
    return 0


def _check_options(options: argparse.Namespace) -> None:
    if options.source == options.to and options.scale is None:
        raise SettingError(f"the values already are {options.to}; choose another --to, or a --scale")
    if options.error is not None and options.to != "opensees":
        raise SettingError("--error is of the solver of OpenSees; leave it out, or convert --to opensees")
    if options.scale is not None and options.to == "normalised":
        raise SettingError("--scale sets A or Ao, and normalised has neither; leave it out")
