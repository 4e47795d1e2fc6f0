"""Histories under one motion on a study's page: drift, and force loops, command and energies of a damper."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.report import style
from mrwork.report.canvas import column_axes, finish, name_small_axes, plain_ticks, small_axes
from mrwork.report.figures import envelope, strong_part
from mrwork.report.section import Group, Panel, Section, panel
from mrwork.report.study.figures import Stroke, strokes
from mrwork.report.style import DisplayUnit
from mrwork.study.results import StudyResults
from mrwork.study.run_result import RunHistory

_BINS = 700
_SMALL_BINS = 350
_LOOP_SECONDS = 10.0
_COMMAND_SECONDS = 4.0
_LOOP_POINTS = 1500
_HEIGHT = 2.5


@style.drawn_in_style()
def drift_figure(history: RunHistory, reference: RunHistory | None, storey: int, stroke: Stroke) -> Figure:
    """Drift of a storey over time, in front of that of the building without dampers."""
    figure, axes = column_axes(height=_HEIGHT)
    if reference is not None:
        time, drift = envelope(reference.time, reference.drift[:, storey] * 1e3, _BINS)
        axes.plot(time, drift, color=style.DATA, linewidth=0.7)
    time, drift = envelope(history.time, history.drift[:, storey] * 1e3, _BINS)
    axes.plot(time, drift, color=stroke.colour, linewidth=0.9)
    _finish_history(axes, "Drift (mm)")
    return figure


@style.drawn_in_style()
def ground_figure(history: RunHistory) -> Figure:
    """Ground acceleration over time."""
    figure, axes = column_axes(height=_HEIGHT)
    time, ground = envelope(history.time, history.ground_acceleration, _BINS)
    axes.plot(time, ground, color=style.INK, linewidth=0.8)
    _finish_history(axes, "Ground acceleration (m/s²)")
    return figure


@style.drawn_in_style()
def loop_figure(
    history: RunHistory, device: int, unit: DisplayUnit, stroke: Stroke, *, over_velocity: bool
) -> Figure:
    """Force of a damper over its elongation or velocity, in the strong part of a motion."""
    figure, axes = small_axes(labelled=True)
    part = strong_part(history.time, history.force[:, device], _LOOP_SECONDS)
    step = max(1, (part.stop - part.start) // _LOOP_POINTS)
    drawn = slice(part.start, part.stop, step)
    across = history.rate if over_velocity else history.deformation
    axes.plot(
        across[drawn, device] * 1e3,
        history.force[drawn, device] * unit.factor,
        color=stroke.colour,
        linewidth=0.7,
    )
    name_small_axes(axes, f"Force ({unit.symbol})", "Velocity (mm/s)" if over_velocity else "Elongation (mm)")
    return figure


@style.drawn_in_style()
def command_figure(history: RunHistory, device: int, unit: str, largest: float, stroke: Stroke) -> Figure:
    """Current or voltage in the coil of a damper over time, around its largest force."""
    figure, axes = small_axes(labelled=True)
    part = strong_part(history.time, history.force[:, device], _COMMAND_SECONDS)
    time, current = envelope(history.time[part], history.current[part, device], _SMALL_BINS)
    axes.plot(time, current, color=stroke.colour, linewidth=0.7)
    axes.set_ylim(-0.04 * largest, 1.06 * largest)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 5, 10]))
    plain_ticks(axes, 3, "y")
    name_small_axes(axes, f"{'Current' if unit == 'A' else 'Voltage'} ({unit})", "Time (s)")
    return figure


@style.drawn_in_style()
def energy_history_figure(history: RunHistory) -> Figure:
    """Input energy and its distribution, cumulative from the start and stacked."""
    figure, axes = small_axes(labelled=True)
    step = max(1, len(history.time) // _SMALL_BINS)
    time = history.time[::step]
    _, kinetic, strain, damping, devices = history.energy[::step].T
    axes.stackplot(
        time,
        devices,
        damping,
        kinetic + strain,
        colors=[style.MODEL, style.BAND_EDGE, style.RULE],
        linewidth=0.0,
    )
    axes.plot(time, history.energy[::step, 0], color=style.INK, linewidth=0.9)
    # An actuator may supply energy; the energy that it takes up is then negative.
    axes.set_ylim(0.0, 1.05 * max(float(history.energy[:, 0].max()), float((damping + devices).max()), 1e-9))
    axes.margins(x=0.0)
    name_small_axes(axes, "Energy (J)", "Time (s)")
    return figure


def _finish_history(axes: Axes, ordinate: str) -> None:
    """Name the axes of a history, and make its range symmetric about zero."""
    finish(axes, ordinate, "Time (s)")
    axes.margins(x=0.0)
    largest = max(map(abs, axes.get_ylim()))
    axes.set_ylim(-largest, largest)


ReadHistory = Callable[[int, int], RunHistory | None]
"""Reads the history of a row under a motion; `None` if it is not stored."""


def history_section(
    results: StudyResults, histories: ReadHistory, motion: int, drawn: Sequence[int]
) -> Section | None:
    """Drift over time of the storey with the largest drift without dampers, for each row that is drawn."""
    base = results.row_of("uncontrolled")
    reference = None if base is None else histories(base, motion)
    rows = [row for row in drawn if row != base and histories(row, motion) is not None]
    if not rows or reference is None:
        return None
    storey = int(np.abs(reference.drift).max(axis=0).argmax())
    name, storey_name = results.motions[motion].name, results.storey_names[storey]
    of_row = strokes(results)
    panels = [panel("ground", "Ground", ground_figure(reference), f"Ground acceleration of {name}")]
    for row in rows:
        history = histories(row, motion)
        assert history is not None
        panels.append(
            panel(
                f"drift-{row}",
                results.rows[row].label,
                drift_figure(history, reference, storey, of_row[row]),
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
    results: StudyResults, histories: ReadHistory, motion: int, drawn: Sequence[int]
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
    largest = max(float(history.current[:, 0].max()) for _, history in shown) or 1.0
    unit = style.force_unit(peak)
    device = results.device_names[0]
    groups, of_row = [], strokes(results)
    for row, history in shown:
        label, stroke = results.rows[row].label, of_row[row]
        panels: list[Panel] = [
            panel(
                f"loop-{suffix}-{row}",
                "",
                loop_figure(history, 0, unit, stroke, over_velocity=suffix == "velocity"),
                f"Force of {device} against {suffix} under {name}: {label}",
            )
            for suffix in ("elongation", "velocity")
        ]
        panels.append(
            panel(
                f"command-{row}",
                "",
                command_figure(history, 0, results.command_unit, largest, stroke),
                f"Command of {device} under {name}: {label}",
            )
        )
        panels.append(
            panel(f"energy-{row}", "", energy_history_figure(history), f"Energies under {name}: {label}")
        )
        groups.append(Group(title=label, panels=tuple(panels), layout="small"))
    return Section(
        anchor="devices",
        title=f"Damper under {name}",
        summary=f"force loops, {'current' if results.command_unit == 'A' else 'voltage'} and energies of {device}.",
        groups=(
            Group(
                prose=(
                    f"{device[:1].upper()}{device[1:]}: force loops in the ten seconds around the largest force, "
                    "command in four of them. Cumulative energies: dissipated by the dampers (blue) and by "
                    "the structure (light blue), kinetic and strain energy (grey), input (line).",
                )
            ),
            *groups,
        ),
    )
