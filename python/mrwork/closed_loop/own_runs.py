"""Runs of a loop with dampers of the user, by the twin of the loop, and what the twin does not have."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats
from mrwork.buildings.matrices import Building, Device
from mrwork.closed_loop.hardware import Hardware
from mrwork.control.laws.control_law import ControlLaw, control_laws
from mrwork.motions.ground_motion import GroundMotion

OWN_LAWS = (
    "passive",
    "proportional_direct",
    "signal_network",
    "clipped_optimal",
    "modified_clipped_optimal",
    "lyapunov",
)
"""Laws of the registry that loops with dampers of the user have: those of `LAWS` in `twins/own_loop.py`."""


def beyond_twin(
    building: Building,
    devices: Sequence[Device],
    hardware: Hardware,
    law: str = "passive",
    *,
    signals: bool = False,
) -> str:
    """A sentence on what a loop with dampers of the user does not have; empty where nothing is in the way.

    `law` is the name of a law of the registry, or what another one is called. Ideal actuators replace the dampers.
    """
    actuators = any(spec.name == law and spec.commands_force for spec in control_laws())
    if actuators or not devices or devices[0].spec.own is None:
        return ""
    noisy = any(noise or resolution for noise, resolution in hardware.sensors)
    lacking = [
        name
        for name, wanted in (
            (f"the law {law}", law not in OWN_LAWS),
            (f"further signals of {law}", signals),
            ("passive elements", bool(building.elements)),
            ("an observer", hardware.feedback != "state"),
            ("sensors with noise or a resolution", noisy),
            ("faults and prescribed commands", bool(hardware.faults)),
        )
        if wanted
    ]
    if not lacking:
        return ""
    return (
        f"{devices[0].spec.name} is a damper of your own, and its loop cannot have {', or '.join(lacking)}; let a "
        'model of the package take its place by like = "normalised_bouc_wen" beside its run, or mr.fit_like(fit)'
    )


def respond_own(
    *,
    building: Building,
    varied: Sequence[tuple[Floats, Floats]],
    devices: Sequence[Device],
    law: ControlLaw,
    hardware: Hardware,
    motions: Sequence[GroundMotion],
    step_factor: int,
    runs: NDArray[np.uint32],
    gains: Floats,
    shaping: Floats | None,
    theta: Floats,
    histories: bool,
    widths: tuple[int, int],
) -> Any:
    """Simulate runs as `_rust.respond` does, and return the same; `gains` are rows of `ControlLaw.gain_rows`.

    `widths` are the numbers of a summary and of a row of a history.
    """
    # JAX is needed for dampers of the user only.
    from mrwork.twins.own_loop import OwnLoop, respond

    n_devices, n_states = len(devices), 2 * building.n_coordinates
    by_name, start = {}, 0
    for gain in law.spec.gains:
        if gain.name in law.gains:
            shape = gain.shape_for(n_devices, n_states)
            columns = gains[:, start : start + math.prod(shape)]
            by_name[gain.name] = columns.reshape(len(gains), *shape)
            start += columns.shape[1]
    names = ("mass", "damping", "stiffness", "influence", "floors", "storeys")
    return respond(
        OwnLoop(
            matrices={name: np.asarray(getattr(building, name), dtype=np.float64) for name in names},
            varied=varied,
            dampers=devices,
            believed=None
            if law.curve is None
            else [replace(device, spec=law.curve[0], theta=law.curve[1]) for device in devices],
            largest=np.array([device.largest_command for device in devices]),
            law=law.name,
            motions=[
                (motion.dt, np.ascontiguousarray(motion.acceleration, dtype=np.float64)) for motion in motions
            ],
            sample_time=hardware.sample_time,
            steps=hardware.steps,
            delay=hardware.delay_steps,
            command_rate=hardware.command_rate,
            step_factor=step_factor,
            widths=widths,
        ),
        runs,
        by_name,
        shaping,
        theta,
        histories=histories,
    )
