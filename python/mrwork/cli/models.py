"""`mrwork models`: the list of damper models, one of them in full, and parameters in other conventions."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from typing import Any, get_args

from mrwork.base.summary import list_names
from mrwork.base.table import Table
from mrwork.cli.command_parser import Collect, CommandParser, examples
from mrwork.cli.derived import add_option_of, arguments_of, read_entry
from mrwork.cli.number_texts import finite_number, named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import check_figure, print_result, show_results, write_figure
from mrwork.cli.own_models import is_own, own_model
from mrwork.dampers.conventions import NAMES, Convention, convert
from mrwork.dampers.simulation import LoopAmplitude, LoopFrequency
from mrwork.dampers.spec import PRESETS, DamperSpec, Preset, damper, damper_models, presets_by_force
from mrwork.errors import SettingError


def add_options(parser: CommandParser) -> None:
    """Declare the model or published set to show, the list of published sets, and the figure of a model."""
    conventions = "; ".join(f"{name}: {' '.join(parameters)}" for name, parameters in NAMES.items())
    parser.describe(
        f"With --to parameters of one convention become those of another that gives the same force. {conventions} "
        "(c0 is a dashpot in parallel). SI units."
    )
    parser.epilog = examples(
        "mrwork models --presets",
        "mrwork models normalised_bouc_wen --figure loops.svg",
        "mrwork models spencer alpha=1e5 A=120 n=2 gamma=1e6 beta=1e6 c0=5000 --to normalised",
        "mrwork models normalised k_w=680 rho=15500 sigma=0.5 n=2 --to opensees",
    )
    parser.add_argument(
        "name", nargs="?", metavar="NAME", help="model or published set to show, or convention of the values"
    )
    parser.add_argument(
        "values",
        nargs="*",
        action=Collect,
        type=partial(read_entry, finite_number, "NUMBER"),
        default={},
        metavar="NAME=VALUE",
        help="with --to, parameters, as in n=2",
    )
    presets = "list the published sets by the force that a damper is made for, of all models or of NAME"
    parser.add_argument("--presets", action="store_true", help=presets)
    figure = "draw the loops of the model with its nominal parameters, as an .svg or a .png file"
    parser.option("figure", "--figure", figure, named_path, metavar="FILE")
    add_option_of(parser, LoopAmplitude, "figure", "amplitude", default=0.015)
    add_option_of(parser, LoopFrequency, "figure", "frequency", default=2.5)
    to = "convert the values to spencer, normalised or opensees"
    parser.option("conversion", "--to", to, metavar="TO", choices=get_args(Convention))
    add_option_of(parser, convert, "conversion", "scale", metavar="VALUE")
    add_option_of(parser, convert, "conversion", "error", metavar="SHARE")
    end_parser(parser, run, quiet="")


def run(options: argparse.Namespace) -> int:
    """Print the list, the model, the published set or converted parameters; draw the figure of a model if requested."""
    if options.to is not None:
        return _convert(options)
    if options.values or options.scale is not None or options.error is not None:
        raise SettingError(
            "values, --scale and --error are of a conversion; give --to spencer, normalised or opensees, too"
        )
    named = [spec.preset(options.name) for spec in damper_models() if options.name in spec.presets]
    if named:
        names = [preset.spec.name for preset in named]
        if options.figure is not None:
            raise SettingError(
                f"--figure draws a model, and {options.name} is a published set of {list_names(names)}; name a model"
            )
        below = ["", *(f"The model in full: mrwork models {name}" for name in names)]
        show_results(options, *named, document=_as_document(named), below=below)
        return 0
    if options.presets:
        return _list_presets(options)
    if options.name is None:
        if options.figure is not None:
            raise SettingError(
                "--figure draws one model; name it, as in mrwork models bouc_wen --figure FILE"
            )
        models = damper_models()
        listed = Table(
            columns=("model", "parameters", "title"),
            rows=[(spec.name, str(len(spec.parameters)), spec.title) for spec in models],
        )
        print_result(options, {"models": [_as_dict(spec) for spec in models]}, "\n".join(listed.lines()))
        return 0
    spec = own_model(options.name) if is_own(options.name) else damper(options.name)
    if options.figure is not None:
        check_figure(options.figure)
        from mrwork.plots.of_tests import nominal_loops

        loops = nominal_loops(spec, amplitude=options.amplitude, frequency=options.frequency)
        write_figure(options.figure, loops)
    drawn = {} if options.figure is None else {"figure": str(options.figure)}
    follow = (
        "Any parameter can follow the command, constant, linear, quadratic, cubic or exponential: "
        f"mrwork identify FILE... --model {options.name} --law {spec.names[0]}=linear"
    )
    show_results(
        options,
        *(spec, *map(spec.preset, spec.presets)),
        document=_as_dict(spec) | drawn,
        below=["", follow, *(f"\nFigure: {path}" for path in drawn.values())],
    )
    return 0


def _convert(options: argparse.Namespace) -> int:
    if options.name not in get_args(Convention):
        was = "not given" if options.name is None else repr(options.name)
        raise SettingError(
            f"the convention of the values is {was}; name one of {list_names(get_args(Convention))} first, as in "
            "mrwork models spencer A=120 n=2 --to normalised"
        )
    if options.name == options.to and options.scale is None:
        raise SettingError(f"the values already are {options.to}; choose another --to, or a --scale")
    if options.error is not None and options.to != "opensees":
        raise SettingError("--error is of the solver of OpenSees; leave it out, or convert --to opensees")
    if options.scale is not None and options.to == "normalised":
        raise SettingError("--scale sets A or Ao, and normalised has neither; leave it out")
    converted = convert(options.name, options.values, options.to, **arguments_of(options, convert))
    below = [f"\n{converted.material}"] if converted.material else []
    show_results(options, converted, document=converted.document(), below=below)
    return 0


def _list_presets(options: argparse.Namespace) -> int:
    if options.figure is not None:
        raise SettingError(
            "--figure draws a model, and --presets lists published sets; leave one of both out"
        )
    models = damper_models() if options.name is None else (damper(options.name),)
    presets = presets_by_force(models)
    note = "Force and stroke to either side that one damper is made for; a study tells runs that exceed them."
    listed = Table.of(PRESETS, presets, note=note)
    print_result(options, _as_document(presets), "\n".join(listed.lines()))
    return 0


def _as_document(presets: Sequence[Preset]) -> dict[str, Any]:
    return {"presets": [asdict(preset) | {"force_class": preset.force_class or None} for preset in presets]}


def _as_dict(spec: DamperSpec) -> dict[str, Any]:
    entry = asdict(spec)
    # A model without current laws has the same parameters as its plain form.
    del entry["plain"]
    return entry | {"presets": [asdict(spec.preset(name)) for name in spec.presets]}
