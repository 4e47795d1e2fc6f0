"""The loop around the law, from its table."""

from __future__ import annotations

from dataclasses import fields

from mrwork.closed_loop.hardware import Fault, Hardware
from mrwork.keys import Place
from mrwork.study.declared import said_at
from mrwork.study.schema import HardwareTable


def hardware_of(table: HardwareTable, place: Place, seed: int) -> Hardware:
    """The hardware of a table; `seed` is that of its noise.

    Raises
    ------
    SettingError
        If its numbers are at odds with each other; the message has the line.
    """
    apart = ("fault", "measured_floors")
    plain = {entry.name: getattr(table, entry.name) for entry in fields(table) if entry.name not in apart}
    faults = []
    for fault in table.fault:
        if fault.end <= fault.start:
            fault.place.refuse(
                f"the fault lasts from {fault.start:g} to {fault.end:g} s; give an end after its start"
            )
        faults.append(
            Fault(
                channel=fault.signal,
                index=fault.number - 1,
                start=fault.start,
                end=fault.end,
                value="hold" if fault.value is None else fault.value,
            )
        )
    with said_at(place):
        floors = (
            None if table.measured_floors is None else tuple(floor - 1 for floor in table.measured_floors)
        )
        return Hardware(**plain, measured_floors=floors, seed=seed, faults=tuple(faults))
