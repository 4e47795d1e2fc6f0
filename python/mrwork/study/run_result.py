"""A run of a study, one arrangement under one ground motion: its numbers, its history, its demand on the dampers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, get_type_hints

import numpy as np

from mrwork.buildings.devices import Device
from mrwork.closed_loop.responses import (
    ENERGY_TOLERANCE,
    History,
    Quantity,
    Responses,
    history_signals,
    run_quantities,
)
from mrwork.dampers.spec import worst_laws
from mrwork.records.operating_range import (
    Exceedance,
    OperatingRange,
    Outside,
    covering,
    least_stroke,
    worst_of,
)
from mrwork.simulate import Outcome
from mrwork.store.record import OneOf, rebuilt
from mrwork.study.study import Arrangement
from mrwork.values import Floats, holds_arrays

_ENDS = {
    Outcome.FINISHED: "finished",
    Outcome.DIVERGED: "diverged",
    Outcome.UNRESOLVED: "could not be resolved",
    Outcome.ABANDONED: "was abandoned",
    Outcome.FAILED_SAFE: "failed safe",
}


OutcomeName = Annotated[str, OneOf(tuple(each.name.lower() for each in Outcome))]
"""How a run ended, as results files have it."""


class RunEnd:
    """How a run ended: its outcome, and whether its energies balance."""

    __slots__ = ()

    outcome: str
    energy_error: float

    @property
    def finished(self) -> bool:
        """Whether the run has results."""
        return self.outcome in ("finished", "failed_safe")

    @property
    def end(self) -> str:
        """The outcome as words that follow the name of the run, with a remedy."""
        outcome = Outcome[self.outcome.upper()]
        return _ENDS[outcome] if outcome is Outcome.FINISHED else f"{_ENDS[outcome]}: {outcome.remedy}"

    @property
    def balanced(self) -> bool:
        """Whether the energies balance."""
        return self.energy_error <= ENERGY_TOLERANCE


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class RunResult(RunEnd):
    """Peaks and root mean squares of floors, storeys and devices, final energies [J], and how the run ended.

    Force, stroke and energy of devices are those of the dampers, then those of the passive elements of the building.

    `outcome` is "finished", "failed_safe" if a sensor failed and the dampers had no command, or the reason why the run
    did not finish. `energy_error` is the imbalance of energy over the largest energy. `steps` is the number of
    integration steps per sample. `least_stroke` is that of `OperatingRange` [m] for each damper, empty for a run whose
    history was not simulated.
    """

    outcome: str
    peak_displacement: Floats
    rms_displacement: Floats
    peak_drift: Floats
    rms_drift: Floats
    peak_acceleration: Floats
    rms_acceleration: Floats
    peak_base_shear: Floats
    rms_base_shear: Floats
    peak_force: Floats
    peak_stroke: Floats
    peak_rate: Floats
    peak_current: Floats
    mean_current: Floats
    rms_current: Floats
    input_energy: float
    kinetic_energy: float
    strain_energy: float
    damping_energy: float
    device_energy: Floats
    energy_error: float
    steps: int
    least_stroke: Floats = field(default_factory=lambda: np.empty(0))


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class RunHistory:
    """The history of a run: shapes (n_time,), for floors, storeys and devices (n_time, n).

    `energy` has the columns input, kinetic, strain, damping and devices [J], cumulative from the start; passive
    elements count among the devices.
    """

    time: Floats
    ground_acceleration: Floats
    displacement: Floats
    acceleration: Floats
    drift: Floats
    deformation: Floats
    rate: Floats
    force: Floats
    command: Floats
    current: Floats
    energy: Floats


_KEPT = get_type_hints(RunResult)
_HISTORY = get_type_hints(RunHistory)
# What a quantity of devices is called for passive elements, where results have both side by side.
_OF_ELEMENTS = {
    "peak_force": "peak_element_force",
    "peak_stroke": "peak_element_stroke",
    "device_energy": "element_energy",
}
_COMMANDS = ("peak_current", "mean_current", "rms_current")


def result_of(responses: Responses, run: int, arrangement: Arrangement) -> RunResult:
    """The result of a run of a batch, for the floors and storeys of the bare building."""
    kept: dict[str, Any] = {}
    for quantity in run_quantities():
        if quantity.name in _KEPT:
            values = own_columns(responses, quantity, arrangement)[run]
            kept[quantity.name] = float(values) if _KEPT[quantity.name] is float else np.asarray(values)
    if arrangement.has_actuators:
        # The command of an ideal actuator is a force, not a current.
        kept |= {name: kept[name][:0] for name in _COMMANDS}
    if responses.histories is not None and arrangement.devices and np.isfinite(responses.energy_error[run]):
        strokes = responses.histories[run].deformation[:, : len(arrangement.devices)]
        kept["least_stroke"] = np.array([least_stroke(each) for each in strokes.T])
    return RunResult(
        outcome=Outcome(int(responses.outcome[run])).name.lower(),
        steps=int(responses.steps[run]),
        **kept,
    )


def read_recorded(record: Mapping[str, Any], arrangement: Arrangement) -> RunResult:
    """The result of a run from its line of a journal."""
    result = rebuilt(RunResult, record)
    _ = Outcome[result.outcome.upper()]
    sizes = {
        "floor": len(arrangement.floors),
        "storey": len(arrangement.storeys),
        "device": len(arrangement.devices),
    }
    n_elements = len(arrangement.building.elements)
    for quantity in run_quantities():
        if _KEPT.get(quantity.name, float) is float:
            continue
        found = getattr(result, quantity.name).shape
        expected = (sizes[quantity.axis],) if quantity.axis in sizes else ()
        if quantity.name in _COMMANDS and arrangement.has_actuators:
            expected = (0,)
        if quantity.name in _OF_ELEMENTS:
            expected = (len(arrangement.devices) + n_elements,)
        if quantity.name == "peak_stroke" and not arrangement.devices and len(found) == 1:
            # Of the added storeys, if there are any.
            continue
        if found != expected:
            raise ValueError(f"{quantity.name} has the shape {found} where {expected} was expected")
    if result.least_stroke.shape not in ((0,), (len(arrangement.devices),)):
        raise ValueError(f"least_stroke has the shape {result.least_stroke.shape}")
    return result


def own_columns(responses: Responses, quantity: Quantity, arrangement: Arrangement) -> Floats:
    """A quantity of all runs, for the floors and storeys of the bare building and all that is built into it."""
    values: Floats = getattr(responses, quantity.name)[(slice(None), *_bare_columns(quantity, arrangement))]
    if quantity.name == "peak_stroke" and not arrangement.devices:
        # Added storeys without devices, such as isolators, have a stroke, too.
        others = [number for number in arrangement.strokes if number < responses.peak_drift.shape[1]]
        values = responses.peak_drift[:, others]
    of_elements = _OF_ELEMENTS.get(quantity.name)
    return (
        values if of_elements is None else np.concatenate([values, getattr(responses, of_elements)], axis=1)
    )


def _bare_columns(quantity: Quantity, arrangement: Arrangement) -> tuple[list[int] | slice, ...]:
    """Index of the columns of the bare building and of the devices of the arrangement."""
    match quantity.axis:
        case "floor":
            return (list(arrangement.floors),)
        case "storey":
            return (list(arrangement.storeys),)
        case "device":
            return (slice(len(arrangement.devices)),)
        case _:
            return ()


def history_of(history: History, arrangement: Arrangement) -> RunHistory:
    """The history of a run, for the floors and storeys of the bare building."""
    energies = (
        history.input_energy,
        history.kinetic_energy(arrangement.building),
        history.strain_energy(arrangement.building),
        history.damping_energy,
        history.device_energy[:, : len(arrangement.devices)].sum(axis=1) + history.element_energy.sum(axis=1),
    )
    kept = {
        signal.name: getattr(history, signal.name)[(slice(None), *_bare_columns(signal, arrangement))]
        for signal in history_signals()
        if signal.name in _HISTORY
    }
    return RunHistory(time=history.time, energy=np.stack(energies, axis=1), **kept)


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceDemand:
    """Demand of a run on one damper of a device, and what of it lies outside its tested ranges."""

    device: str
    demand: OperatingRange
    outside: Outside


def demands_of(run: RunResult, devices: Sequence[Device], seconds: float) -> tuple[DeviceDemand, ...]:
    """The demand of a run that lasts `seconds` [s] on each device; none without dampers, or with actuators instead."""
    # Actuators have forces but no currents; a run that did not finish has no peaks.
    if not run.finished or len(run.peak_current) != len(devices):
        return ()
    found = []
    for number, device in enumerate(devices):
        demand = device.demand(
            stroke=float(run.peak_stroke[number]),
            velocity=float(run.peak_rate[number]),
            force=float(run.peak_force[number]),
            energy=float(run.device_energy[number]),
            seconds=seconds,
            peak_command=float(run.peak_current[number]),
            mean_command=float(run.mean_current[number]),
            least_stroke=float(run.least_stroke[number]) if run.least_stroke.size else None,
        )
        found.append(DeviceDemand(device=device.name, demand=demand, outside=device.outside(demand)))
    return tuple(found)


def names_outside(demands: Sequence[DeviceDemand]) -> tuple[str, ...] | None:
    """Names of the quantities outside the tested ranges of any device; `None` if no device has tested ranges."""
    if demands and not any(each.outside.known for each in demands):
        return None
    return tuple(dict.fromkeys(name for each in demands for name in each.outside.names))


def worst_by_quantity(demands: Sequence[DeviceDemand]) -> tuple[Exceedance, ...]:
    """The worst exceedance of each quantity over the devices."""
    every = [(each.device, found) for each in demands for found in each.outside.exceedances]
    return tuple(worst for worst, _, _ in worst_of(every))


def largest_demand(demands: Sequence[DeviceDemand]) -> OperatingRange | None:
    """The ranges that cover the demand on all devices; `None` without any."""
    return covering([each.demand for each in demands]) if demands else None


def damper_warnings(demands: Mapping[tuple[str, str], Sequence[DeviceDemand]]) -> tuple[str, ...]:
    """A sentence for each quantity outside the tested ranges, its worst run, and for each law out of its range.

    `demands` are those of each run by the labels of its row and its motion.
    """
    every, laws = [], []
    for (row, motion), devices in demands.items():
        for quantity in worst_by_quantity(devices):
            names = [each.device for each in devices if quantity in each.outside.exceedances]
            every.append((f"{names[0]} under {motion} with {row}", quantity))
        laws += [limit for each in devices for limit in each.outside.laws]
    n_runs = sum(1 for devices in demands.values() if devices)
    return (
        *(
            f"{worst.in_words}: {label}; outside the tested range in {count} of {n_runs} runs with dampers."
            for worst, label, count in worst_of(every)
        ),
        *(f"{each.in_words}." for each in worst_laws(laws)),
    )
