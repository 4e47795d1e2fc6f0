"""Demand of the runs of a study on its dampers, compared with the ranges in which the dampers were tested."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mrwork.buildings.devices import Device
from mrwork.dampers.spec import worst_laws
from mrwork.records.operating_range import Exceedance, OperatingRange, Outside, covering, worst_of
from mrwork.study.run_result import RunResult


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

    Parameters
    ----------
    demands
        Demands of each run by the labels of its row and its motion.
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
