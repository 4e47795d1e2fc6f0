"""Pages of the damper models, from their specifications."""

from __future__ import annotations

from generate.equations import tex
from generate.figures import LOOP_CAPTION, loop_words
from generate.markdown import code, directive, document, fenced, prose, table, toctree, unit
from mrwork.dampers import DamperSpec, damper_models
from mrwork.dampers.spec import PRESETS, presets_by_force


def model_pages() -> dict[str, str]:
    """Page of each model, and the list of all."""
    return {"index": _index(), **{spec.name: _page(spec) for spec in damper_models()}}


def _index() -> str:
    rows = [
        (
            f"[{prose(spec.title)}]({spec.name}.md)",
            code(spec.name),
            str(len(spec.parameters)),
            str(spec.n_states),
            ", ".join(map(code, spec.presets)),
        )
        for spec in damper_models()
    ]
    return document(
        "(damper-models)=\n# Damper models",
        "Each model gives the force $f$ on the motion $x$, $v = x'$ of the rod; the force resists the motion, so that "
        "$f v$ is dissipated power. Any parameter may follow the command: see `--law` of "
        "[`mrwork identify`](../verbs/identify.md).",
        table(("model", "name", "parameters", "states", "published sets"), rows),
        "(published-sets)=\n## Published sets by force",
        "As `mrwork models --presets` lists them, with the force and the stroke to either side that one damper is made "
        "for. A study takes a set by `preset`, `count` times.",
        table(
            [f"{each.heading} [{each.unit}]" if each.unit else each.heading for each in PRESETS],
            [[column.cell(each) for column in PRESETS] for each in presets_by_force(damper_models())],
        ),
        toctree(*(spec.name for spec in damper_models()), hidden=""),
    )


def _page(spec: DamperSpec) -> str:
    return document(
        f"(model-{spec.name})=\n# {prose(spec.title)}",
        f"Name: {code(spec.name)}",
        prose(spec.description),
        "## Equations",
        directive("math", "", tex(spec.equation, spec.names)),
        f"Source: {prose(spec.source)}",
        "## Parameters",
        table(
            ("parameter", "meaning", "unit", "nominal", "lower", "upper", "scale"),
            [
                (
                    f"${tex(each.name, spec.names)}$ {code(each.name)}",
                    prose(each.description),
                    unit(each.unit),
                    f"{each.nominal:g}",
                    f"{each.lower:g}",
                    f"{each.upper:g}",
                    each.scale,
                )
                for each in spec.parameters
            ],
        ),
        f"Nominal values: {prose(spec.nominal_source)}",
        "## Hysteresis loop",
        directive(
            "figure", f"../figures/{spec.name}.svg", prose(LOOP_CAPTION), alt=loop_words(spec), width="100%"
        ),
        _published(spec),
        "## Use",
        fenced(
            "console",
            f"$ mrwork models {spec.name} --figure loops.svg\n$ mrwork identify FILE... --model {spec.name}",
        ),
    )


def _published(spec: DamperSpec) -> str:
    """The published sets of a model, each with its values and source."""
    sections = []
    for name in spec.presets:
        preset = spec.preset(name)
        command_unit = preset.spec.command_unit
        note = f" {preset.note[:1].upper()}{preset.note[1:]}." if preset.note else ""
        command = f", command 0 to {preset.largest_command:g} {command_unit}" if command_unit else ""
        rated = f", rated force {preset.rated_force:.0f} N" if preset.rated_force else ""
        rated += f", rated stroke {1e3 * preset.rated_stroke:g} mm" if preset.rated_stroke else ""
        sections += [
            f"### {code(name)}",
            prose(f"{preset.source}; {preset.status}{command}{rated}.{note}"),
            table(
                ("parameter", "value", "unit"),
                [
                    (code(each.name), f"{value:g}", unit(each.unit))
                    for each, value in zip(preset.spec.parameters, preset.theta, strict=True)
                ],
            ),
        ]
    return document("## Published sets", *sections).rstrip() if sections else ""
