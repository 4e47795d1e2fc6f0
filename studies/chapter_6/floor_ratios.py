"""Peaks and rms of every floor in the form of tables 6.1 and 6.2, with bands; and where control makes them worse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.closed_loop import Responses, simulate_loop
from mrwork.motions import GroundMotion
from studies.chapter_6.direct_laws import CONSTANT, DIRECT, OFF, Controlled, controlled_at, motions_at
from studies.common.frame import FRAME, HARDWARE, LEVELS, Bench, level_name

Floats = NDArray[np.float64]

BAND = (0.05, 0.95)
"""Quantiles of the band over the draws of the damper."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A peak or rms of a motion of every floor, or of the storey below it: its unit, and the factor from SI."""

    kind: str
    motion: str
    unit: str
    factor: float

    @property
    def name(self) -> str:
        """Its name among the quantities of a run."""
        return f"{self.kind}_{self.motion}"

    @property
    def title(self) -> str:
        """Its name in tables."""
        return f"{self.kind} {self.motion}"


PEAKS, MEANS = (
    tuple(
        Quantity(kind=kind, motion=motion, unit=unit, factor=factor)
        for motion, unit, factor in (
            ("displacement", "mm", 1e3),
            ("drift", "mm", 1e3),
            ("acceleration", "m/s2", 1.0),
        )
    )
    for kind in ("peak", "rms")
)
QUANTITIES = (*PEAKS, *MEANS)


def floors_found(over: Bench, constants: Sequence[float], draws: Floats) -> dict[str, Any]:
    """By level, label, record and quantity: values, ratios to i = 0 and their bands, a number for each floor.

    Parameters
    ----------
    constants
        The best constant current of each level [A].
    draws
        Parameters of one damper, shape (n_draws, n_params). A ratio of a draw is over i = 0 of the same draw.
    """
    return {
        level_name(level): _at_level(
            over, motions_at(over, number), controlled_at(number, constants[number]), draws
        )
        for number, level in enumerate(LEVELS)
    }


def _at_level(
    over: Bench, motions: Sequence[GroundMotion], rows: Sequence[Controlled], draws: Floats
) -> dict[str, Any]:
    def responses(row: Controlled) -> dict[str, Floats]:
        # The published damper, then the draws.
        device = replace(row.device, theta=np.vstack([row.device.draws, draws]))
        found = simulate_loop(FRAME, [device], row.law, motions, HARDWARE, threads=over.threads)
        return _of_floors(found, len(motions))

    off = responses(rows[0])
    table = {}
    for row in rows:
        runs = responses(row)
        by_record: dict[str, Any] = {motion.name: {} for motion in motions}
        for quantity in QUANTITIES:
            value = quantity.factor * runs[quantity.name][:, 0]
            ratios = runs[quantity.name] / off[quantity.name]
            low, high = np.quantile(ratios[:, 1:], BAND, axis=1)
            for place, motion in enumerate(motions):
                by_record[motion.name][quantity.name] = {
                    "values": value[place].tolist(),
                    "ratios": ratios[place, 0].tolist(),
                    "low": low[place].tolist(),
                    "high": high[place].tolist(),
                }
        table[row.label] = by_record
    return table


def _of_floors(responses: Responses, n_motions: int) -> dict[str, Floats]:
    """Each quantity, shape (n_motions, 1 + n_draws, n_floors)."""
    return {
        quantity.name: np.asarray(getattr(responses, quantity.name)).reshape(n_motions, -1, len(FRAME.floors))
        for quantity in QUANTITIES
    }


def worse_found(floors: dict[str, Any]) -> dict[str, Any]:
    """By level, law and quantity: on how many floors of all records the law is worse than what it is compared with.

    `than_off` and `than_constant` count floors; `surely` are those whose band lies above i = 0, `within` those whose
    ratio lies within its band. `worst` is the largest ratio to i = 0, with its `record` and `floor`.
    """
    return {
        level: {
            law: {quantity.name: _worse(table, law, quantity.name) for quantity in QUANTITIES}
            for law in (CONSTANT, *DIRECT)
        }
        for level, table in floors.items()
    }


def _worse(table: dict[str, Any], law: str, quantity: str) -> dict[str, Any]:
    records = tuple(table[OFF])

    def of(label: str, part: str) -> Floats:
        return np.array([table[label][record][quantity][part] for record in records])

    ratios, low, high = (of(law, part) for part in ("ratios", "low", "high"))
    record, floor = np.unravel_index(ratios.argmax(), ratios.shape)
    return {
        "of": int(ratios.size),
        "than_off": int((ratios > 1.0).sum()),
        "surely": int((low > 1.0).sum()),
        "than_constant": int((ratios > of(CONSTANT, "ratios")).sum()),
        "within": int(((low <= ratios) & (ratios <= high)).sum()),
        "widest": float((high - low).max()),
        "worst": float(ratios.max()),
        "record": records[int(record)],
        "floor": FRAME.floor_names[int(floor)],
    }
