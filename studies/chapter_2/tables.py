"""Every table of the study."""

from __future__ import annotations

from typing import Any

from mrwork.report import Table
from studies.chapter_2.device_families import FAMILIES, column_height
from studies.former.scores import TITLES
from studies.former.table import alike, table_of

SETS = {"synthetic": "Two synthetic motions", "measured": "Four measured records"}


def tables(found: dict[str, Any]) -> dict[str, tuple[Table, ...]]:
    """Tables by the section that they belong to."""
    families = next(found[key] for key in ("families", "quick_families") if key in found)
    sets = [name for name in SETS if name in next(iter(families.values()))]
    return {
        "responses": tuple(_response_table(families, name) for name in sets),
        "needs": (*(_demand_table(families, name) for name in sets), _need_table()),
        "settings": (_setting_table(families),),
        "closed_forms": (_closed_form_table(found["closed_forms"]),),
    }


def _response_table(families: dict[str, Any], name: str) -> Table:
    groups = {family.name: family.group for family in FAMILIES}
    rows = {label: {"group": groups[label], **figures[name]} for label, figures in families.items()}
    ratios = {title: name for name, title in TITLES.items()}
    return table_of(
        f"Ratios to the bare frame: {SETS[name].lower()}",
        "device",
        sorted(rows.items(), key=lambda row: row[1]["judged"]),
        {"group": "{group}", **alike(".3f", {"score": "judged", **ratios, "worst peak": "worst_peak"})},
    )


def _need_table() -> Table:
    needs = {family.name: family.needs for family in FAMILIES}
    return table_of("What it takes to have one", "device", needs, {"needs": "{}"})


def _demand_table(families: dict[str, Any], name: str) -> Table:
    return table_of(
        f"Demand: {SETS[name].lower()}",
        "device",
        {label: figures[name] for label, figures in families.items()},
        {
            "stroke [mm]": "{stroke_mm:.1f}",
            "force [N]": "{force_n:.0f}",
            "energy [%]": lambda figures: f"{100.0 * figures['energy_share']:.0f}",
            "power taken [W]": "{power_taken_w:.0f}",
            "given [W]": "{power_given_w:.0f}",
            "energy error": "{energy_error:.0e}",
        },
    )


def _setting_table(families: dict[str, Any]) -> Table:
    def chosen(figures: dict[str, Any]) -> str:
        return ", ".join(f"{name} {value:.3g}" for name, value in figures["settings"].items())

    columns = {"tried": "{n_tried}", "score": "{score:.3f}", "chosen": chosen}
    return table_of("Settings that were chosen", "device", families, columns)


def _closed_form_table(found: dict[str, Any]) -> Table:
    return table_of(
        "The loop beside the textbook",
        "case",
        found,
        {
            "loop": "{loop:.4g}",
            "formula": "{formula:.4g}",
            "deviation": lambda form: f"{100.0 * form['deviation']:+.2f} %",
            "formula in words": "{says}",
        },
    )


def findings(found: dict[str, Any]) -> list[str]:
    """What the tables come to, in sentences with numbers."""
    families = next(found[key] for key in ("families", "quick_families") if key in found)
    name = [name for name in SETS if name in next(iter(families.values()))][-1]
    figures = {label: family[name] for label, family in families.items()}
    isolated = {label for label in families if "earings" in label}
    fixed: dict[str, list[str]] = {}
    for family in FAMILIES:
        if family.name not in isolated:
            fixed.setdefault(family.group, []).append(family.name)
    best = {group: min(labels, key=lambda label: figures[label]["judged"]) for group, labels in fixed.items()}

    def score(label: str) -> str:
        return f"{figures[label]['judged']:.3f}"

    viscous = "Viscous damper"
    better = [
        label for label in fixed["semi-active"] if figures[label]["judged"] < figures[viscous]["judged"]
    ]
    worse = [label for label in families if figures[label]["worst_peak"] > 1.0]
    strokes = [
        f"{label} {score(label)} with {figures[label]['stroke_mm']:.0f} mm of stroke"
        for label in sorted(isolated)
    ]
    length, leg = column_height()
    return [
        f"Figures of this list: {SETS[name].lower()}.",
        f"Isolation: {', '.join(strokes)}.",
        f"Without isolation {best['active']} has {score(best['active'])}, the best semi-active device "
        f"({best['semi-active']}) {score(best['semi-active'])}, the best passive one "
        f"({best['passive']}) {score(best['passive'])}.",
        f"{len(better)} of {len(fixed['semi-active'])} semi-active devices on the "
        f"fixed frame are better than a viscous damper ({score(viscous)})"
        + (f": {', '.join(better)}." if better else "."),
        f"A peak under some motion is above that of the bare frame with: {', '.join(worse) or 'no device'}.",
        f"At the frequency of the frame the liquid column is {1e3 * length:.0f} mm long, with legs of {1e3 * leg:.0f} "
        "mm: a liquid that rises further leaves them. The chosen column rises by "
        f"{figures['Liquid column, 2 %']['stroke_mm']:.0f} mm.",
    ]
