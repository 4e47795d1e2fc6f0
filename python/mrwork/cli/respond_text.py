"""What `mrwork respond` says of a study on the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from mrwork.study.results import OFF_BALANCE, ON_OFF, StudyResults, largest_step_changes
from mrwork.study.study import Kind

_SHOWN = (
    ("peak_drift", "drift"),
    ("peak_acceleration", "accel."),
    ("rms_drift", "rms drift"),
    ("rms_acceleration", "rms acc."),
)


def study_text(results: StudyResults, place: Path) -> str:
    """A table for each motion, the scores, the check of the step, what there is to know, and where the page is."""
    against: Kind = "uncontrolled" if results.row_of("passive_off") is None else "passive_off"
    width = max(len(row.label) for row in results.rows)
    lines = [results.title, ""]
    for motion in range(len(results.motions)):
        lines += [*_motion_lines(results, motion, against, width), ""]
    for block in (_score_lines(results, width), _step_lines(results, width)):
        found = list(block)
        lines += [*found, ""] if found else []
    lines += [f"warning: {warning}" for warning in results.warnings()]
    lines += [] if results.balanced else [OFF_BALANCE]
    return "\n".join([*lines, f"Report: {place / 'report.html'}"])


def _motion_lines(results: StudyResults, motion: int, against: Kind, width: int) -> Iterator[str]:
    """The criteria under one motion, then their ratios to those at i = 0, or without dampers."""
    over = "i = 0" if against == "passive_off" else "uncontrolled"
    ratio_heads = " ".join(f"{name:>9}" for _, name in _SHOWN)
    yield f"{results.motions[motion].name}: criteria, and over {over}"
    yield f"  {'':<{width}}  {'drift mm':>9} {'m/s2':>7} {'force N':>8}  {ratio_heads}"
    for row, each in enumerate(results.rows):
        found = results.criteria(row, motion)
        if found is None:
            run = results.runs.get((row, motion))
            yield f"  {each.label:<{width}}  {'not run' if run is None else run.outcome}"
            continue
        ratios = results.ratios(row, motion, against)
        force = f"{found['peak_force']:.4g}" if each.kind in ("passive_off", "controller") else "-"
        yield (
            f"  {each.label:<{width}}  {1e3 * found['peak_drift']:>9.4g} {found['peak_acceleration']:>7.3g} "
            f"{force:>8}  " + " ".join(f"{_ratio(ratios[name]):>9}" for name, _ in _SHOWN)
        )


def _score_lines(results: StudyResults, width: int) -> Iterator[str]:
    scores = [results.score(row) for row in range(len(results.rows))]
    if any(map(math.isfinite, scores)):
        yield f"Score, the mean of these ratios over {len(results.motions)} motions:"
        for row, value in zip(results.rows, scores, strict=True):
            yield f"  {row.label:<{width}}  {_ratio(value):>9}"


def _step_lines(results: StudyResults, width: int) -> Iterator[str]:
    changes = largest_step_changes(results)
    if changes:
        yield "Half the step: the largest change of a criterion, over its value"
        for each in changes:
            change = f"{each.change:.1e}" if each.criterion else "-"
            yield f"  {results.rows[each.row].label:<{width}}  {change:>9}  {each.in_words(results)}"
        yield ON_OFF


def _ratio(value: float) -> str:
    return f"{value:.3f}" if math.isfinite(value) else "-"
