"""What the runs of a study follow from, bit for bit."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
from numpy.typing import ArrayLike

from mrwork.motions import GroundMotion
from mrwork.store import digest_of
from mrwork.store.fingerprint import package_version
from mrwork.study.study import Arrangement, Study


def premises_of(study: Study) -> dict[str, object]:
    """What a journal and who resumes it share."""
    return {
        "arrangement": [
            {"label": each.row.label, "kind": each.row.kind, "content": digest_of_run(each)}
            for each in study.arrangements
        ],
        "motion": [{"name": motion.name, "content": _digest_of_motion(motion)} for motion in study.motions],
        "hardware": asdict(study.hardware),
        "version": {name: package_version(name) for name in ("mrwork", "numpy", "scipy")},
    }


def digest_of_run(arrangement: Arrangement, *motions: GroundMotion) -> str:
    """Digest of all that goes into the runs of an arrangement, but for the hardware."""
    building, law = arrangement.building, arrangement.law
    devices = [
        (
            device.spec,
            _digest(device.draws),
            _digest(device.row),
            device.count,
            device.differential,
            device.largest_command,
        )
        for device in arrangement.devices
    ]
    numbers = {} if law is None else {**law.gains, **law.tables}
    return digest_of(
        building.mass,
        building.damping,
        building.stiffness,
        building.influence,
        building.floors,
        building.storeys,
        devices,
        None if law is None else law.name,
        None if law is None or law.curve is None else (law.curve[0], _digest(law.curve[1])),
        sorted((name, _digest(array)) for name, array in numbers.items()),
        *(_digest_of_motion(motion) for motion in motions),
    )


def _digest(numbers: ArrayLike) -> str:
    return digest_of(np.asarray(numbers, dtype=np.float64))


def _digest_of_motion(motion: GroundMotion) -> str:
    return digest_of(motion.dt, motion.acceleration)
