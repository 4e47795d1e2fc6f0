"""`mrwork convert`: Bouc-Wen parameters from one convention to another that gives the same force."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import get_args

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.numbers import SCALE, add_number, add_opensees_error
from mrwork.cli.options import end_parser, parsed_number
from mrwork.cli.output import show_results
from mrwork.dampers.conventions import NAMES, Convention, convert
from mrwork.dampers.conversions import USUAL_OPENSEES_ERROR
from mrwork.errors import SettingError


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
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
    conversion = parser.group("conversion")
    conversion.add_argument(
        "--to",
        required=True,
        choices=get_args(Convention),
        metavar="TO",
        help="spencer, normalised or opensees",
    )
    parser.add_argument("values", nargs="+", metavar="NAME=VALUE", help="parameters, as in n=2")
    add_number(
        conversion,
        "--scale",
        SCALE,
        "A of spencer or Ao of opensees, a scale that does not affect the force; default: that of the source, 120 "
        "from normalised, Ao 1",
        metavar="VALUE",
    )
    add_opensees_error(conversion)
    end_parser(parser, run, quiet="")


def run(options: argparse.Namespace) -> int:
    """Print the converted parameters."""
    _check_options(options)
    converted = convert(
        options.source,
        _parse(options.values),
        options.to,
        scale=options.scale,
        error=options.error or USUAL_OPENSEES_ERROR,
    )
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


def _parse(texts: Sequence[str]) -> dict[str, float]:
    values: dict[str, float] = {}
    for text in texts:
        name, equals, number = text.partition("=")
        if not (name and equals):
            raise SettingError(f"{text!r} is not NAME=VALUE; write it as in n=2")
        if name in values:
            raise SettingError(f"{name} is given twice; give it once")
        values[name] = parsed_number(number, text)
    return values
