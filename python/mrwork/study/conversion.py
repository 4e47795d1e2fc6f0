"""Responses of a batch as the runs of a study."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_type_hints

import numpy as np

from mrwork.closed_loop.responses import History as Trace
from mrwork.closed_loop.responses import Quantity, Responses, history_signals, run_quantities
from mrwork.simulate import Outcome
from mrwork.study.results import Key, Motion, Row, StudyResults
from mrwork.study.run_result import History, RunResult
from mrwork.study.study import Arrangement, Study

# What a study keeps of a run, with its type.
_KEPT = get_type_hints(RunResult)


def result_of(responses: Responses, run: int, arrangement: Arrangement) -> RunResult:
    """One run of a batch, its floors and storeys those of the bare building."""
    kept: dict[str, Any] = {}
    for quantity in run_quantities():
        if quantity.name in _KEPT:
            values = getattr(responses, quantity.name)[(run, *_selected(quantity, arrangement))]
            kept[quantity.name] = float(values) if _KEPT[quantity.name] is float else np.asarray(values)
    if not arrangement.devices:
        # Equipment that is not a device, as isolators, has a stroke too.
        others = [number for number in arrangement.strokes if number < responses.peak_drift.shape[1]]
        kept["peak_stroke"] = responses.peak_drift[run, others]
    if arrangement.law is not None and arrangement.law.spec.commands_force:
        # The command of an ideal actuator is a force, not a current.
        kept |= {name: kept[name][:0] for name in ("mean_current", "rms_current")}
    return RunResult(
        outcome=Outcome(int(responses.outcome[run])).name.lower(),
        steps=int(responses.steps[run]),
        **kept,
    )


def _selected(quantity: Quantity, arrangement: Arrangement) -> tuple[list[int] | slice, ...]:
    """Index of the columns that belong to the bare building and the devices of the arrangement."""
    match quantity.axis:
        case "floor":
            return (list(arrangement.floors),)
        case "storey":
            return (list(arrangement.storeys),)
        case "device":
            return (slice(len(arrangement.devices)),)
        case _:
            return ()


def history_of(trace: Trace, arrangement: Arrangement) -> History:
    """A run in time, its floors and storeys those of the bare building."""
    energies = (
        trace.input_energy,
        trace.kinetic_energy(arrangement.building),
        trace.strain_energy(arrangement.building),
        trace.damping_energy,
        trace.device_energy[:, : len(arrangement.devices)].sum(axis=1),
    )
    kept = {
        signal.name: getattr(trace, signal.name)[(slice(None), *_selected(signal, arrangement))]
        for signal in history_signals()
        if signal.name in History.__slots__
    }
    return History(time=trace.time, energy=np.stack(energies, axis=1), **kept)


def results_of(
    study: Study,
    rows: tuple[Row, ...],
    runs: Mapping[Key, RunResult],
    halved: Mapping[Key, RunResult] | None,
) -> StudyResults:
    """What a study has found so far; `halved` are the runs with half the step, where they are asked for."""
    bare = study.building
    return StudyResults(
        title=study.title,
        rows=rows,
        motions=tuple(
            Motion(
                name=motion.name,
                peak=motion.peak,
                duration=motion.duration,
                source=motion.source,
                changes=motion.changes,
                synthetic=number in study.synthetic,
            )
            for number, motion in enumerate(study.motions)
        ),
        runs=dict(runs),
        floor_names=bare.floor_names,
        storey_names=bare.storey_names[: len(bare.drifts)],
        device_names=study.device_names,
        command_unit=study.command_unit,
        mass=bare.total_mass,
        facts=study.facts,
        halved=None if halved is None else dict(halved),
    )
