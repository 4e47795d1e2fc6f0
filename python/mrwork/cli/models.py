"""`mrwork models`: the list of damper models, or one of them in full."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from mrwork.base.summary import list_names
from mrwork.base.table import Table
from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.derived import add_option_of
from mrwork.cli.numbers import named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import check_figure, print_result, show_results, write_figure
from mrwork.cli.own_models import is_own, own_model
from mrwork.dampers.simulation import LoopAmplitude, LoopFrequency
from mrwork.dampers.spec import PRESETS, DamperSpec, Preset, damper, damper_models, presets_by_force
from mrwork.errors import SettingError


def add_options(parser: CommandParser) -> None:
    """Declare the model or published set to show, the list of published sets, and the figure of a model."""
    parser.description = "List the damper models or their published sets, or show one of them in full."
    parser.epilog = examples(
        "mrwork models --presets", "mrwork models normalised_bouc_wen --figure loops.svg"
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="model or published set to show")
    presets = "list the published sets by the force that a damper is made for, of all models or of NAME"
    parser.add_argument("--presets", action="store_true", help=presets)
    figure = "draw the loops of the model with its nominal parameters, as an .svg or a .png file"
    parser.option("figure", "--figure", figure, named_path, metavar="FILE")
    add_option_of(parser, LoopAmplitude, "figure", "amplitude", default=0.015)
    add_option_of(parser, LoopFrequency, "figure", "frequency", default=2.5)
    end_parser(parser, run, quiet="")


def run(options: argparse.Namespace) -> int:
    """Print the list, the model or the published set, and draw the figure of a model if requested."""
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
