"""Scores of the laws as pictures: beside the baselines, and over the sample time."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from mrwork.report import style
from studies.chapter_6.conditions import CONDITIONS
from studies.chapter_6.loop_findings import TUNED_LAWS
from studies.chapter_6.tables import title_of
from studies.common.frame import LEVELS, level_name

_COLOURS = dict(zip(LEVELS, (style.MODEL, style.RESIDUAL), strict=True))
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
    with style.drawn_in_style():
        figure = Figure(figsize=(8.0, 0.27 * len(shown) + 0.9), layout="constrained")
        axes = figure.add_subplot()
        places = range(len(shown))
        for place, label in enumerate(shown):
            pair = [found[label][name]["score"] for name in names]
            axes.plot(pair, [place, place], color=style.RULE, linewidth=1.2, zorder=1)
        for level, name in zip(LEVELS, names, strict=True):
            axes.plot(
                [found[label][name]["score"] for label in shown],
                places,
                "o",
                color=_COLOURS[level],
                markersize=5.5,
                markeredgewidth=0.0,
                label=name,
            )
            axes.axvline(
                found["best constant"][name]["score"],
                color=_COLOURS[level],
                linewidth=0.8,
                linestyle=(0, (4, 3)),
            )
        axes.set_yticks(list(places), [title_of(label) for label in shown])
        for text, label in zip(axes.get_yticklabels(), shown, strict=True):
            text.set_color(style.INK if label in TUNED_LAWS else style.FAINT_INK)
        axes.grid(visible=True, axis="x")
        axes.grid(visible=False, axis="y")
        axes.set_ylim(-0.7, len(shown) - 0.3)
        axes.set_xlabel("Score over i = 0; dashed: best constant current")
        figure.legend(loc="outside upper right", ncols=2, handletextpad=0.2, borderaxespad=0.4)
    return figure


def sample_time_figure(found: dict[str, Any], level: float) -> Figure:
    """The score of a few laws over the controller's sample time."""
    timed = {
        condition.hardware.sample_time: condition.name
        for condition in CONDITIONS
        if condition.name == "reference" or condition.name.startswith("Ts")
    }
    times = sorted(timed)
    with style.drawn_in_style():
        figure = Figure(figsize=(style.PANEL_WIDTH, style.PANEL_HEIGHT + 0.9), layout="constrained")
        axes = figure.add_subplot()
        for law, tone in zip(_TIMED, _TONES, strict=True):
            scores = [found[law][timed[time]][level_name(level)]["score"] for time in times]
            axes.plot(
                [1e3 * time for time in times], scores, "o-", color=tone, markersize=4.5, label=title_of(law)
            )
        axes.set_xscale("log")
        axes.set_xticks([1e3 * time for time in times], [f"{1e3 * time:g}" for time in times])
        axes.minorticks_off()
        axes.set_xlabel("Sample time (ms)")
        axes.set_title(f"Score at {level_name(level)}", loc="left", pad=7)
        figure.legend(loc="outside lower center", ncols=1)
    return figure
