"""The loop around the law, from its table."""

from __future__ import annotations

from dataclasses import fields

from mrwork.closed_loop.hardware import Fault, Hardware
from mrwork.response.declared import Place
from mrwork.response.motions import said_at
from mrwork.response.schema import HardwareTable


def hardware_of(table: HardwareTable, place: Place, seed: int) -> Hardware:
    """The hardware of a table; `seed` is that of its noise.

    Raises
    ------
    SettingError
        Where its numbers are at odds with each other; the message has the line.
    """
    steps = table.sample_time / table.step
    if abs(steps - round(steps)) > 1e-9 * steps or round(steps) < 1:
        place.within("step").refuse(
            f"step is {table.step:g} s and sample_time {table.sample_time:g} s; give a step that divides it"
        )
    plain = {entry.name: getattr(table, entry.name) for entry in fields(table) if entry.name != "fault"}
    faults = []
    for fault in table.fault:
        if fault.end <= fault.start:
            fault.place.refuse(
                f"the fault lasts from {fault.start:g} to {fault.end:g} s; give an end after its start"
            )
        faults.append(
            Fault(
                signal=fault.signal,
                number=fault.number - 1,
                start=fault.start,
                end=fault.end,
                value=fault.value,
            )
        )
    with said_at(place):
        return Hardware(**plain, seed=seed, faults=tuple(faults))
