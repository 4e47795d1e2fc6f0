"""What engineers ask of each storey: drift ratio with its limit, ductility, shears, residual drift, P-delta."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mrwork.base.numbers import counted, significant
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.table import Table
from mrwork.base.units import STANDARD_GRAVITY
from mrwork.base.values import Floats
from mrwork.closed_loop.evaluation import Scale
from mrwork.study.results import BuildingFacts, StudyResults

# Coefficients up to which P-delta may be left out, and above which a frame is not to be built (EN 1998-1, 4.4.2.2).
_SMALL, _MOST = 0.1, 0.3
# What is of storeys that yield: at the end of a motion others still move.
_OF_YIELD = ("storey_energy", "residual_drift")
# Swing of a storey at the end of a motion, over its yield drift, up to which its drift there is a residual one.
_AT_REST = 0.05
COLLAPSED = 0.1
"""Drift ratio from which on a frame has collapsed."""
# Storeys of a table.
_MOST_STOREYS = 30


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreyQuantity:
    """A quantity of each storey as it is shown: its title, its unit and the factor to it, and what it is divided by."""

    name: str
    title: str
    unit: str
    factor: float = 1.0
    scale: Scale = ""

    def of_runs(self, results: StudyResults, row: int) -> Floats | None:
        """Under each judged motion, shape (n_motions, n_storeys); `None` unless all are known of finished runs."""
        judged = list(results.judged_motions)
        if not results.finished_under(row, judged):
            return None
        quantities = results.quantities.numbers
        values = np.abs(quantities[self.name][row, judged, 0]) * self.factor
        if self.scale:
            shears = quantities["peak_storey_shear"][row, judged, 0]
            values = results.building.scales.divide(values, self.scale, shears)
        return None if np.isnan(values).any() else values


DRIFT = StoreyQuantity(name="peak_drift", title="Drift", unit="mm", factor=1e3)
RATIO = StoreyQuantity(name="peak_drift", title="Drift ratio", unit="%", factor=100.0, scale="height")
SHEAR = StoreyQuantity(name="peak_storey_shear", title="Shear", unit="kN", factor=1e-3)
OVERTURNING = StoreyQuantity(name="peak_overturning", title="Overturning moment", unit="kN m", factor=1e-3)
STOREY_QUANTITIES = (
    DRIFT,
    RATIO,
    StoreyQuantity(name="peak_drift", title="Ductility", unit="", scale="yield drift"),
    StoreyQuantity(name="peak_drift", title="Stability", unit="", scale="stability"),
    StoreyQuantity(name="residual_drift", title="Residual drift", unit="mm", factor=1e3),
    SHEAR,
    StoreyQuantity(name="peak_frame_shear", title="Frame", unit="kN", factor=1e-3),
    OVERTURNING,
    StoreyQuantity(name="storey_energy", title="Energy", unit="kJ", factor=1e-3),
)


def storey_table(results: StudyResults, rows: Sequence[int]) -> Table | None:
    """Peaks of each storey, mean over the judged motions, of some arrangements; `None` where none is known."""
    if len(results.quantities.axes["storey"]) > _MOST_STOREYS:
        return None
    of_row = {row: [quantity.of_runs(results, row) for quantity in STOREY_QUANTITIES] for row in rows}
    numbers = [
        number
        for number, quantity in enumerate(STOREY_QUANTITIES)
        if any(values[number] is not None for values in of_row.values())
        and (quantity.name not in _OF_YIELD or results.building.yield_drifts)
    ]
    if not numbers:
        return None
    lines: list[tuple[str, ...]] = []
    headings = {}
    for row, values in of_row.items():
        headings[len(lines)] = results.rows[row].label
        for storey, name in enumerate(results.quantities.axes["storey"]):
            cells = (values[number] for number in numbers)
            means = (None if cell is None else float(cell[:, storey].mean()) for cell in cells)
            lines.append((name, *(significant(mean, 3) for mean in means)))
    return Table(
        label="Parts" if results.building.parts else "Storeys",
        columns=("", *(STOREY_QUANTITIES[number].title for number in numbers)),
        units=("", *(STOREY_QUANTITIES[number].unit for number in numbers)),
        rows=tuple(lines),
        headings=headings,
        note="Means of the peaks under the judged motions. Shear: inertia of all above less the forces on it, "
        "which frame, dampers and damping carry; frame: its springs and elements alone, on which yield stands.",
    )


def _ratios_of(results: StudyResults) -> dict[str, Floats]:
    """Peak drift ratios by row under each judged motion [%], infinite of a run that diverged, where all are known."""
    judged = list(results.judged_motions)
    ratios = RATIO.factor * results.criteria_of_runs.up_to_collapse("peak_drift_ratio")[:, judged, 0]
    peaks_of = {row.label: peaks for row, peaks in zip(results.rows, ratios, strict=True)}
    return {label: peaks for label, peaks in peaks_of.items() if judged and not np.isnan(peaks).any()}


def limits_in_words(results: StudyResults) -> Iterator[str]:
    """A sentence on the drift limit, if the building has one."""
    facts, over = results.building, _ratios_of(results)
    if facts.drift_limit and over:
        limit, keeping, broken = 100.0 * facts.drift_limit, [], []
        for label, peaks in over.items():
            count, diverged = int((peaks > limit).sum()), int(np.isinf(peaks).sum())
            if count:
                ends = (
                    f"{diverged} of which diverged" if diverged else f"up to {significant(peaks.max(), 3)} %"
                )
                broken.append(f"{label} under {count} of {peaks.size}, {ends}")
            else:
                keeping.append(label)
        parts = [f"kept by {', '.join(keeping)}"] if keeping else []
        parts += [f"exceeded by {'; '.join(broken)}"] if broken else []
        yield f"The drift limit of {limit:g} % is {', '.join(parts)}."


_BEYOND_COLLAPSE: Final = RemarkKind(
    "drift_beyond_collapse",
    f"the drift ratio reaches {{percent:.3g}} % with {{0}}: above {100.0 * COLLAPSED:g} % a real frame has collapsed, "
    "and the run says no more than that",
    warns=True,
)
_UNSTABLE: Final = RemarkKind(
    "stability_exceeded",
    f"the stability coefficient reaches {{value:.2g}} with {{0}}, above {_MOST:g}, where EN 1998-1 allows no frame: a "
    "real one would collapse",
    warns=True,
)
_WEIGHTS_OUT: Final = RemarkKind(
    "p_delta_missing",
    f"P-delta is left out, and the stability coefficient reaches {{value:.2g}} with {{0}}, above {_SMALL:g}",
    "give p_delta = true in [building]",
)
_MOVES: Final = RemarkKind(
    "rest_short",
    "at the end of {moving} of {motions} the frame moves by up to {swing} mm a storey, which residual drifts contain",
    "give the motions rest, as rest = 20",
)


def storey_remarks(results: StudyResults) -> Iterator[Remark]:
    """Remarks on drifts beyond collapse, on what weights do on displaced storeys, and on motion that is left."""
    finite = {
        label: peaks[np.isfinite(peaks)].max(initial=0.0) for label, peaks in _ratios_of(results).items()
    }
    worst = max(finite, key=finite.__getitem__, default="")
    if worst and finite[worst] > 100.0 * COLLAPSED:
        percent = float(finite[worst])
        yield _BEYOND_COLLAPSE.remark(worst, measured=Measured(0.01 * percent, ""), percent=percent)
    yield from _stability_remarks(results, results.building)
    yield from _motion_left(results, results.building)


def _stability_remarks(results: StudyResults, facts: BuildingFacts) -> Iterator[Remark]:
    if not (facts.heights and facts.stiffnesses) or min(facts.heights) <= 0.0:
        return
    above = STANDARD_GRAVITY * np.cumsum(facts.masses[::-1])[::-1]
    # Isolators below have no height.
    above = above[len(facts.stiffnesses) - len(facts.heights) :]
    scales, worst = facts.scales if facts.loads else replace(facts.scales, loads=above), (0.0, "")
    if len(scales.loads) != len(facts.heights):
        return
    for number, row in enumerate(results.rows):
        drifts, shears = DRIFT.of_runs(results, number), SHEAR.of_runs(results, number)
        if drifts is not None and shears is not None:
            under = scales.divide(drifts / DRIFT.factor, "stability", shears / SHEAR.factor)
            worst = max(worst, (float(under.max()), row.label))
    coefficient, label = worst
    kind, least = (_UNSTABLE, _MOST) if facts.loads else (_WEIGHTS_OUT, _SMALL)
    if coefficient > least:
        yield kind.remark(label, measured=Measured(coefficient, ""))


def _motion_left(results: StudyResults, facts: BuildingFacts) -> Iterator[Remark]:
    if not facts.yield_drifts:
        return
    # The swing of the first mode with this kinetic energy, spread over the storeys.
    per_speed = facts.periods[0] / (2.0 * np.pi * len(facts.yield_drifts))
    energies = results.quantities.kinetic_energy[:, list(results.judged_motions), 0]
    largest = np.fmax.reduce(energies, axis=0, initial=0.0)
    swings = per_speed * np.sqrt(2.0 * largest / sum(facts.masses))
    moving = swings > _AT_REST * min(facts.yield_drifts)
    if moving.any():
        count, swing = int(moving.sum()), significant(1e3 * float(swings.max()), 2)
        yield _MOVES.remark(moving=count, motions=counted(moving.size, "motion"), swing=swing)
