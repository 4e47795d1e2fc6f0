"""What loops in JAX, as those with dampers of the user, do not have."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from mrwork.buildings.device import Device
from mrwork.buildings.groups import commanded
from mrwork.buildings.plane_building import Building
from mrwork.closed_loop.hardware import Hardware
from mrwork.control.laws.control_law import control_laws
from mrwork.motions.ground_motion import GroundMotion

OWN_LAWS = (
    "passive", "proportional_direct", "signal_network", "clipped_optimal", "modified_clipped_optimal", "lyapunov",
)  # fmt: skip
"""Laws of the registry that loops in JAX have, as `LAWS` of `twins/loop_laws.py`."""


def lacking_in_twin(
    building: Building, hardware: Hardware, law: str, motions: Iterable[GroundMotion]
) -> list[str]:
    """What a loop in JAX does not have, in words; `law` is what it is called, empty for a table of commands."""
    noisy = any(noise or resolution for noise, resolution in hardware.sensors)
    return [
        name
        for name, wanted in (
            (f"the law {law}", law not in ("", *OWN_LAWS)),
            ("passive elements, yield or P-delta", bool(building.elements or building.nonlinear)),
            ("an observer", hardware.feedback != "state"),
            ("sensors with noise or a resolution", noisy),
            ("faults", bool(hardware.faults)),
            ("forces on floors", any(motion.forces.size for motion in motions)),
        )
        if wanted
    ]


def beyond_twin(
    building: Building,
    devices: Sequence[Device],
    hardware: Hardware,
    law: str = "passive",
    motions: Iterable[GroundMotion] = (),
) -> str:
    """A sentence on what a loop with dampers of the user does not have; empty where nothing is in the way.

    `law` is the name of a law of the registry, or what another one is called. Ideal actuators replace the dampers.
    """
    actuators = any(spec.name == law and spec.commands_force for spec in control_laws())
    simulated = devices[len(commanded(devices)) :] if actuators else devices
    user_dampers = [device.spec.name for device in simulated if device.spec.own is not None]
    lacking = lacking_in_twin(building, hardware, law, motions) if user_dampers else []
    lacking += ["actuators"] * any(device.is_actuator for device in simulated if user_dampers)
    if not lacking:
        return ""
    return (
        f"{user_dampers[0]} is a damper of your own, and its loop cannot have {', or '.join(lacking)}; let a "
        'model of the package take its place by like = "normalised_bouc_wen" beside its run, or mr.fit_like(fit)'
    )
