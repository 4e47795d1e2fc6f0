"""What a study compares: the building without dampers, i = 0, baselines, control laws."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from mrwork.buildings import Building
from mrwork.buildings.devices import Device
from mrwork.buildings.from_file import building_from_table
from mrwork.control.designs.problem import DesignProblem
from mrwork.study.control_laws import PASSIVE_OFF, chosen_law, constant_command
from mrwork.study.declared import said_at
from mrwork.study.results import Row
from mrwork.study.schema import BaselineTable, DamperTable, StudyTable
from mrwork.study.study import Arrangement, arranged


def arrangements(
    table: StudyTable,
    bare: Building,
    building: Building,
    devices: tuple[Device, ...],
    folder: Path,
    sample_time: float,
) -> tuple[Arrangement, ...]:
    """The building without dampers, with them at i = 0, the baselines, and every control law.

    Raises
    ------
    SettingError
        If a law or a baseline is wrong, or a law has no dampers.
    """
    none = Row(label="uncontrolled", kind="uncontrolled", says="the building without dampers")
    found = [arranged(bare, none, bare, (), constant_command((), 0.0))]
    if devices:
        off = Row(label="i = 0", kind="passive_off", says="the dampers without a command")
        found.append(arranged(bare, off, building, devices, constant_command(devices, 0.0)))
    found += [_baseline(baseline, table, bare, folder) for baseline in table.baseline]
    first = table.damper[0] if devices else None
    subject = DesignProblem(
        building=building,
        devices=devices,
        sample_time=sample_time,
        amplitude=None if first is None else _range(first, "amplitude", first.amplitude),
        velocity=None if first is None else _range(first, "velocity", first.velocity),
    )
    for controller in table.controller:
        if not devices:
            controller.place.refuse("a control law wants dampers, and the study has none; give a [[damper]]")
        title, law = chosen_law(controller, subject)
        if controller.law == PASSIVE_OFF:
            # It is there already; only its label may be another.
            found[1] = replace(
                found[1], row=replace(found[1].row, label=controller.label or found[1].row.label)
            )
            continue
        row = Row(label=controller.label or title, kind="controller", says=controller.law)
        found.append(arranged(bare, row, building, devices, law))
    return tuple(found)


def _range(table: DamperTable, name: str, given: tuple[float, ...] | None) -> tuple[float, float] | None:
    if given is None:
        return None
    if len(given) != 2 or given[0] > given[1]:
        table.place.within(name).refuse(f"{name} wants the least and the largest, as [0.001, 0.01]")
    return given[0], given[1]


def _baseline(baseline: BaselineTable, table: StudyTable, bare: Building, folder: Path) -> Arrangement:
    where = baseline.place.within("building")
    with said_at(where):
        changed = building_from_table({**table.building, **baseline.building}, where, folder=folder)
    lost = [
        name
        for name in (*bare.floor_names, *bare.storey_names)
        if name not in (*changed.floor_names, *changed.storey_names)
    ]
    if lost:
        where.refuse(
            f"{lost[0]} of the building is gone; a baseline adds to it, and keeps its floors and storeys"
        )
    row = Row(label=baseline.label, kind="baseline", says=changed.name)
    return arranged(bare, row, changed, (), constant_command((), 0.0))
