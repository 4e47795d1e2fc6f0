"""The page of the study, with scores beside the baselines and over the sample time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from mrwork.report import Panel, panel, response_sheet_figure, style
from studies.chapter_6.conditions import CONDITIONS
from studies.chapter_6.loop_findings import TUNED_LAWS
from studies.chapter_6.tables import remarks, tables, title_of
from studies.chapter_6.thesis_findings import CONSTANT, LYAPUNOV, SHOWN, sheets_at
from studies.chapter_6.thesis_tables import thesis_tables
from studies.former.frame import FRAME, LEVELS, Bench, bench, level_name, record_title
from studies.former.page import panels, swatch, write_chapter_page

_BASELINES = ("best constant", "i_max")
_TIMED = (
    "inverse_direct",
    "modified_clipped_optimal",
    "clipped_optimal",
    "lyapunov_direct",
    "maximum_energy_dissipation",
    "super_twisting",
)
_TONES = (style.MODEL, style.RESIDUAL, style.INK, style.PARAMETER_BAND, style.DATA, style.BAND_EDGE)


@style.drawn_in_style()
def score_figure(found: dict[str, Any]) -> Figure:
    """A dot for each row and level, best on top; what is no control law is written in a fainter ink."""
    names = [level_name(level) for level in LEVELS]
    # i = 0 is 1 by definition and would only widen the axis; so would what dampers are not compared with.
    shown = [
        label
        for label in found
        if label in (*TUNED_LAWS, *_BASELINES) or "damper" in label or "active" in label
    ]
    shown.sort(key=lambda label: sum(found[label][name]["score"] for name in names), reverse=True)
    figure = Figure(figsize=(8.0, 0.27 * len(shown) + 0.9), layout="constrained")
    axes = figure.add_subplot()
    places = range(len(shown))
    for place, label in enumerate(shown):
        pair = [found[label][name]["score"] for name in names]
        axes.plot(pair, [place, place], color=style.RULE, linewidth=1.2, zorder=1)
    for name, colour in zip(names, (style.MODEL, style.RESIDUAL), strict=True):
        scores = [found[label][name]["score"] for label in shown]
        axes.plot(scores, places, "o", color=colour, markersize=5.5, markeredgewidth=0.0, label=name)
        best = found["best constant"][name]["score"]
        axes.axvline(best, color=colour, linewidth=0.8, linestyle=(0, (4, 3)))
    axes.set_yticks(list(places), [title_of(label) for label in shown])
    for text, label in zip(axes.get_yticklabels(), shown, strict=True):
        text.set_color(style.INK if label in TUNED_LAWS else style.FAINT_INK)
    axes.grid(visible=True, axis="x")
    axes.grid(visible=False, axis="y")
    axes.set_ylim(-0.7, len(shown) - 0.3)
    axes.set_xlabel("Score over i = 0; dashed: best constant current")
    figure.legend(loc="outside upper right", ncols=2, handletextpad=0.2, borderaxespad=0.4)
    return figure


@style.drawn_in_style()
def sample_time_figure(found: dict[str, Any], level: str) -> Figure:
    """The score of a few laws over the controller's sample time."""
    timed = {
        1e3 * condition.hardware.sample_time: condition.name
        for condition in CONDITIONS
        if condition.name == "reference" or condition.name.startswith("Ts")
    }
    times = sorted(timed)
    figure = Figure(figsize=(style.PANEL_WIDTH, style.PANEL_HEIGHT + 0.9), layout="constrained")
    axes = figure.add_subplot()
    for law, tone in zip(_TIMED, _TONES, strict=True):
        scores = [found[law][timed[time]][level]["score"] for time in times]
        axes.plot(times, scores, "o-", color=tone, markersize=4.5, label=title_of(law))
    axes.set_xscale("log")
    axes.set_xticks(times, [f"{time:g}" for time in times])
    axes.minorticks_off()
    axes.set_xlabel("Sample time (ms)")
    axes.set_title(f"Score at {level}", loc="left", pad=7)
    figure.legend(loc="outside lower center", ncols=1)
    return figure


_FORM_OF = {law: "6.3 to 6.6" if law == LYAPUNOV else "6.7 to 6.10" for law in SHOWN}


def write_page(found: dict[str, Any], path: Path, *, levels: Sequence[str], records: Path) -> None:
    """Write every table and the figures; sheets and tables of every floor at these levels."""
    over = bench(records)
    scores, *times = panels(
        "scores",
        (
            (
                "Scores, settings tuned at each level",
                score_figure(found["five_storeys"]),
                "Score of every law at both levels, beside the best constant current",
            ),
            *(
                (
                    f"Sample time, {level}",
                    sample_time_figure(found["conditions"], level),
                    f"Score of six laws over the sample time at {level}",
                )
                for level in map(level_name, LEVELS)
            ),
        ),
    )
    write_chapter_page(
        Path(__file__).parent,
        path,
        scores=scores,
        times=times,
        tables=list(tables(found)),
        sheets=[
            {"level": name, "panels": _sheets(over, level, found["five_storeys"][CONSTANT][name]["current"])}
            for level, name in enumerate(map(level_name, LEVELS))
            if name in levels
        ],
        key={"controlled": swatch(style.MODEL, "line"), "without": swatch(style.INK, "dotted")},
        thesis=thesis_tables(found, levels),
        draws=found["identified"]["draws"],
        offset={name: found["identified"]["parameters"][name]["truth"] for name in ("f0.0", "f0.1")},
        remarks=list(remarks(found)),
    )


def _sheets(over: Bench, level: int, constant: float) -> list[Panel]:
    """A sheet for each record and each law, side by side."""
    return [
        panel(
            f"sheet-{level}-{sheet.label}-{sheet.record}",
            f"{record_title(sheet.record)}: {title_of(sheet.label)}",
            response_sheet_figure(sheet.controlled, sheet.reference, FRAME),
            f"Ground, current, force, Lyapunov function and motion of floor 1 under {record_title(sheet.record)} at "
            f"{level_name(LEVELS[level])}: {title_of(sheet.label)}, and without control",
            note=f"In the form of figures {_FORM_OF[sheet.label]}.",
        )
        for sheet in sheets_at(over, level, constant)
        if sheet.label in SHOWN
    ]
