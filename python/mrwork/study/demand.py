"""Demand of the runs of a study on its dampers, and what of it lies outside their tested ranges."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mrwork.buildings.matrices import Device
from mrwork.closed_loop.responses import demand_of
from mrwork.dampers.spec import worst_laws
from mrwork.dampers.tested_range import Exceedance, OperatingRange, Outside, worst_of
from mrwork.study.runs import Runs


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceDemand:
    """Demand of a run on one damper of a device, and what of it lies outside its tested ranges."""

    device: str
    demand: OperatingRange
    outside: Outside


def demands_of(
    runs: Runs, row: int, motion: int, devices: Sequence[Device], seconds: float
) -> tuple[DeviceDemand, ...]:
    """The demand of a run that lasts `seconds` [s] on each device; none without dampers, or with actuators instead."""
    run = runs.at(row, motion)
    # Actuators have forces but no currents; a run that did not finish has no peaks.
    if not devices or not runs.finished[row, motion, 0] or math.isnan(run["peak_current"][0]):
        return ()
    demands = []
    for number, device in enumerate(devices):
        least = float(run["least_stroke"][number])
        demand = demand_of(
            device, run, number, seconds=seconds, least_stroke=None if math.isnan(least) else least
        )
        demands.append(DeviceDemand(device=device.name, demand=demand, outside=device.outside(demand)))
    return tuple(demands)


def worst_by_quantity(demands: Sequence[DeviceDemand]) -> tuple[Exceedance, ...]:
    """The worst exceedance of each quantity over the devices."""
    every = [(each.device, exceedance) for each in demands for exceedance in each.outside.exceedances]
    return tuple(worst for worst, _, _ in worst_of(every))


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
            f"{worst.in_words}: {label}; {'beyond the rating' if worst.rated else 'outside the tested range'} in "
            f"{count} of {n_runs} runs with dampers."
            for worst, label, count in worst_of(every)
        ),
        *(f"{each.in_words}." for each in worst_laws(laws)),
    )
