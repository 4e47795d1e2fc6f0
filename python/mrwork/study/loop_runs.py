"""Calls of the loop for a study: an arrangement under motions, candidates of a law, with realisations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np

from mrwork.base.values import Floats
from mrwork.buildings import Building
from mrwork.buildings.matrices import Device
from mrwork.closed_loop.evaluation import Scales
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.responses import Responses, command_unit_of
from mrwork.closed_loop.simulate import GainChanges, LoopVariation, simulate_loop
from mrwork.control.laws.control_law import ControlLaw
from mrwork.dampers.spec import damper
from mrwork.errors import SettingError
from mrwork.motions import GroundMotion
from mrwork.study.realisations import Realisations
from mrwork.study.runs import Runs, candidate_axes, runs_of
from mrwork.study.study import Arrangement, StudyLaw

OnBlock = Callable[[int, int], None]
"""Called with the runs that are done and all of a call."""


def simulate(
    arrangement: Arrangement,
    law: StudyLaw,
    motions: Sequence[GroundMotion],
    hardware: Hardware,
    *,
    variation: LoopVariation | None = None,
    motion_numbers: Sequence[int] | None = None,
    theta: Sequence[Floats] = (),
    largest_commands: Floats | None = None,
    shaping: Floats | None = None,
    histories: bool = False,
    step_factor: int = 1,
    threads: int = 0,
    on_block: OnBlock | None = None,
) -> Responses:
    """Simulate an arrangement under candidates of a law, see `simulate_loop`; `theta` are draws of its dampers."""
    devices, law = with_devices(arrangement, law)
    if not arrangement.devices:
        # What nothing is fed back to needs no observer.
        hardware = replace(hardware, feedback="state", measured_floors=None, known_ground=False)
    elif theta:
        devices = tuple(replace(device, theta=rows) for device, rows in zip(devices, theta, strict=True))
    return simulate_loop(
        arrangement.building,
        devices,
        law,
        motions,
        hardware,
        variation=variation,
        motion_numbers=motion_numbers,
        largest_commands=largest_commands,
        shaping=shaping,
        histories=histories,
        step_factor=step_factor,
        threads=threads,
        on_progress=on_block,
    )


def simulate_criteria(
    arrangement: Arrangement,
    law: StudyLaw,
    motions: Sequence[GroundMotion],
    hardware: Hardware,
    realisations: Realisations,
    *,
    bare: Building,
    largest_commands: Floats | None = None,
    shaping: Floats | None = None,
    threads: int = 0,
    on_block: OnBlock | None = None,
    changes: GainChanges | None = None,
) -> Runs:
    """Criteria of candidates of a law under motions, with realisations, in one call of the core.

    The observer, if there is one, is that of the nominal building. `largest_commands` and `shaping` are those of the
    candidates, see `simulate_loop`, and `changes` make candidates of one law.
    """
    noisy = any(noise for noise, _ in hardware.sensors)
    factors = list(zip(realisations.stiffness.tolist(), realisations.damping.tolist(), strict=True))
    buildings = {
        (stiffness, damping): vary_building(arrangement, bare, stiffness=stiffness, damping=damping)
        for stiffness, damping in dict.fromkeys(factors)
    }
    began = perf_counter()
    responses = simulate(
        arrangement,
        law,
        motions,
        hardware,
        variation=LoopVariation(
            buildings=tuple(buildings[each] for each in factors),
            delay=realisations.delay,
            seed=realisations.seed if noisy else np.zeros_like(realisations.seed),
            changes=changes,
        ),
        theta=realisations.theta,
        largest_commands=largest_commands,
        shaping=shaping,
        threads=threads,
        on_block=on_block,
    )
    seconds = perf_counter() - began
    axes = candidate_axes(responses.shape[0], motions, len(realisations))
    runs = runs_of(responses, arrangement, law, axes, seconds=seconds)
    return runs.criteria(scales_of(arrangement, bare), command_unit_of(arrangement.devices))


def scales_of(arrangement: Arrangement, bare: Building) -> Scales:
    """What the criteria of an arrangement are divided by: numbers of its own storeys, which baselines may change."""
    own, storeys = arrangement.building, [*arrangement.storeys]
    heights, yields, loads = (
        each[storeys] if each.size else each for each in (own.heights, own.yield_drifts, own.loads)
    )
    return Scales(weight=Scales.of(bare).weight, heights=heights, yield_drifts=yields, loads=loads)


def with_devices(arrangement: Arrangement, law: StudyLaw) -> tuple[tuple[Device, ...], StudyLaw]:
    """Devices and law of an arrangement; without devices it gets an actuator of zero force."""
    if arrangement.devices:
        return arrangement.devices, law
    building, spec = arrangement.building, damper("dahl")
    device = Device(name="none", spec=spec, theta=spec.nominal, row=building.storeys[0], largest_command=1.0)
    still = ControlLaw(name="active", gains={"gain": np.zeros((1, 2 * building.n_coordinates))})
    return (device,), still


def vary_building(arrangement: Arrangement, bare: Building, *, stiffness: float, damping: float) -> Building:
    """The building of an arrangement with factors of stiffness and damping of the bare building.

    What is built into it stays, such as the spring of a tuned mass, so that it is no longer tuned.
    """
    if stiffness == 1.0 and damping == 1.0:
        return arrangement.building
    building = arrangement.building
    if stiffness != 1.0 and any(each.in_stiffness for each in building.elements):
        raise SettingError(
            f"{building.name} has storeys that yield, of which strength and stiffness go together; leave the stiffness "
            "of the building out of its uncertainty"
        )
    drifts = bare.drifts
    if building.n_coordinates == bare.n_coordinates:
        back: Floats = np.eye(bare.n_coordinates)
    elif drifts.shape[0] == bare.n_coordinates and np.linalg.matrix_rank(drifts) == bare.n_coordinates:
        # Displacements of the bare building relative to its base, from its drifts within the arrangement.
        back = np.asarray(np.linalg.solve(drifts, building.storeys[list(arrangement.storeys)]))
    else:
        raise SettingError(
            f"{building.name}: stiffness and damping of the building cannot be told from those of what was added to "
            "it, because its storeys do not determine its coordinates; leave both out of its uncertainty"
        )
    return replace(
        building,
        stiffness=building.stiffness + (stiffness - 1.0) * back.T @ bare.stiffness @ back,
        damping=building.damping + (damping - 1.0) * back.T @ bare.damping @ back,
    )
