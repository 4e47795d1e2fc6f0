"""A study as one JSON object, and its criteria as a table for other programs."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from typing import Any

from mrwork.closed_loop.evaluation import criteria
from mrwork.study.results import StudyResults


def study_document(results: StudyResults) -> dict[str, Any]:
    """`results` holds one entry for each controller and motion; numbers that are not finite become `null`."""
    entries = []
    for (row, motion), run in sorted(results.runs.items()):
        entries.append(
            {
                "controller": results.rows[row].label,
                "kind": results.rows[row].kind,
                "motion": results.motions[motion].name,
                "outcome": run.outcome,
                "criteria": _finite(results.criteria(row, motion)),
                "over_uncontrolled": _finite(results.ratios(row, motion, "uncontrolled")),
                "over_passive_off": _finite(results.ratios(row, motion, "passive_off")),
                "energy_error": _number(run.energy_error),
                "steps": run.steps,
                "step_check": _step_check(results, row, motion),
            }
        )
    return {
        "title": results.title,
        "complete": results.complete,
        "command_unit": results.command_unit,
        "motions": [
            {"name": each.name, "peak": each.peak, "duration": each.duration, "changes": list(each.changes)}
            for each in results.motions
        ],
        "scores": {row.label: _number(results.score(number)) for number, row in enumerate(results.rows)},
        "warnings": results.warnings(),
        "results": entries,
    }


def criteria_csv(results: StudyResults) -> str:
    """The criteria, a line for each controller and motion; the header has the units."""
    target = io.StringIO()
    writer = csv.writer(target, lineterminator="\n")
    known = criteria()
    units = [results.command_unit if entry.unit == "A or V" else entry.unit for entry in known]
    heads = [f"{entry.name} [{unit}]" for entry, unit in zip(known, units, strict=True)]
    writer.writerow(["controller", "motion", "outcome", "energy_error", *heads])
    for (row, motion), run in sorted(results.runs.items()):
        found = results.criteria(row, motion) or {}
        numbers = [f"{found[entry.name]:.9g}" if entry.name in found else "" for entry in known]
        writer.writerow(
            [
                results.rows[row].label,
                results.motions[motion].name,
                run.outcome,
                f"{run.energy_error:.3g}",
                *numbers,
            ]
        )
    return target.getvalue()


def profiles_csv(results: StudyResults) -> str:
    """Peaks and root mean squares of every floor and storey, a line for each."""
    target = io.StringIO()
    writer = csv.writer(target, lineterminator="\n")
    writer.writerow(["controller", "motion", "quantity", "where", "peak", "rms", "unit"])
    for (row, motion), run in sorted(results.runs.items()):
        if not run.finished:
            continue
        parts = (
            ("displacement", results.floor_names, run.peak_displacement, run.rms_displacement, "m"),
            ("drift", results.storey_names, run.peak_drift, run.rms_drift, "m"),
            ("acceleration", results.floor_names, run.peak_acceleration, run.rms_acceleration, "m/s2"),
        )
        for quantity, names, peaks, squares, unit in parts:
            for name, peak, rms in zip(names, peaks, squares, strict=True):
                writer.writerow(
                    [
                        results.rows[row].label,
                        results.motions[motion].name,
                        quantity,
                        name,
                        f"{peak:.9g}",
                        f"{rms:.9g}",
                        unit,
                    ]
                )
    return target.getvalue()


def _step_check(results: StudyResults, row: int, motion: int) -> dict[str, Any] | None:
    """The run again with half the step: how far each criterion has moved, over its value."""
    half = (results.halved or {}).get((row, motion))
    if half is None:
        return None
    changes = results.step_changes(row, motion)
    return {
        "outcome": half.outcome,
        "steps": half.steps,
        "largest": None if changes is None else _number(max(changes.values())),
        "changes": _finite(changes),
    }


def _finite(numbers: Mapping[str, float] | None) -> dict[str, float | None]:
    """Every criterion; `null` where a run has none or it is not finite."""
    found = numbers or {}
    return {entry.name: _number(found.get(entry.name, math.nan)) for entry in criteria()}


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
