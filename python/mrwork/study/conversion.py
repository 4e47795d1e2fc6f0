"""Responses of a batch as the runs of a study."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mrwork.closed_loop.responses import History as Trace
from mrwork.closed_loop.responses import Responses
from mrwork.simulate import Outcome
from mrwork.study.results import Key, Motion, Row, StudyResults
from mrwork.study.run_result import History, RunResult
from mrwork.study.study import Arrangement, Study


def result_of(responses: Responses, run: int, arrangement: Arrangement) -> RunResult:
    """One run of a batch, its floors and storeys those of the bare building."""
    floors, storeys = list(arrangement.floors), list(arrangement.storeys)
    # What is put in without being a device, as isolators, strokes too.
    others = [number for number in arrangement.strokes if number < responses.peak_drift.shape[1]]
    stroke = responses.peak_stroke[run] if arrangement.devices else responses.peak_drift[run, others]
    devices = slice(len(arrangement.devices))
    # An ideal actuator is told a force, which is no current.
    active = arrangement.law is not None and arrangement.law.name == "active"
    driven = slice(0) if active else devices
    return RunResult(
        outcome=Outcome(int(responses.outcome[run])).name.lower(),
        peak_displacement=responses.peak_displacement[run, floors],
        rms_displacement=responses.rms_displacement[run, floors],
        peak_drift=responses.peak_drift[run, storeys],
        rms_drift=responses.rms_drift[run, storeys],
        peak_acceleration=responses.peak_acceleration[run, floors],
        rms_acceleration=responses.rms_acceleration[run, floors],
        peak_base_shear=np.asarray(responses.peak_base_shear[run]),
        rms_base_shear=np.asarray(responses.rms_base_shear[run]),
        peak_force=responses.peak_force[run, devices],
        peak_stroke=stroke,
        mean_current=responses.mean_current[run, driven],
        rms_current=responses.rms_current[run, driven],
        input_energy=float(responses.input_energy[run]),
        kinetic_energy=float(responses.kinetic_energy[run]),
        strain_energy=float(responses.strain_energy[run]),
        damping_energy=float(responses.damping_energy[run]),
        device_energy=responses.device_energy[run, devices],
        energy_error=float(responses.energy_error[run]),
        steps=int(responses.steps[run]),
    )


def history_of(trace: Trace, arrangement: Arrangement) -> History:
    """A run in time, its floors and storeys those of the bare building."""
    floors, storeys = list(arrangement.floors), list(arrangement.storeys)
    devices = slice(len(arrangement.devices))
    energies = (
        trace.input_energy,
        trace.kinetic_energy(arrangement.building),
        trace.strain_energy(arrangement.building),
        trace.damping_energy,
        trace.device_energy[:, devices].sum(axis=1),
    )
    return History(
        time=trace.time,
        ground_acceleration=trace.ground_acceleration,
        displacement=trace.displacement[:, floors],
        acceleration=trace.acceleration[:, floors],
        drift=trace.drift[:, storeys],
        deformation=trace.deformation[:, devices],
        rate=trace.rate[:, devices],
        force=trace.force[:, devices],
        command=trace.command[:, devices],
        current=trace.current[:, devices],
        energy=np.stack(energies, axis=1),
    )


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
