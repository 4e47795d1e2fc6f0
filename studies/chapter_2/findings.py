"""What the study finds: the parts that the page draws, and every figure as nested dictionaries."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from studies.chapter_2.device_closed_forms import closed_forms
from studies.chapter_2.device_families import column_height
from studies.chapter_2.family_bench import Judged, judged_families


@dataclass(frozen=True, slots=True, kw_only=True)
class Chapter:
    """The families with their loops, and every figure of the study."""

    families: dict[str, Judged]
    found: dict[str, Any]


def chapter_of(*, quick: bool, threads: int, say: Callable[[str], None]) -> Chapter:
    """Work everything out; the quick form tries few settings under one short motion."""
    say("closed forms")
    forms = {
        name: {"loop": each.loop, "formula": each.formula, "deviation": each.deviation, "says": each.says}
        for name, each in closed_forms().items()
    }
    families = judged_families(quick=quick, threads=threads, say=say)
    figures = {
        name: {**each.figures, "n_tried": len(each.tried) * max(1, each.n_weights)}
        for name, each in families.items()
    }
    length, leg = column_height()
    found = {
        "closed_forms": forms,
        "column": {"length_mm": 1e3 * length, "leg_mm": 1e3 * leg},
        "quick_families" if quick else "families": figures,
    }
    return Chapter(families=families, found=found)
