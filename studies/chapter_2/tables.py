"""Every table of the study."""

from __future__ import annotations

from typing import Any

from mrwork.closed_loop import SCORE
from mrwork.report import Table
from studies.chapter_2.device_families import FAMILIES, column_height
from studies.common.table import table_of

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
    ordered = sorted(families.items(), key=lambda entry: entry[1][name]["judged"])
    groups = {family.name: family.group for family in FAMILIES}
    return Table(
        title=f"Ratios to the bare frame: {SETS[name].lower()}",
        columns=(
            "device",
            "group",
            "score",
            "peak drift",
            "peak acc.",
            "rms drift",
            "rms acc.",
            "worst peak",
        ),
        rows=tuple(
            (
                label,
                groups[label],
                f"{each[name]['judged']:.3f}",
                *(f"{each[name][criterion]:.3f}" for criterion in SCORE),
                f"{each[name]['worst_peak']:.3f}",
            )
            for label, each in ordered
        ),
    )


def _need_table() -> Table:
    return Table(
        title="What it takes to have one",
        columns=("device", "needs"),
        rows=tuple((family.name, family.needs) for family in FAMILIES),
    )


def _demand_table(families: dict[str, Any], name: str) -> Table:
    return table_of(
        f"Demand: {SETS[name].lower()}",
        "device",
        families,
        {
            "stroke [mm]": lambda each: f"{each[name]['stroke_mm']:.1f}",
            "force [N]": lambda each: f"{each[name]['force_n']:.0f}",
            "energy [%]": lambda each: f"{100.0 * each[name]['energy_share']:.0f}",
            "power taken [W]": lambda each: f"{each[name]['power_taken_w']:.0f}",
            "given [W]": lambda each: f"{each[name]['power_given_w']:.0f}",
            "energy error": lambda each: f"{each[name]['energy_error']:.0e}",
        },
    )


def _setting_table(families: dict[str, Any]) -> Table:
    return table_of(
        "Settings that were chosen",
        "device",
        families,
        {
            "tried": "{n_tried}",
            "score": "{score:.3f}",
            "chosen": lambda each: ", ".join(
                f"{name} {value:.3g}" for name, value in each["settings"].items()
            ),
        },
    )


def _closed_form_table(found: dict[str, Any]) -> Table:
    return table_of(
        "The loop beside the textbook",
        "case",
        found,
        {
            "loop": "{loop:.4g}",
            "formula": "{formula:.4g}",
            "deviation": lambda each: f"{100.0 * each['deviation']:+.2f} %",
            "formula in words": "{says}",
        },
    )


def findings(found: dict[str, Any]) -> list[str]:
    """What the tables come to, in sentences with numbers."""
    families = next(found[key] for key in ("families", "quick_families") if key in found)
    name = [each for each in SETS if each in next(iter(families.values()))][-1]
    groups = {family.name: family.group for family in FAMILIES}
    isolated = {label for label in families if "earings" in label}

    def best(group: str) -> str:
        labels = [label for label in families if groups[label] == group and label not in isolated]
        return min(labels, key=lambda label: families[label][name]["judged"])

    def score(label: str) -> str:
        return f"{families[label][name]['judged']:.3f}"

    viscous = "Viscous damper"
    better = [
        label
        for label in families
        if groups[label] == "semi-active"
        and label not in isolated
        and families[label][name]["judged"] < families[viscous][name]["judged"]
    ]
    worse = [label for label in families if families[label][name]["worst_peak"] > 1.0]
    return [
        f"Figures of this list: {SETS[name].lower()}.",
        "Isolation: "
        + ", ".join(
            f"{label} {score(label)} with {families[label][name]['stroke_mm']:.0f} mm of stroke"
            for label in sorted(isolated)
        )
        + ".",
        f"Without isolation {best('active')} has {score(best('active'))}, the best semi-active device "
        f"({best('semi-active')}) {score(best('semi-active'))}, the best passive one "
        f"({best('passive')}) {score(best('passive'))}.",
        f"{len(better)} of {sum(group == 'semi-active' for group in groups.values()) - 1} semi-active devices on the "
        f"fixed frame are better than a viscous damper ({score(viscous)})"
        + (f": {', '.join(better)}." if better else "."),
        "A peak under some motion is above that of the bare frame with: "
        + (", ".join(worse) or "no device")
        + ".",
        column_in_words()
        + f" The chosen column rises by {families['Liquid column, 2 %'][name]['stroke_mm']:.0f} mm.",
    ]


def column_in_words() -> str:
    """Size of the liquid column, in a sentence."""
    length, leg = column_height()
    return (
        f"At the frequency of the frame the liquid column is {1e3 * length:.0f} mm long, with legs of {1e3 * leg:.0f} "
        "mm: a liquid that rises further leaves them."
    )
