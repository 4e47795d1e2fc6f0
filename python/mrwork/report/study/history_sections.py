"""Sections of time histories under one motion: drift, and force loops, command and energies of a damper."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mrwork.report import style
from mrwork.report.section import Group, Panel, Section, panel
from mrwork.report.study.figures import strokes
from mrwork.report.study.history_figures import (
    command_figure,
    drift_figure,
    energy_history_figure,
    ground_figure,
    loop_figure,
)
from mrwork.study.results import StudyResults
from mrwork.study.run_result import RunHistory

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
