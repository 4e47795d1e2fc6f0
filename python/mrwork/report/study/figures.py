"""Figures of a study's page with their sections: profiles, energies, histories and loops, spread over motions."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.base.numbers import format_fixed, significant
from mrwork.base.table import Table
from mrwork.base.values import Floats
from mrwork.drawing import style
from mrwork.drawing.canvas import (
    column_axes,
    finish,
    legend,
    name_rows,
    name_small_axes,
    plain_ticks,
    room_for,
    small_axes,
    symmetric,
    vertical_grid,
)
from mrwork.drawing.of_studies import (
    Stroke,
    add_energies,
    add_energy_bars,
    energy_parts,
    short,
)
from mrwork.drawing.of_tests import envelope, strong_part
from mrwork.drawing.style import DisplayUnit
from mrwork.report.section import Group, Section, panel
from mrwork.study.comparison import (
    StudyComparison,
    chosen_in_words,
    judged_in_words,
    motion_groups,
    times_better,
)
from mrwork.study.results import StudyResults
from mrwork.study.run_result import RunHistory
from mrwork.study.study import uses_in_words
from mrwork.study.tables import ShownRows, group_table, spread_table

_BAR = 0.30


@style.drawn_in_style()
def energy_figure(results: StudyResults, motion: int, rows: Collection[int]) -> Figure:
    """Distribution of the input energy at the end of the motion, a bar for each of the rows."""
    shown = [row for row in results.finished_rows(motion) if row in rows]
    names = [short(results.rows[row].label, 29) for row in reversed(shown)]
    figure, axes = column_axes(left=room_for(names), top=0.42, height=0.95 + _BAR * len(shown))
    add_energy_bars(axes, names, [energy_parts(results.runs[row, motion].numbers) for row in reversed(shown)])
    axes.set_xlabel("Energy (J)")
    vertical_grid(axes)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]))
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderpad=0.2)
    return figure


_BINS = 700
_LOOP_SECONDS = 10.0
_STRIP_SECONDS, _STRIP_TURNS, _STRIP_HEIGHT = 1.5, 30, 2.0
_LOOP_POINTS = 1500
_HEIGHT = 2.5


@style.drawn_in_style()
def _over_time(ordinate: str, *lines: tuple[Floats, Floats, str, float]) -> Figure:
    """Lines over time with their colours and widths [pt], in a range that is symmetric about zero."""
    figure, axes = column_axes(height=_HEIGHT)
    for time, values, colour, width in lines:
        axes.plot(*envelope(time, values, _BINS), color=colour, linewidth=width)
    finish(axes, ordinate, "Time (s)")
    axes.margins(x=0.0)
    symmetric(axes)
    return figure


@style.drawn_in_style()
def loop_figure(
    history: RunHistory, across: Floats, abscissa: str, unit: DisplayUnit, stroke: Stroke
) -> Figure:
    """Force of the first damper over `across`, shape (n_time,), in the strong part of a motion."""
    figure, axes = small_axes(labelled=True)
    part = strong_part(history.time, history.force[:, 0], _LOOP_SECONDS)
    drawn = slice(part.start, part.stop, max(1, (part.stop - part.start) // _LOOP_POINTS))
    force = history.force[drawn, 0] * unit.factor
    axes.plot(across[drawn] * 1e3, force, color=stroke.colour, linewidth=0.7)
    name_small_axes(axes, f"Force ({unit.symbol})", abscissa)
    return figure


@style.drawn_in_style()
def command_figure(history: RunHistory, unit: str, largest: float, stroke: Stroke) -> Figure:
    """What the controller sends to the first damper and what its coil has, sample by sample around its largest force.

    A strip up to `largest`.
    """
    figure, axes = column_axes(height=_STRIP_HEIGHT)
    part = strip_of(history)
    time, signals = history.time[part], (history.command[part, 0], history.current[part, 0])
    axes.step(time, signals[0], where="post", color=style.DATA, linewidth=2.2, label="sent")
    axes.plot(time, signals[1], color=stroke.colour, linewidth=1.0, label="in the coil")
    ordinate = "Current" if unit == "A" else "Voltage"
    finish(axes, f"{ordinate} ({unit})", "Time (s)")
    axes.margins(x=0.0)
    axes.set_ylim(-0.06 * largest, 1.08 * largest)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 5, 10]))
    plain_ticks(axes, 3, "y")
    legend(axes)
    return figure


def strip_of(history: RunHistory) -> slice:
    """The samples of a strip around the largest force of the first damper, with few enough turns to be seen."""
    time, force = history.time, history.force[:, 0]
    steps = np.diff(history.command[strong_part(time, force, _STRIP_SECONDS), 0])
    turns = int(np.count_nonzero(np.diff(np.sign(steps[steps != 0.0]))))
    return strong_part(time, force, _STRIP_SECONDS * min(1.0, _STRIP_TURNS / max(turns, 1)))


@style.drawn_in_style()
def energy_history_figure(history: RunHistory) -> Figure:
    """Input energy and its distribution, cumulative from the start and stacked."""
    figure, axes = small_axes(labelled=True)
    given, kinetic, strain, damping, devices = history.energy.T
    add_energies(axes, history.time, given, (devices, damping, kinetic + strain))
    name_small_axes(axes, "Energy (J)", "Time (s)")
    return figure


ReadHistory = Callable[[int, int], RunHistory | None]
"""Reads the history of a row under a motion; `None` if it is not stored."""


def history_section(
    results: StudyResults,
    histories: ReadHistory,
    motion: int,
    drawn: Sequence[int],
    of_row: Sequence[Stroke],
) -> Section | None:
    """Drift over time of the storey with the largest drift without dampers, for each row that is drawn."""
    base = results.row_of("uncontrolled")
    reference = None if base is None else histories(base, motion)
    shown = [
        (row, history) for row in drawn if row != base and (history := histories(row, motion)) is not None
    ]
    if not shown or reference is None:
        return None
    storey = int(np.abs(reference.drift).max(axis=0).argmax())
    name, storey_name = results.motions[motion].name, results.storey_names[storey]
    ground = (reference.time, reference.ground_acceleration, style.INK, 0.8)
    bare = (reference.time, reference.drift[:, storey] * 1e3, style.DATA, 0.7)
    over_time = _over_time("Ground acceleration (m/s²)", ground)
    panels = [panel("ground", "Ground", over_time, f"Ground acceleration of {name}")]
    for row, history in shown:
        # Beside the line without dampers a row without a hue is dark.
        colour = style.INK if of_row[row].colour == style.DATA else of_row[row].colour
        drift = (history.time, history.drift[:, storey] * 1e3, colour, 0.9)
        panels.append(
            panel(
                f"drift-{row}",
                results.rows[row].label,
                _over_time("Drift (mm)", bare, drift),
                f"Drift of {storey_name} under {name}: {results.rows[row].label}, and without dampers in grey",
            )
        )
    return Section(
        anchor="histories",
        title="Time histories",
        summary=f"drift of {storey_name} under {name}.",
        groups=(
            Group(
                title=f"Drift of {storey_name} under {name}",
                synthetic=results.motions[motion].synthetic,
                prose=("Grey: without dampers.",),
                panels=tuple(panels),
            ),
        ),
    )


def device_section(
    results: StudyResults,
    histories: ReadHistory,
    motion: int,
    drawn: Sequence[int],
    of_row: Sequence[Stroke],
) -> Section | None:
    """Force loops, command and energies of the first damper, for each row that is drawn and has one."""
    name = results.motions[motion].name
    shown = [
        (row, history)
        for row in drawn
        if (history := histories(row, motion)) is not None and history.force.shape[1] > 0
    ]
    if not shown:
        return None
    peak = max(float(np.abs(history.force[:, 0]).max()) for _, history in shown)
    largest = max(float(each[:, 0].max()) for _, run in shown for each in (run.current, run.command)) or 1.0
    unit = style.force_unit(peak)
    device = results.device_names[0]
    groups, energies = [], []
    what = "current" if results.command_unit == "A" else "voltage"
    for row, history in shown:
        label, stroke = results.rows[row].label, of_row[row]
        under = f"under {name}"
        figures = [
            (
                f"loop-{suffix}",
                loop_figure(history, across[:, 0], abscissa, unit, stroke),
                f"Force of {device} against {suffix} {under}",
            )
            for suffix, across, abscissa in (
                ("displacement", history.deformation, "Damper displacement (mm)"),
                ("velocity", history.rate, "Velocity (mm/s)"),
            )
        ]
        panels = [panel(f"{key}-{row}", "", figure, f"{words}: {label}") for key, figure, words in figures]
        if max(np.ptp(history.command[:, 0]), np.ptp(history.current[:, 0])) > 0.0:
            seconds = [
                significant(history.time[at], 3)
                for at in (strip_of(history).start, strip_of(history).stop - 1, -1)
            ]
            figure = command_figure(history, results.command_unit, largest, stroke)
            words = f"{what.capitalize()} of {device} {under}, sample by sample: {label}"
            panels.append(panel(f"command-{row}", "", figure, words, "{} to {} s of {} s".format(*seconds)))
        energies.append(
            panel(f"energy-{row}", label, energy_history_figure(history), f"Energies {under}: {label}")
        )
        groups.append(Group(title=label, panels=tuple(panels), layout="small"))
    return Section(
        anchor="devices",
        title=f"Damper under {name}",
        summary=f"force loops, {what} and energies of {device}.",
        groups=(
            Group(
                prose=(
                    f"{device[:1].upper()}{device[1:]}: force loops in the ten seconds around the largest force, and "
                    f"{what} from the controller and in the coil over a shorter time, where it varies.",
                )
            ),
            *groups,
            Group(
                title="Energies",
                prose=(
                    "Cumulative: dissipated by the dampers (blue) and by the structure (light blue), kinetic and "
                    "strain energy (grey), input (line).",
                ),
                panels=tuple(energies),
                layout="small",
            ),
        ),
    )


_ROW = 0.26
_NAME = 36


def spread_section(comparison: StudyComparison, shown: ShownRows, of_row: Sequence[Stroke]) -> Section | None:
    """Least, quartiles and most of the scores under single motions, and scores of groups; `None` of a single motion."""
    results = comparison.results
    assert isinstance(results, StudyResults)
    scored = [row for _, rows in comparison.ranks for row in rows if math.isfinite(results.score(row))]
    rows = [row for row in scored if row in shown.listed]
    drawn = [row for row in scored if row in shown.drawn]
    if len(results.judged_motions) < 2 or not rows:
        return None
    groups = [
        Group(title=f"Score over {judged_in_words(results)}", table=spread_table(comparison, rows)),
        Group(
            panels=(
                panel(
                    "score-spread",
                    "Score under each motion",
                    score_figure(results, drawn, of_row),
                    f"Score of {len(drawn)} arrangements under each of {judged_in_words(results)}, with the median",
                    note="A dot for each test motion, circles for training motions; the line is the median.",
                ),
            )
        ),
    ]
    if motion_groups(results):
        groups.append(Group(title="Score under groups of motions", table=group_table(results, rows)))
    return Section(
        anchor="spread",
        title="Spread over motions",
        summary=_spread_in_words(comparison),
        groups=tuple(groups),
    )


def _spread_in_words(comparison: StudyComparison) -> str:
    results, leading, passive = comparison.results, comparison.leading, comparison.passive
    parts = []
    if leading is not None and math.isfinite(results.score(leading)):
        spread = results.spread(leading)
        parts.append(
            f"the score of {results.rows[leading].label} is {format_fixed(spread.mean, 3)}, under single motions "
            f"{format_fixed(spread.least, 3)} to {format_fixed(spread.most, 3)}"
        )
        better = None if passive in (None, leading) else times_better(results, leading, passive)
        if better is not None and passive is not None:
            parts.append(
                f"peak drift and peak acceleration are both lower than those of {results.rows[passive].label} under "
                f"{better} of {judged_in_words(results)}"
            )
    return f"{'; '.join(parts)}. {chosen_in_words(results)}".strip()


@style.drawn_in_style()
def score_figure(results: StudyResults, rows: list[int], of_row: Sequence[Stroke]) -> Figure:
    """Score under each motion, a line of dots for each row, the first on top."""
    shown = list(reversed(rows))
    names = [short(results.rows[row].label, _NAME) for row in shown]
    figure, axes = column_axes(left=room_for(names), top=0.15, height=0.8 + _ROW * len(shown))
    judged = set(results.judged_motions)
    for place, row in enumerate(shown):
        for motion in range(len(results.motions)):
            score = results.score_under(row, (motion,))
            filled = of_row[row].colour if motion in judged else "none"
            axes.plot(
                score,
                place,
                "o",
                markersize=3.6,
                markerfacecolor=filled,
                markeredgecolor=of_row[row].colour,
                alpha=0.75,
            )
        median = results.spread(row).median
        axes.plot([median, median], [place - 0.34, place + 0.34], color=style.INK, linewidth=1.3)
    name_rows(axes, names, "Score under one motion")
    axes.set_xlim(left=0.0)
    return figure


def motion_section(results: StudyResults) -> Section:
    """The ground motions: use, groups, peak, duration, source and processing."""
    uses = [motion.use for motion in results.motions]
    peaks = np.array([motion.peak for motion in results.motions])
    lengths = np.array([motion.duration for motion in results.motions])
    return Section(
        anchor="motions",
        title="Ground motions",
        summary=f"{uses_in_words(uses)}, peaks from {significant(float(peaks.min()), 3)} to "
        f"{significant(float(peaks.max()), 3)} m/s², {significant(float(lengths.min()), 3)} to "
        f"{significant(float(lengths.max()), 3)} s long.",
        groups=(
            Group(
                table=Table(
                    label="Ground motions",
                    columns=("", "Use", "Groups", "Peak (m/s²)", "Duration (s)", "Source", "Changes"),
                    rows=tuple(
                        (
                            motion.name,
                            f"{motion.use}{', synthetic' if motion.synthetic else ''}",
                            ", ".join(motion.groups),
                            significant(motion.peak, 4),
                            significant(motion.duration, 4),
                            motion.source,
                            "; ".join(motion.changes),
                        )
                        for motion in results.motions
                    ),
                    words=(1, 2, 5, 6),
                )
            ),
        ),
    )
