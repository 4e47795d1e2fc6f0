"""`mrwork models`: the list of damper models, or one of them in full."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import Any

from mrwork.base.summary import align_rows
from mrwork.base.table import TableColumn, text_table
from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.numbers import AMPLITUDE, FREQUENCY, add_number, named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import print_json
from mrwork.cli.own_models import is_own, own_model
from mrwork.cli.terminal import show
from mrwork.dampers.spec import DamperSpec, Preset, damper, damper_models
from mrwork.errors import SettingError
from mrwork.store.output_file import replacing
from mrwork.store.run_folder import check_output

_PARAMETER_COLUMNS = (
    TableColumn(heading="parameter", cell=lambda each: each.name),
    TableColumn(heading="unit", cell=lambda each: each.unit),
    TableColumn(heading="nominal", cell=lambda each: f"{each.nominal:g}"),
    TableColumn(heading="lower", cell=lambda each: f"{each.lower:g}"),
    TableColumn(heading="upper", cell=lambda each: f"{each.upper:g}"),
    TableColumn(heading="scale", cell=lambda each: each.scale),
    TableColumn(heading="meaning", cell=lambda each: each.description),
)


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
    parser.description = "List the damper models, or show one in full."
    parser.epilog = examples("mrwork models", "mrwork models normalised_bouc_wen --figure loops.svg")
    parser.add_argument("name", nargs="?", metavar="NAME", help="model to show")
    figure = parser.group("figure")
    figure.add_argument(
        "--figure",
        type=named_path,
        metavar="FILE",
        help="draw the loops of the model with its nominal parameters, as an .svg or a .png file",
    )
    add_number(figure, "--amplitude", AMPLITUDE, "of the motion of the figure", metavar="M", default=0.015)
    add_number(figure, "--frequency", FREQUENCY, "of the motion of the figure", metavar="HZ", default=2.5)
    end_parser(parser, run, quiet="")


def run(options: argparse.Namespace) -> int:
    """Print the list or the model, and draw its figure if requested."""
    if options.name is None:
        if options.figure is not None:
            raise SettingError(
                "--figure draws one model; name it, as in mrwork models bouc_wen --figure FILE"
            )
        if options.json:
            print_json({"models": [_as_dict(spec) for spec in damper_models()]})
            return 0
        listed = [(spec.name, f"{len(spec.parameters)} parameters", spec.title) for spec in damper_models()]
        show("\n".join(align_rows(listed)))
        return 0
    spec = own_model(options.name) if is_own(options.name) else damper(options.name)
    if options.figure is not None:
        _write_figure(spec, options)
    if options.json:
        drawn = {} if options.figure is None else {"figure": str(options.figure)}
        print_json(_as_dict(spec) | drawn)
    else:
        show(
            _in_full(options.name, spec) + ("" if options.figure is None else f"\n\nFigure: {options.figure}")
        )
    return 0


def _write_figure(spec: DamperSpec, options: argparse.Namespace) -> None:
    suffix = options.figure.suffix.lower()
    if suffix not in (".svg", ".png"):
        raise SettingError(f"--figure {options.figure} ends with {suffix or 'nothing'}; give .svg or .png")
    check_output(options.figure, replace=True, otherwise="")
    from mrwork.plots.canvas import png_bytes, svg_bytes
    from mrwork.plots.of_dampers import nominal_loops

    figure = nominal_loops(spec, amplitude=options.amplitude, frequency=options.frequency)
    with replacing(options.figure) as stream:
        stream.write(svg_bytes(figure) if suffix == ".svg" else png_bytes(figure))


def _as_dict(spec: DamperSpec) -> dict[str, Any]:
    entry = asdict(spec)
    # A model without current laws has the same parameters as its plain form.
    del entry["plain"]
    return entry | {"presets": [asdict(spec.preset(name)) for name in spec.presets]}


def _in_full(name: str, spec: DamperSpec) -> str:
    lines = [spec.title, "=" * len(spec.title), ""]
    lines += [f"  {line}" for line in spec.equation.splitlines()]
    lines += ["", spec.description, "", f"Source:  {spec.source}", f"Nominal: {spec.nominal_source}", ""]
    lines += text_table(_PARAMETER_COLUMNS, spec.parameters).lines()
    for each in spec.presets:
        lines += ["", *_preset_lines(spec.preset(each))]
    lines += [
        "",
        "Any parameter can follow the command, constant, linear, quadratic, cubic or exponential: "
        f"mrwork identify FILE... --model {name} --law {spec.names[0]}=linear",
    ]
    return "\n".join(lines)


def _preset_lines(preset: Preset) -> list[str]:
    note = f" ({preset.note})" if preset.note else ""
    current = preset.spec.current
    command = f", command 0 to {preset.largest_command:g} {current.unit}" if current is not None else ""
    values = ", ".join(
        f"{parameter.name} = {value:g} {parameter.unit if parameter.unit != '1' else ''}".rstrip()
        for parameter, value in zip(preset.spec.parameters, preset.theta, strict=True)
    )
    return [f"Preset {preset.name}, {preset.status}{command}: {preset.source}{note}", f"  {values}"]
