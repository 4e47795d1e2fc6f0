"""A study with each set of laws of its dampers: which verdict changes, and how far the sets are apart."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from mrwork.dampers.law_sets import SetsApart, sets_apart
from mrwork.dampers.simulation import Loading, simulate_force
from mrwork.errors import SimulationError
from mrwork.study.comparison import Comparison, compared, compared_quantities, rounds_to_increase
from mrwork.study.loop_case import LoopCase
from mrwork.study.results import Ensemble, StudyResults, StudyVerdict
from mrwork.study.study import Study


def ensemble_of(results: Sequence[StudyResults]) -> Ensemble:
    """The ensemble of the results with each set, all with the rows and motions of the first."""
    return Ensemble(
        sets=tuple(result.dampers[0].model if result.dampers else "" for result in results),
        verdicts=tuple(_verdicts([compared(result) for result in results])),
    )


def _verdicts(comparisons: Sequence[Comparison]) -> Iterator[StudyVerdict]:
    first = comparisons[0]
    labels = [row.label for row in first.results.rows]
    for index, (rank, rows) in enumerate(first.ranks):
        if len(rows) > 1:
            leaders = [comparison.ranks[index][1][0] for comparison in comparisons]
            leading = zip(comparisons, leaders, strict=True)
            yield StudyVerdict(
                subject=f"lowest score of {rank.title}",
                answers=tuple(labels[row] for row in leaders),
                values=tuple(each.results.score(row).mean for each, row in leading),
            )
    titles, row = ("the building without dampers", "the best passive damper"), first.leading
    for title, references in zip(
        titles, zip(*(comparison.references for comparison in comparisons), strict=True), strict=False
    ):
        if row is None or row in references:
            continue
        pairs = [*zip(comparisons, references, strict=True)]
        changes = {
            "score": [each.results.score(row).mean - each.results.score(other).mean for each, other in pairs]
        }
        for entry in compared_quantities():
            changes[entry.title] = [each.tables[row, other][entry.name].mean for each, other in pairs]
        for name, values in changes.items():
            subject = f"{name} of {labels[row]} against {title}"
            yield StudyVerdict(subject=subject, answers=tuple(map(_answer, values)), values=tuple(values))


def _answer(change: float) -> str:
    return "unknown" if math.isnan(change) else "worse" if rounds_to_increase(change) else "no worse"


def dampers_apart(study: Study, results: StudyResults, *, threads: int = 0) -> str:
    """How far the sets of laws are apart where the tests end, over the run that goes farthest beyond.

    A sentence on the damper of which they are farthest apart; empty where none reaches the end of its tests.
    """
    tested = {
        number: device.tested
        for number, device in enumerate(study.devices)
        if device.tested is not None and device.tested.velocity > 0.0
    }
    reach = {
        (row, motion): max(demands[number].demand.velocity / span.velocity for number, span in tested.items())
        for row, motion in np.argwhere(results.quantities.done[:, :, 0]).tolist()
        if tested and row < len(study.arrangements) and study.arrangements[row].law is not None
        if (demands := results.demanded.get((row, motion), ()))
    }
    if not study.other_sets or not reach:
        return ""
    row, motion = max(reach, key=lambda key: reach[key])
    case = LoopCase(
        arrangement=study.arrangements[row],
        motions=[study.grounds[motion]],
        hardware=study.hardware,
        threads=threads,
    )
    (history,) = case.responses(motion_numbers=[motion], histories=True).histories or ()
    apart: list[tuple[SetsApart, str]] = []
    for number, span in tested.items():
        x, v, sent = (
            np.ascontiguousarray(history.numbers[name][:, number])
            for name in ("deformation", "rate", "command")
        )
        forces, device = [], study.devices[number]
        sets = [device, *(other.dampers[number] for other in study.other_sets)]
        # Without the sets from the first on that cannot be simulated there.
        with suppress(SimulationError):
            for spec, theta in ((one.spec, one.draws[0]) for one in sets):
                loading = Loading(dt=study.hardware.sample_time, displacement=x, velocity=v)
                if spec.command_unit is not None:
                    loading = replace(loading, command=sent, command_unit=spec.command_unit)
                forces.append(simulate_force(spec, theta, loading))
        if forces and (gap := sets_apart(span, x, v, sent, np.array(forces))) is not None:
            apart.append((gap, device.name))
    if not apart:
        return ""
    gap, name = max(apart, key=lambda pair: pair[0].percent)
    return f"{gap.in_words}, {name} under {results.motions[motion].name} with {results.rows[row].label}"
