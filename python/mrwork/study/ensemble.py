"""A study with each set of laws of its dampers that is as good: what it decides, and how far the sets are apart."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Table, TableColumn, text_table
from mrwork.closed_loop.evaluation import criteria
from mrwork.dampers.law_sets import SetsApart, sets_apart
from mrwork.dampers.parameters import polynomial_laws
from mrwork.dampers.simulation import Loading, simulate_force
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import SimulationError
from mrwork.store.codec import OrNan, Related
from mrwork.study.comparison import compared, compared_quantities, rounds_to_increase
from mrwork.study.results import StudyCriteria, StudyResults
from mrwork.study.run import simulate_history
from mrwork.study.study import Study


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What a study decides with each set of laws, of which the first is the chosen one, and whether that changes."""

    subject: str
    answers: tuple[str, ...]
    changes: bool

    @staticmethod
    def of(subject: str, answers: Sequence[str]) -> Verdict:
        """The verdict with its answers."""
        return Verdict(subject=subject, answers=tuple(answers), changes=len(set(answers)) > 1)

    @property
    def in_words(self) -> str:
        """Text such as "lowest score of the control laws: skyhook with sets 1, 2; clipped-optimal with set 3"."""
        parts = []
        for answer in dict.fromkeys(self.answers):
            sets = [str(number) for number, each in enumerate(self.answers, start=1) if each == answer]
            parts.append(f"{answer} with set{'s' if len(sets) > 1 else ''} {', '.join(sets)}")
        return f"{self.subject}: {'; '.join(parts) if self.changes else f'{self.answers[0]} with every set'}"


@dataclass(frozen=True, slots=True, kw_only=True)
class EnsembleRow:
    """A row of a study with each set of laws: its score, and its criteria as means over the judged motions.

    `spread_percent` is the largest minus the least of each criterion, per that of the chosen set.
    """

    controller: str
    scores: tuple[OrNan, ...]
    criteria: dict[str, tuple[OrNan, ...]]
    spread_percent: dict[str, OrNan]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Ensemble(Summarised, Related):
    """A study with each of the `sets` of laws of its dampers, the chosen one first: its verdicts and its criteria."""

    _made_by: ClassVar[str] = "mr.load(folder).ensemble"

    sets: tuple[str, ...]
    verdicts: tuple[Verdict, ...]
    rows: tuple[EnsembleRow, ...]

    def disagreement(self) -> str:
        """First contradiction: a verdict or a row of another number of sets."""
        numbers = [each.answers for each in self.verdicts] + [
            values for row in self.rows for values in (row.scores, *row.criteria.values())
        ]
        wrong = [len(each) for each in numbers if len(each) != len(self.sets)]
        return f"it has {wrong[0]} values for {len(self.sets)} sets of laws" if wrong else ""

    @property
    def in_words(self) -> tuple[str, ...]:
        """The sets, and each verdict that changes, a sentence each."""
        changing = [each.in_words for each in self.verdicts if each.changes]
        return (
            *(f"set {number}: {words}" for number, words in enumerate(self.sets, start=1)),
            *(f"verdict changes: {each}" for each in changing),
            *([] if changing else [f"none of {len(self.verdicts)} verdicts changes"]),
        )

    @property
    def table(self) -> Table:
        """Scores of each row from the least to the largest, and the spread of every compared quantity."""

        def score(row: EnsembleRow) -> str:
            known = [each for each in row.scores if math.isfinite(each)]
            return f"{min(known):.3f} to {max(known):.3f}" if known else "-"

        def spread(name: str) -> TableColumn:
            entry = next(each for each in criteria() if each.name == name)
            return TableColumn(heading=entry.short, cell=lambda row: f"{row.spread_percent[name]:.1f}")

        columns = [
            TableColumn(heading="largest minus least, % of set 1", cell=lambda row: row.controller),
            TableColumn(heading="score", cell=score),
            *(spread(entry.name) for entry in compared_quantities()),
        ]
        return text_table(columns, self.rows)

    def _summary(self) -> Summary:
        table = self.table
        return Summary(
            title=f"The study with {len(self.sets)} sets of laws",
            columns=table.columns,
            rows=table.rows,
            notes=self.in_words,
        )


def damper_in_words(spec: DamperSpec) -> str:
    """The model and the laws of the parameters that follow the command."""
    laws = () if spec.current is None else zip(damper(spec.name).names, spec.current.laws, strict=True)
    following = [f"{name} {law}" for name, law in laws if law != polynomial_laws()[0]]
    return f"{spec.name}, {', '.join(following) or 'all constant'}"


def ensemble_of(sets: Sequence[str], results: Sequence[StudyCriteria]) -> Ensemble:
    """The ensemble of the results with each set, whose rows and motions are those of the first."""
    return Ensemble(sets=tuple(sets), verdicts=tuple(_verdicts(results)), rows=tuple(_rows(results)))


def _verdicts(results: Sequence[StudyCriteria]) -> Iterator[Verdict]:
    """The first row of each rank, and whether the leading row is better than its references in each quantity."""
    comparisons = [compared(each) for each in results]
    main, labels = comparisons[0], [row.label for row in results[0].rows]
    for rank, rows in main.ranks:
        if len(rows) > 1:
            firsts = [{own.name: first[0] for own, first in each.ranks}[rank.name] for each in comparisons]
            yield Verdict.of(f"lowest score of {rank.title}", [labels[row] for row in firsts])
    leading = main.leading
    for reference in main.references:
        if leading is None or leading == reference:
            continue
        against = f"of {labels[leading]} against {labels[reference]}"
        scores = [(each.score(leading), each.score(reference)) for each in results]
        yield Verdict.of(f"score {against}", [_answer(*pair) for pair in scores])
        for entry in compared_quantities():
            means = [
                np.mean(
                    [each.ratios_to(leading, motion, reference)[entry.name] for motion in each.judged_motions]
                )
                for each in results
            ]
            answers = [
                "unknown"
                if math.isnan(each)
                else "worse"
                if rounds_to_increase(float(each) - 1.0)
                else "no worse"
                for each in means
            ]
            yield Verdict.of(f"{entry.title} {against}", answers)


def _answer(score: float, reference: float) -> str:
    return "unknown" if math.isnan(score + reference) else "lower" if score < reference else "no lower"


def _rows(results: Sequence[StudyCriteria]) -> Iterator[EnsembleRow]:
    for number, row in enumerate(results[0].rows):
        means = {
            entry.name: tuple(
                float(
                    np.mean(
                        [
                            (each.criteria(number, motion) or {}).get(entry.name, math.nan)
                            for motion in each.judged_motions
                        ]
                    )
                )
                for each in results
            )
            for entry in criteria()
        }
        yield EnsembleRow(
            controller=row.label,
            scores=tuple(each.score(number) for each in results),
            criteria=means,
            spread_percent={
                name: 100.0 * float(np.ptp(values)) / abs(values[0]) if values[0] else math.nan
                for name, values in means.items()
            },
        )


def dampers_apart(study: Study, results: StudyResults, *, threads: int = 0) -> str:
    """How far the sets of laws are apart where the tests end, over the run that goes farthest beyond.

    A sentence on the damper of which they are farthest apart; empty where none reaches the end of its tests.
    """
    reach: dict[tuple[int, int], float] = {}
    for row, motion in results.runs:
        fixed = row < len(study.arrangements) and study.arrangements[row].law is not None
        for each, device in zip(results.demands(row, motion) if fixed else (), study.devices, strict=False):
            if device.tested is not None and device.tested.velocity > 0.0:
                reach[row, motion] = max(
                    reach.get((row, motion), 0.0), each.demand.velocity / device.tested.velocity
                )
    if not study.other_sets or not reach:
        return ""
    row, motion = max(reach, key=lambda key: reach[key])
    history = simulate_history(study, study.arrangements[row], motion, threads)
    apart: list[tuple[SetsApart, str]] = []
    for number, device in enumerate(study.devices):
        if device.tested is None:
            continue
        x, v, sent = (
            np.ascontiguousarray(history.numbers[name][:, number])
            for name in ("deformation", "rate", "command")
        )
        motion_of = Loading(dt=study.hardware.sample_time, displacement=x, velocity=v)
        models = [
            (device.spec, device.draws[0]),
            *((each.dampers[number].spec, each.dampers[number].theta) for each in study.other_sets),
        ]
        forces = []
        # Without the sets from the first on that cannot be simulated there.
        with suppress(SimulationError):
            for spec, theta in models:
                unit = None if spec.current is None else spec.current.unit
                loading = replace(motion_of, command=None if unit is None else sent, command_unit=unit)
                forces.append(simulate_force(spec, theta, loading))
        found = sets_apart(device.tested, x, v, sent, np.array(forces)) if forces else None
        apart += [] if found is None else [(found, device.name)]
    if not apart:
        return ""
    found, name = max(apart, key=lambda each: each[0].percent)
    return f"{found.in_words}, {name} under {results.motions[motion].name} with {results.rows[row].label}"
