"""`mrwork convert`: Bouc-Wen parameters from one convention to another that gives the same force."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import Literal, get_args

import numpy as np

from mrwork.base.keys import suggestion
from mrwork.base.values import Floats
from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.numbers import SCALE, add_number, add_opensees_error
from mrwork.cli.options import end_parser, parsed_number
from mrwork.cli.output import print_json
from mrwork.cli.terminal import show
from mrwork.dampers.conversions import (
    USUAL_OPENSEES_ERROR,
    OpenSeesBoucWen,
    bouc_wen_from_normalised,
    bouc_wen_from_opensees,
    convention_remarks,
    normalised_from_bouc_wen,
    opensees_from_bouc_wen,
    require_bounded_loop,
    rescaled_bouc_wen,
    solver_remarks,
)
from mrwork.dampers.spec import damper
from mrwork.errors import SettingError

Convention = Literal["spencer", "normalised", "opensees"]

_SPENCER = damper("bouc_wen").names
_NORMALISED = damper("normalised_bouc_wen").names
_OPENSEES = ("alpha", "ko", "n", "gamma", "beta", "Ao", "deltaA", "deltaNu", "deltaEta", "c0")
_NAMES: dict[Convention, tuple[str, ...]] = {
    "spencer": _SPENCER,
    "normalised": _NORMALISED,
    "opensees": _OPENSEES,
}
# Parameters that are zero by default.
_OPTIONAL = ("c0", "k0", "x0", "c", "k", "deltaA", "deltaNu", "deltaEta")


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
    parser.description = (
        "Convert Bouc-Wen parameters to another convention that gives the same force. "
        f"spencer: {' '.join(_SPENCER)}; normalised: {' '.join(_NORMALISED)}; opensees: {' '.join(_OPENSEES)} "
        "(c0 is a dashpot in parallel). SI units."
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
    theta = _spencer(options.source, _parse(options.source, options.values), options.scale)
    converted, remarks = _convert_parameters(
        options.to, theta, options.scale, options.error or USUAL_OPENSEES_ERROR
    )
    if options.source != "normalised":
        remarks = (*convention_remarks(theta), *remarks)
    if options.json:
        print_json({"convention": options.to, "parameters": converted, "remarks": list(remarks)})
        return 0
    units = dict.fromkeys(converted, "") | _units(options.to)
    width = max(map(len, converted))
    for name, value in converted.items():
        show(f"{name:<{width}}  {value:.12g}  {units[name]}".rstrip())
    if options.to == "opensees":
        arguments = " ".join(f"{converted[name]:.12g}" for name in _OPENSEES if name != "c0")
        show(f"\nuniaxialMaterial BoucWen $tag {arguments}")
        if converted["c0"]:
            show(f"uniaxialMaterial Viscous $tag {converted['c0']:.12g} 1  ;# in parallel")
    for remark in remarks:
        show(f"note: {remark}")
    return 0


def _check_options(options: argparse.Namespace) -> None:
    if options.source == options.to and options.scale is None:
        raise SettingError(f"the values already are {options.to}; choose another --to, or a --scale")
    if options.error is not None and options.to != "opensees":
        raise SettingError("--error is of the solver of OpenSees; leave it out, or convert --to opensees")
    if options.scale is not None and options.to == "normalised":
        raise SettingError("--scale sets A or Ao, and normalised has neither; leave it out")


def _parse(convention: Convention, texts: list[str]) -> dict[str, float]:
    names = _NAMES[convention]
    values: dict[str, float] = {}
    for text in texts:
        name, equals, number = text.partition("=")
        if not (name and equals):
            raise SettingError(f"{text!r} is not NAME=VALUE; write it as in n=2")
        if name not in names:
            near = suggestion(name, names, otherwise="it has")
            raise SettingError(f"{convention} has no parameter {name!r}{near}")
        if name in values:
            raise SettingError(f"{name} is given twice; give it once")
        values[name] = parsed_number(number, text)
    missing = [name for name in names if name not in values and name not in _OPTIONAL]
    if missing:
        raise SettingError(f"{convention} also needs {', '.join(missing)}; give each as NAME=VALUE")
    return {name: values.get(name, 0.0) for name in names}


def _spencer(convention: Convention, values: dict[str, float], scale: float | None) -> Floats:
    """The given parameters as those of `bouc_wen`, shape (8,)."""
    if convention == "opensees":
        c0 = values.pop("c0")
        return bouc_wen_from_opensees(OpenSeesBoucWen(**values), c0=c0)
    theta = np.array(list(values.values()))
    if convention == "spencer":
        return theta
    for name in ("k_w", "rho", "sigma"):
        if values[name] <= 0.0:
            raise SettingError(f"{name} is {values[name]:g}; it must be positive for the loop to dissipate")
    nominal = damper("bouc_wen").nominal[_SPENCER.index("A")]
    spencer: Floats = bouc_wen_from_normalised(theta, A=nominal if scale is None else scale)
    return spencer


def _convert_parameters(
    convention: Convention, theta: Floats, scale: float | None, error: float
) -> tuple[dict[str, float], tuple[str, ...]]:
    """The parameters in a convention, and remarks on their use."""
    if convention == "opensees":
        material, c0 = opensees_from_bouc_wen(theta, Ao=1.0 if scale is None else scale)
        return asdict(material) | {"c0": c0}, solver_remarks(material, error)
    if convention == "normalised":
        require_bounded_loop(theta)
        return dict(zip(_NORMALISED, normalised_from_bouc_wen(theta).tolist(), strict=True)), ()
    spencer = theta if scale is None else rescaled_bouc_wen(theta, scale)
    return dict(zip(_SPENCER, spencer.tolist(), strict=True)), ()


def _units(convention: Convention) -> dict[str, str]:
    if convention == "opensees":
        return {"ko": "N/m", "gamma": "m^-n", "beta": "m^-n", "c0": "N s/m, in parallel"}
    spec = damper("bouc_wen" if convention == "spencer" else "normalised_bouc_wen")
    return {parameter.name: parameter.unit for parameter in spec.parameters if parameter.unit != "1"}
