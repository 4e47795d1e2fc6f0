"""The dampers of a study in their storeys, with their braces."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mrwork.buildings import Building
from mrwork.buildings.additions import with_brace
from mrwork.buildings.devices import Device
from mrwork.study.dampers import ChosenDamper, Identified, chosen_damper
from mrwork.study.declared import said_at
from mrwork.study.schema import DamperTable

# A joint that weighs this much of a mean floor is light beside the building.
_JOINT_SHARE = 1e-3


def equipped(
    bare: Building, tables: Sequence[DamperTable], folder: Path, identified: Identified
) -> tuple[Building, tuple[Device, ...], list[ChosenDamper]]:
    """The building with its braces, the dampers that stand in it, and which they are.

    Raises
    ------
    SettingError
        If a table is wrong, there is no such storey, or the dampers are of several models.
    """
    chosen = [chosen_damper(table, folder, identified) for table in tables]
    building, rows = bare, []
    for table in tables:
        with said_at(table.place.within("storey")):
            row = bare.storey_row(table.storey)
        if table.brace is not None:
            mass = table.brace.mass or _JOINT_SHARE * bare.total_mass / len(bare.floor_names)
            with said_at(table.place.within("brace")):
                building = with_brace(
                    building,
                    storey=table.storey,
                    stiffness=table.brace.stiffness,
                    damping=table.brace.damping,
                    mass=mass,
                )
            row = building.storeys[-1]
        rows.append(row)
    devices: list[Device] = []
    for table, damper, row in zip(tables, chosen, rows, strict=True):
        if damper.spec != chosen[0].spec:
            table.place.refuse(
                f"this damper is a {damper.spec.name} and the first a {chosen[0].spec.name}, or their current laws "
                "differ; all dampers of a building are of one model"
            )
        # A brace put in later has added coordinates, which do not move this damper.
        whole = np.append(row, np.zeros(building.n_coordinates - len(row)))
        where = bare.storey_name(table.storey)
        devices.append(
            Device(
                name=f"damper in {where}",
                spec=damper.spec,
                theta=damper.theta,
                row=whole,
                count=table.count,
                differential=table.differential,
                largest_command=damper.largest_command,
            )
        )
    return building, tuple(devices), chosen
