"""The page of the study with its figures."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes

from mrwork.report import SMALL, WIDE, finish, style
from studies.chapter_2.device_families import FAMILIES
from studies.chapter_2.findings import Chapter, Judged
from studies.chapter_2.tables import SETS, findings, tables
from studies.former.page import drawn, finish_loop, panels, write_chapter_page

_TONES = {"passive": style.DATA, "semi-active": style.MODEL, "active": style.RESIDUAL}
# The setting over which a passive device is drawn, where it is one number.
_DRAWN = {
    "Viscous damper": ("damping [N s/m]", "Damping (N s/m)"),
    "Friction damper (Pall)": ("slip load / weight", "Slip load over weight"),
    "Lead-rubber bearings": ("strength of the lead / weight", "Strength of the lead over weight"),
    "Liquid column, 2 %": ("design rms velocity [m/s]", "RMS velocity of the design (m/s)"),
    "Resettable stiffness": ("stiffness / storey", "Stiffness over that of the storey"),
}


@drawn(WIDE)
def trade_figure(axes: Axes, families: dict[str, Judged], name: str) -> None:
    """Ratios of peak acceleration over those of peak drift, a point for each family."""
    for number, family in enumerate(FAMILIES, start=1):
        figures = families[family.name].figures[name]
        x, y = figures["peak_drift"], figures["peak_acceleration"]
        axes.plot(x, y, "o", color=_TONES[family.group], markersize=5)
        axes.annotate(
            f"{number}",
            (x, y),
            # Below where isolated frames would cover each other.
            xytext=(5, -9 if family.name == "Lead-rubber bearings" else 2),
            textcoords="offset points",
            fontsize=style.SMALL_TEXT_SIZE,
        )
    for group, tone in _TONES.items():
        axes.plot([], [], "o", color=tone, label=group)
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="upper left")
    finish(axes, "Peak acceleration over that of the bare frame", "Peak drift over that of the bare frame")


@drawn(SMALL)
def setting_figure(axes: Axes, label: str, judged: Judged) -> None:
    """Score under the motions that choose, over the setting of a device."""
    key, name = _DRAWN[label]
    tried = sorted((settings[key], score) for settings, score in judged.tried)
    axes.plot([x for x, _ in tried], [y for _, y in tried], "o-", color=style.MODEL, markersize=3.5)
    axes.set_ylim(bottom=0.0)
    finish(axes, "Score", name)
    axes.set_xscale("log")


@drawn(SMALL)
def loop_figure(axes: Axes, judged: Judged) -> None:
    """Force over elongation of the device under the first motion that judges."""
    axes.plot(1e3 * judged.loop.deformation, judged.loop.force, color=style.MODEL, linewidth=0.6)
    finish_loop(axes, over_velocity=False)


def write_page(chapter: Chapter, path: Path) -> None:
    """Write figures and tables, a section for each part."""
    families = chapter.families
    sets = [name for name in SETS if name in next(iter(families.values())).figures]
    write_chapter_page(
        Path(__file__).parent,
        path,
        tables=tables(chapter.found),
        trades=panels(
            "trade", ((SETS[name], trade_figure(families, name), f"{SETS[name]}: families") for name in sets)
        ),
        numbers=[(number, family.name) for number, family in enumerate(FAMILIES, start=1)],
        settings=panels(
            "setting",
            (
                (label, setting_figure(label, families[label]), f"Score of {label} over its setting")
                for label in _DRAWN
            ),
        ),
        loops=panels(
            "loop",
            (
                (label, loop_figure(judged), f"Force over elongation: {label}")
                for label, judged in families.items()
            ),
        ),
        findings=findings(chapter.found),
    )
