"""Sheets of the two laws under every record, in the form of figures 6.3 to 6.10, and their numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mrwork.closed_loop import History, simulate_loop
from mrwork.control import lyapunov_function, plant_of
from mrwork.motions import GroundMotion
from studies.chapter_6.direct_laws import SHOWN, Controlled, controlled_at, motions_at
from studies.common.frame import FRAME, HARDWARE, LEVELS, Bench, level_name


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """Histories of a row under a record, with control and without."""

    record: str
    label: str
    controlled: History
    reference: History


def sheets_at(over: Bench, level: int, constant: float) -> Iterator[Sheet]:
    """Sheets of a level, by its place in `LEVELS`: of the best constant current [A] and the laws under each record."""
    off, *others = controlled_at(level, constant, SHOWN)
    for motion in motions_at(over, level):
        reference = _history(over, off, motion)
        for row in others:
            yield Sheet(
                record=motion.name,
                label=row.label,
                controlled=_history(over, row, motion),
                reference=reference,
            )


def sheets_found(over: Bench, constants: Sequence[float], *, quick: bool) -> dict[str, Any]:
    """By level, row and record, numbers of the sheets; the quick form has the first level only."""
    return {
        level_name(level): _numbers(sheets_at(over, number, constants[number]))
        for number, level in enumerate(LEVELS[:1] if quick else LEVELS)
    }


def _numbers(sheets: Iterator[Sheet]) -> dict[str, Any]:
    function = lyapunov_function(plant_of(FRAME, FRAME.storeys[:1]))
    table: dict[str, Any] = {}
    for sheet in sheets:
        value, without = function.value(sheet.controlled.state), function.value(sheet.reference.state)
        table.setdefault(sheet.label, {})[sheet.record] = {
            "peak_function": float(value.max()),
            "peak_function_ratio": float(value.max() / without.max()),
            "mean_function_ratio": float(value.mean() / without.mean()),
            "mean_current": float(sheet.controlled.current[:, 0].mean()),
            "peak_force": float(np.abs(sheet.controlled.force[:, 0]).max()),
        }
    return table


def _history(over: Bench, row: Controlled, motion: GroundMotion) -> History:
    found = simulate_loop(
        FRAME, [row.device], row.law, [motion], HARDWARE, histories=True, threads=over.threads
    ).histories
    assert found is not None
    return found[0]
