"""Figures of a study's page with their sections: profiles, energies, histories and loops, spread, fragilities."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import get_args

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.base.numbers import counted, format_fixed, least_to_most, significant
from mrwork.base.table import Column, Table
from mrwork.base.values import Floats
from mrwork.closed_loop.responses import History
from mrwork.plots import canvas, style
from mrwork.plots.of_studies import Stroke, energies, ida, name_heights, short, storey_profiles
from mrwork.plots.of_studies import fragility as draw_fragility
from mrwork.plots.of_tests import Motion, commands, loops
from mrwork.plots.samples import envelope, part_about_peak
from mrwork.report.section import Group, Section, panel
from mrwork.study.comparison import Comparison
from mrwork.study.fragilities import Fragilities, fragility
from mrwork.study.histories import RunHistory
from mrwork.study.results import StudyResults
from mrwork.study.study import MotionFacts, uses_in_words
from mrwork.study.tables import ShownRows, group_table, spread_table


def profile_figure(
    results: StudyResults, quantity: str, rows: Sequence[int], behind: Sequence[int] = ()
) -> Figure:
    """A quantity over the height, mean over the judged motions, with numbers or names at the ordinate."""
    of_floors, named = quantity == "peak_acceleration", bool(results.building.parts)
    names = results.quantities.axes["floor" if of_floors else "storey"]
    figure, axes = canvas.small_axes(left=canvas.room_for(names) if named else canvas.LEFT)
    storey_profiles(results, axes, quantity=quantity, rows=rows, behind=behind, legend=False)
    name_heights(axes, names, numbers=not named)
    canvas.name_above(axes, "" if named else "Floor" if of_floors else "Storey")
    wide = axes.get_xlim()[1] >= 1e4
    axes.xaxis.set_major_locator(MaxNLocator(nbins=2 if wide else 4, steps=[1, 2, 5, 10]))
    return figure


# Bins of a history, seconds and points of a loop, seconds and turns of a strip.
_BINS, _LOOP_SECONDS, _LOOP_POINTS, _STRIP_SECONDS, _STRIP_TURNS = 700, 10.0, 1500, 1.5, 30


def _over_time(ordinate: str, *lines: tuple[Floats, Floats, str, float]) -> Figure:
    """Lines over time with their colours and widths [pt], in a range that is symmetric about zero."""
    figure, axes = canvas.column_axes(height=2.5)
    for time, values, colour, width in lines:
        axes.plot(*envelope(time, values, _BINS), color=colour, linewidth=width)
    canvas.finish(axes, ordinate, "Time (s)")
    axes.margins(x=0.0)
    canvas.make_symmetric(axes)
    return figure


def _signals(history: RunHistory, part: slice) -> History:
    """A part of a stored history, as `mr.plots` draws one: what the energies have as one array by their names."""
    numbers = {name: values[part] for name, values in history.numbers.items()}
    input_energy, kinetic, strain, _, devices = numbers.pop("energy").T
    # What storeys that yield take up counts as damping.
    numbers |= {
        "input_energy": input_energy,
        "device_energy": devices[:, None],
        "element_energy": np.empty((len(input_energy), 0)),
        "damping_energy": input_energy - devices - kinetic - strain,
    }
    return History(time=history.time[part], numbers=numbers)


def strip_of(history: RunHistory) -> slice:
    """The samples of a strip around the largest force of the first damper, with few enough turns to be seen."""
    time, force = history.time, history.force[:, 0]
    steps = np.diff(history.command[part_about_peak(time, force, _STRIP_SECONDS), 0])
    turns = int(np.count_nonzero(np.diff(np.sign(steps[steps != 0.0]))))
    return part_about_peak(time, force, _STRIP_SECONDS * min(1.0, _STRIP_TURNS / max(turns, 1)))


ReadHistory = Callable[[int, int], RunHistory | None]
"""Reads the history of a row under a motion; `None` if it is not stored."""


def history_section(
    results: StudyResults, histories: ReadHistory, drawn: Sequence[int], of_row: Sequence[Stroke]
) -> Section | None:
    """Drift over time of the storey with the largest drift without dampers, for each row that is drawn."""
    motion, base = results.page.detailed, results.row_of("uncontrolled")
    reference = None if base is None else histories(base, motion)
    shown = [
        (row, history) for row in drawn if row != base and (history := histories(row, motion)) is not None
    ]
    if not shown or reference is None:
        return None
    storey = int(np.abs(reference.drift).max(axis=0).argmax())
    under = f"{results.quantities.axes['storey'][storey]} under {results.motions[motion].name}"
    bare = (reference.time, reference.drift[:, storey] * 1e3, style.DATA, 0.7)
    panels = []
    # What a road accelerates is a point without mass.
    if reference.ground_acceleration.any() and not results.motions[motion].is_road:
        ground = _over_time(
            "Ground acceleration (m/s²)", (reference.time, reference.ground_acceleration, style.INK, 0.8)
        )
        words = f"Ground acceleration of {results.motions[motion].name}"
        panels.append(panel("ground", "Ground", ground, words))
    if (sum_of_forces := reference.numbers.get("floor_force")) is not None:
        push = (reference.time, sum_of_forces / 1e3, style.INK, 0.8)
        words = f"Sum of the forces on the floors of {results.motions[motion].name}"
        panels.append(panel("forces", "Forces on the floors", _over_time("Sum (kN)", push), words))
    for row, history in shown:
        # Beside the line without dampers a row without a hue is dark.
        colour = style.INK if of_row[row].colour == style.DATA else of_row[row].colour
        drift = (history.time, history.drift[:, storey] * 1e3, colour, 0.9)
        label = results.rows[row].label
        words = f"Drift of {under}: {label}, and without dampers in grey"
        panels.append(panel(f"drift-{row}", label, _over_time("Drift (mm)", bare, drift), words))
    group = Group(
        title=f"Drift of {under}",
        synthetic=results.motions[motion].synthetic,
        prose=("Grey: without dampers.",),
        panels=tuple(panels),
    )
    return Section(title="Time histories", summary=f"drift of {under}.", groups=(group,))


def device_section(
    results: StudyResults, histories: ReadHistory, drawn: Sequence[int], of_row: Sequence[Stroke]
) -> Section | None:
    """Force loops, command and energies of the first damper, for each row that is drawn and has one."""
    name = results.motions[results.page.detailed].name
    shown = [
        (row, history)
        for row in drawn
        if (history := histories(row, results.page.detailed)) is not None and history.force.shape[1] > 0
    ]
    if not shown:
        return None
    unit = style.force_unit(max(float(np.abs(history.force[:, 0]).max()) for _, history in shown)).symbol
    # The command of an actuator is its force.
    sent = {row: history for row, history in shown if results.rows[row].what.has_commands}
    signals = (signal for history in sent.values() for signal in (history.current, history.command))
    largest = max((float(signal[:, 0].max()) for signal in signals), default=0.0) or 1.0
    device, unit_of_command = results.dampers[0].name, results.dampers[0].command_unit
    what = {"A": "current", "V": "voltage"}.get(unit_of_command, "command")
    groups, balances = [], []
    for row, history in shown:
        label, stroke, panels = results.rows[row].label, of_row[row], []
        # In the strong part of the ground motion.
        part = part_about_peak(history.time, history.force[:, 0], _LOOP_SECONDS)
        drawn_part = slice(part.start, part.stop, max(1, (part.stop - part.start) // _LOOP_POINTS))
        for over in get_args(Motion):
            figure, axes = canvas.small_axes()
            loops(_signals(history, drawn_part), axes, over=over, unit=unit)
            axes.get_lines()[-1].set_color(stroke.colour)
            canvas.name_above(axes)
            words = f"Force of {device} against {over} under {name}: {label}"
            panels.append(panel(f"loop-{over}-{row}", "", figure, words))
        if row in sent and max(np.ptp(history.command[:, 0]), np.ptp(history.current[:, 0])) > 0.0:
            part = strip_of(history)
            first, last, end = (significant(history.time[at], 3) for at in (part.start, part.stop - 1, -1))
            figure, axes = canvas.column_axes(height=2.0)
            commands(_signals(history, part), axes)
            axes.get_lines()[1].set_color(stroke.colour)
            canvas.finish(axes, f"{what.capitalize()} ({unit_of_command})")
            axes.margins(x=0.0)
            axes.set_ylim(-0.06 * largest, 1.08 * largest)
            axes.yaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 5, 10]))
            canvas.plain_ticks(axes, 3, "y")
            words = f"{what.capitalize()} of {device} under {name}, sample by sample: {label}"
            panels.append(panel(f"command-{row}", "", figure, words, f"{first} to {last} s of {end} s"))
        groups.append(Group(title=label, panels=tuple(panels), layout="small"))
        figure, axes = canvas.small_axes()
        energies(_signals(history, slice(None)), axes, legend=False)
        canvas.name_above(axes)
        balances.append(panel(f"energy-{row}", label, figure, f"Energies under {name}: {label}"))
    about = (
        f"{device[:1].upper()}{device[1:]}: force loops in the ten seconds around the largest force, and "
        f"{what} from the controller and in the coil over a shorter time, where it varies."
    )
    parts = (
        "Cumulative: dissipated by the dampers (blue) and by the structure and what of it yields (light blue), "
        "kinetic and strain energy (grey), input (line)."
    )
    last_group = Group(title="Energies", prose=(parts,), panels=tuple(balances), layout="small")
    return Section(
        title=f"Damper under {name}",
        summary=f"force loops, {what} and energies of {device}.",
        groups=(Group(prose=(about,)), *groups, last_group),
    )


def spread_section(comparison: Comparison, shown: ShownRows, of_row: Sequence[Stroke]) -> Section | None:
    """Least, quartiles and most of the scores under single motions, and scores of groups; `None` of a single motion."""
    results, judged = comparison.results, comparison.results.motions.in_words
    scored = [row for _, rows in comparison.ranks for row in rows if math.isfinite(results.score(row).mean)]
    rows = [row for row in scored if row in shown.listed]
    drawn = [row for row in scored if row in shown.drawn]
    if len(results.judged_motions) < 2 or not rows:
        return None
    others = [motion for number, motion in enumerate(results.motions) if number not in results.judged_motions]
    kinds = dict.fromkeys(
        "training motions" if other.use == "training" else "other levels" for other in others
    )
    circles = f", circles for {' and '.join(kinds)}" if kinds else ""
    figure = panel(
        "score-spread",
        "Score under each motion",
        score_figure(results, drawn, of_row),
        f"Score of {len(drawn)} arrangements under each of {judged}, with the median",
        note=f"A dot for each of {judged}{circles}; the line is the median.",
    )
    groups = [
        Group(title=f"Score over {judged}", table=spread_table(comparison, rows)),
        Group(panels=(figure,)),
    ]
    if results.motions.groups:
        groups.append(Group(title="Score under groups of motions", table=group_table(results, rows)))
    summary = ""
    if comparison.leading is not None and math.isfinite(results.score(comparison.leading).mean):
        spread = results.score(comparison.leading)
        mean, least, most = (format_fixed(value, 3) for value in (spread.mean, spread.least, spread.most))
        leading = results.rows[comparison.leading].label
        summary = f"the score of {leading} is {mean}, under single motions {least} to {most}."
    return Section(title="Spread over motions", summary=summary, groups=tuple(groups))


def score_figure(results: StudyResults, rows: list[int], of_row: Sequence[Stroke]) -> Figure:
    """Score under each motion, a line of dots for each row, the first on top."""
    names = [short(results.rows[row].label, 36) for row in reversed(rows)]
    figure, axes = canvas.column_axes(left=canvas.room_for(names), top=0.15, height=0.8 + 0.26 * len(names))
    for height, row in enumerate(reversed(rows)):
        colour = of_row[row].colour
        for motion, score in enumerate(results.scores(row)):
            fill = colour if motion in results.judged_motions else "none"
            axes.plot(score, height, "o", color=colour, markersize=3.6, markerfacecolor=fill, alpha=0.75)
        median = results.score(row).median
        axes.plot([median, median], [height - 0.34, height + 0.34], color=style.INK, linewidth=1.3)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(-0.6, len(names) - 0.4)
    axes.set_xlabel("Score under one motion")
    canvas.vertical_grid(axes)
    axes.set_xlim(left=0.0)
    return figure


_PEAK = Column("peak", "peak", "m/s²", of=lambda facts: None if facts.is_road else facts.peak)
_PEAK_FORCE = Column("", "peak force", "kN", of=lambda facts: facts.peak_force / 1e3)
_MOTIONS = (
    Column("name", "motion"),
    Column("", "use", of=lambda facts: f"{facts.use}{', synthetic' if facts.synthetic else ''}"),
    Column("groups", "groups", shown=", ".join),
    _PEAK,
    _PEAK_FORCE,
    Column("duration", "duration", "s"),
    Column("source", "source"),
    Column("changes", "changes", shown="; ".join),
)


def motion_section(results: StudyResults) -> Section:
    """The ground motions: use, groups, peak, duration, source and processing; of records at several levels a row each.

    Those have their intensities in the place of groups, peak and processing.
    """
    uses = uses_in_words([motion.use for motion in results.motions])
    peaks = [motion.peak for motion in results.motions if motion.peak and not motion.is_road]
    lengths = least_to_most(motion.duration for motion in results.motions)
    records: dict[tuple[str, str], list[MotionFacts]] = {}
    for motion in results.motions:
        records.setdefault((motion.use, motion.record), []).append(motion)

    def levels(first: MotionFacts) -> str:
        several = records[first.use, first.record]
        unit, per = first.intensity.shown
        ends = least_to_most(per * motion.intensity.value for motion in several)
        return f"{len(several)}, {first.intensity.name} {ends} {unit}"

    pushed = [motion.peak_force for motion in results.motions if motion.peak_force]
    shown = [
        column
        for column in _MOTIONS
        if (column is not _PEAK or peaks) and (column is not _PEAK_FORCE or pushed)
    ]
    title = "Ground motions" if len(peaks) == len(results.motions) else "Motions"
    table, of = Table.of(shown, results.motions, label=title), ""
    if len(records) < len(results.motions):
        columns = Column("record", "record"), _MOTIONS[1], Column("", "levels", of=levels), *_MOTIONS[-3:-1]
        table = Table.of(columns, [first for first, *_ in records.values()], label="Records and their levels")
        of = f" of {counted(len(records), 'record')}"
    sizes = [f"peaks from {least_to_most(peaks)} m/s²"] if peaks else []
    sizes += [f"peak forces from {least_to_most(force / 1e3 for force in pushed)} kN"] if pushed else []
    return Section(
        title=title,
        summary=f"{', '.join([uses + of, *sizes, lengths])} s long.",
        groups=(Group(table=table),),
    )


# Records and levels from which on a page has the section, and arrangements that it draws.
_LEAST_RECORDS, _LEAST_LEVELS, _MOST_DRAWN = 2, 3, 6
_PANEL, _COLUMNS = (2.5, 2.3), 3


def fragility_figures(fragilities: Fragilities) -> dict[str, Figure]:
    """By name: intensity over the response, a panel an arrangement, and the probability over it, a curve for each."""
    shown = range(min(len(fragilities.rows), _MOST_DRAWN))
    lines, panels = canvas.grid_of_axes(len(shown), _COLUMNS, _PANEL)
    ida(fragilities, panels, rows=shown)
    figure, axes = canvas.column_axes(left=0.75, top=0.34 + 0.18 * ((len(shown) - 1) // _COLUMNS))
    draw_fragility(fragilities, axes, rows=shown)
    axes.set_ylabel("Probability")
    return {"ida": lines, "fragility": figure}


def fragilities_of_page(results: StudyResults) -> Fragilities | None:
    """Fragilities at the limit of the study; `None` without several records at several levels, or a limit."""
    at, limit = results.motions.by_record, results.limit or results.building.heights
    few = len(at.records) < _LEAST_RECORDS or at.levels.size < _LEAST_LEVELS or len(at.measures) > 1
    forced = any(motion.peak_force for motion in results.motions)
    if few or not limit or not results.complete or forced:
        return None
    return fragility(results)


def fragility_section(results: StudyResults, fragilities: Fragilities) -> Section:
    """Median intensities at the limit of the study, with both figures."""
    at, (table,) = results.motions.by_record, fragilities._summary().shown_tables
    figures = fragility_figures(fragilities)
    words = f"{counted(len(at.records), 'record')} at {at.levels.size} levels"
    curves = panel(
        "fragility",
        f"Probability that {fragilities.limit_in_words}",
        figures["fragility"],
        f"Probability over {at.measure} that {fragilities.limit_in_words}, {words}",
        "Points are shares of the records; the bars at one half are bands of the medians.",
    )
    lines = panel(
        "ida",
        "Incremental dynamic analysis",
        figures["ida"],
        f"{at.measure} over {fragilities.title} of {words}",
        "Thin: a record each. Thick: 16, 50 and 84 % of the records lie below. Dashed: the limit.",
    )
    return Section(
        title="Records at several levels",
        summary=f"the {at.measure} at which {fragilities.limit_in_words}, of {words}.",
        groups=(
            Group(points=fragilities.in_words(), table=table),
            Group(panels=(curves,)),
            Group(panels=(lines,), layout="whole"),
        ),
    )
