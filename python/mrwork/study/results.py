"""What a study has found: its runs, and the criteria that follow from them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mrwork.closed_loop.evaluation import criteria, ratio, score, values
from mrwork.closed_loop.responses import ENERGY_TOLERANCE
from mrwork.study.run_result import RunResult
from mrwork.summary import Summarised, Summary, listed, rounded
from mrwork.units import STANDARD_GRAVITY

Key = tuple[int, int]
"""A run: the numbers of its row and motion."""

# Columns of a summary beside the label of a row.
_MOTIONS_SHOWN = 5

Kind = Literal["uncontrolled", "passive_off", "baseline", "controller"]

OFF_BALANCE = (
    "Energies that do not add up show that a law chatters, or that the steps are too long for what happens in them: "
    "halve the step and compare, as --check-step does."
)
"""What to do about it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One arrangement as tables show it: label, what kind it is, what it consists of."""

    label: str
    kind: Kind
    says: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """A ground motion as tables show it: peak [m/s^2], duration [s], what was done to it."""

    name: str
    peak: float
    duration: float
    source: str = ""
    changes: tuple[str, ...] = ()
    synthetic: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class StudyResults(Summarised):
    """Runs by (row, motion), as far as they are done; the first rows are the building without dampers and i = 0.

    `mass` is that of the building [kg], `facts` what else a page says of building, dampers and loop. `halved` are the
    runs again with half the step, where they were asked for.
    """

    title: str
    rows: tuple[Row, ...]
    motions: tuple[Motion, ...]
    runs: Mapping[Key, RunResult]
    floor_names: tuple[str, ...]
    storey_names: tuple[str, ...]
    device_names: tuple[str, ...]
    command_unit: str
    mass: float
    facts: tuple[tuple[str, str], ...] = ()
    halved: Mapping[Key, RunResult] | None = None

    @property
    def done(self) -> int:
        """How many runs there are, those with half the step too."""
        return len(self.runs) + len(self.halved or ())

    @property
    def wanted(self) -> int:
        """How many there are to be."""
        return len(self.rows) * len(self.motions) * (1 if self.halved is None else 2)

    @property
    def complete(self) -> bool:
        """Whether no run is missing."""
        return self.done == self.wanted

    def finished(self, motion: int) -> list[int]:
        """The rows whose run under a motion finished."""
        runs = ((row, self.runs.get((row, motion))) for row in range(len(self.rows)))
        return [row for row, run in runs if run is not None and run.finished]

    def row_of(self, kind: Kind) -> int | None:
        """The first row of a kind, if there is one."""
        return next((number for number, row in enumerate(self.rows) if row.kind == kind), None)

    def criteria(self, row: int, motion: int) -> dict[str, float] | None:
        """Every criterion of a run that finished."""
        return self._criteria(self.runs.get((row, motion)))

    def step_changes(self, row: int, motion: int) -> dict[str, float] | None:
        """How far half the step moves every criterion, over its value; none where one of the two runs has none."""
        whole = self.criteria(row, motion)
        half = self._criteria((self.halved or {}).get((row, motion)))
        if whole is None or half is None:
            return None
        return {name: _relative_change(value, half[name]) for name, value in whole.items()}

    def _criteria(self, run: RunResult | None) -> dict[str, float] | None:
        if run is None or not run.finished:
            return None
        found = values(run, weight=self.mass * STANDARD_GRAVITY)
        return {name: float(value) for name, value in found.items()}

    def ratios(self, row: int, motion: int, against: Kind) -> dict[str, float]:
        """Criteria over those without dampers or at i = 0; NaN where there is nothing to divide by."""
        reference = self.row_of(against)
        above = self.criteria(row, motion)
        below = None if reference is None else self.criteria(reference, motion)
        if above is None or below is None:
            return {entry.name: float("nan") for entry in criteria()}
        named = {
            entry.name: entry.uncontrolled if against == "uncontrolled" else entry.name
            for entry in criteria()
        }
        return {
            name: float(ratio(np.array(above[name]), np.array(below[other]))) if other else float("nan")
            for name, other in named.items()
        }

    def score(self, row: int) -> float:
        """The mean over motions of the criteria over those at i = 0; NaN unless all its runs finished."""
        reference = self.row_of("passive_off")
        if reference is None:
            return float("nan")
        ours = [self.criteria(row, motion) for motion in range(len(self.motions))]
        passive = [self.criteria(reference, motion) for motion in range(len(self.motions))]
        pairs = [(one, other) for one, other in zip(ours, passive, strict=True) if one and other]
        if len(pairs) < len(self.motions):
            return float("nan")
        arrays = [
            [{name: np.array(value) for name, value in each.items()} for each in pair] for pair in pairs
        ]
        return float(score([one for one, _ in arrays], [other for _, other in arrays]))

    @property
    def balanced(self) -> bool:
        """Whether the energies of all runs that finished add up."""
        return all(run.balanced for run in self.runs.values() if run.finished)

    def warnings(self) -> list[str]:
        """What a reader must know of runs that did not finish or whose energy does not add up."""
        said = []
        for number, row in enumerate(self.rows):
            runs = [
                (self.motions[motion].name, run)
                for (each, motion), run in sorted(self.runs.items())
                if each == number
            ]
            for name, run in runs:
                if run.outcome != "finished":
                    lost = "" if run.finished else " It has no criteria."
                    said.append(f"{row.label} under {name} {run.end}.{lost}")
            # A balance that is no number does not hold either.
            off = [(run.energy_error, name) for name, run in runs if run.finished and not run.balanced]
            if off:
                worst, name = max(off, key=lambda each: math.inf if math.isnan(each[0]) else each[0])
                said.append(
                    f"{row.label}: the energies miss each other by up to {worst:.1e} of what was turned over, under "
                    f"{name}; {len(off)} of {len(runs)} runs are above {ENERGY_TOLERANCE:.0e}."
                )
        return said

    def _summary(self) -> Summary:
        drifts = [
            [
                None if found is None else found["peak_drift"]
                for motion in range(len(self.motions))
                for found in [self.criteria(row, motion)]
            ]
            for row in range(len(self.rows))
        ]
        return Summary(
            title=f"{self.title}: {self.done} of {self.wanted} runs",
            facts=(
                ("dampers", listed(self.device_names)),
                ("motions", listed([motion.name for motion in self.motions])),
            ),
            columns=("peak drift [m]", *(motion.name for motion in self.motions[:_MOTIONS_SHOWN])),
            rows=[
                (row.label, *(rounded(drift) for drift in found[:_MOTIONS_SHOWN]))
                for row, found in zip(self.rows, drifts, strict=True)
            ],
        )


def _relative_change(value: float, other: float) -> float:
    if value == other:
        return 0.0
    return abs(other - value) / abs(value) if value != 0.0 else math.inf
