"""Responses of a batch as the runs of a study."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mrwork.closed_loop.simulate import Responses, Trace
from mrwork.response.results import Motion, Row, StudyResults
from mrwork.response.run_result import History, RunResult
from mrwork.response.study import Arrangement, Study


def result_of(responses: Responses, run: int, arrangement: Arrangement) -> RunResult:
    """One run of a batch, its floors and storeys those of the bare building."""
    floors, storeys = list(arrangement.floors), list(arrangement.storeys)
    # What is put in without being a device, as isolators, strokes too.
    others = [number for number in arrangement.strokes if number < responses.peak_drift.shape[1]]
    stroke = responses.peak_stroke[run] if arrangement.devices else responses.peak_drift[run, others]
    return RunResult(
        outcome=str(responses.outcome[run]),
        peak_displacement=responses.peak_displacement[run, floors],
        rms_displacement=responses.rms_displacement[run, floors],
        peak_drift=responses.peak_drift[run, storeys],
        rms_drift=responses.rms_drift[run, storeys],
        peak_acceleration=responses.peak_acceleration[run, floors],
        rms_acceleration=responses.rms_acceleration[run, floors],
        peak_base_shear=np.asarray(responses.peak_base_shear[run]),
        rms_base_shear=np.asarray(responses.rms_base_shear[run]),
        peak_force=responses.peak_force[run],
        rms_force=responses.rms_force[run],
        peak_stroke=stroke,
        mean_command=responses.mean_command[run],
        rms_command=responses.rms_command[run],
        input_energy=float(responses.input_energy[run]),
        kinetic_energy=float(responses.kinetic_energy[run]),
        strain_energy=float(responses.strain_energy[run]),
        damping_energy=float(responses.damping_energy[run]),
        devices_energy=responses.devices_energy[run],
        energy_error=float(responses.energy_error[run]),
        substeps=int(responses.substeps[run]),
    )


def history_of(trace: Trace, arrangement: Arrangement) -> History:
    """A run in time, its floors and storeys those of the bare building."""
    floors, storeys = list(arrangement.floors), list(arrangement.storeys)
    return History(
        time=trace.time,
        ground=trace.ground,
        displacement=trace.displacement[:, floors],
        acceleration=trace.acceleration[:, floors],
        drift=trace.drift[:, storeys],
        deformation=trace.deformation,
        velocity=trace.velocity,
        force=trace.force,
        command=trace.command,
        current=trace.current,
        energy=trace.energy,
    )


def results_of(
    study: Study, rows: tuple[Row, ...], runs: Mapping[tuple[int, int], RunResult]
) -> StudyResults:
    """What a study has found so far."""
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
    )
