"""`mrwork models`: the list of damper models, or one of them in full."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import Any

from mrwork.cli.options import add_json
from mrwork.cli.output import print_json
from mrwork.cli.terminal import show
from mrwork.dampers.spec import DamperSpec, Preset, damper, damper_models
from mrwork.summary import aligned


def add_parser(verbs: Any) -> None:
    """Declare the verb."""
    parser = verbs.add_parser("models", description="List the damper models, or show one in full.")
    parser.add_argument("name", nargs="?", metavar="NAME", help="model to show")
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the list or the model."""
    if options.name is None:
        if options.json:
            print_json({"models": [_as_dict(spec) for spec in damper_models()]})
            return 0
        listed = [(spec.name, f"{len(spec.parameters)} parameters", spec.title) for spec in damper_models()]
        show("\n".join(aligned(listed)))
        return 0
    spec = damper(options.name)
    if options.json:
        print_json(_as_dict(spec))
    else:
        show(_in_full(spec))
    return 0


def _as_dict(spec: DamperSpec) -> dict[str, Any]:
    entry = asdict(spec)
    # A model without current laws has the same parameters as its plain form.
    del entry["plain"]
    return entry | {"presets": [asdict(spec.preset(name)) for name in spec.presets]}


def _in_full(spec: DamperSpec) -> str:
    lines = [spec.title, "=" * len(spec.title), ""]
    lines += [f"  {line}" for line in spec.equation.splitlines()]
    lines += ["", spec.description, "", f"Source:  {spec.source}", f"Nominal: {spec.nominal_source}", ""]
    rows = [("parameter", "unit", "nominal", "lower", "upper", "scale", "meaning")]
    rows += [
        (p.name, p.unit, f"{p.nominal:g}", f"{p.lower:g}", f"{p.upper:g}", p.scale, p.description)
        for p in spec.parameters
    ]
    lines += aligned(rows)
    for name in spec.presets:
        lines += ["", *_preset_lines(spec.preset(name))]
    lines += [
        "",
        "Any parameter can follow the command, constant, linear, quadratic, cubic or exponential: "
        f"mrwork identify FILE... --model {spec.name} --law {spec.names[0]}=linear",
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
