"""A study, ready to be run: buildings with their devices and laws, motions, hardware."""

from __future__ import annotations

from dataclasses import dataclass

from mrwork.buildings import Building
from mrwork.buildings.devices import Device
from mrwork.closed_loop.hardware import Hardware
from mrwork.control.laws import ControlLaw
from mrwork.motions import GroundMotion
from mrwork.study.results import Row
from mrwork.summary import Summarised, Summary, listed


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrangement:
    """A building with devices under one law; one without a law is given the best constant command.

    `floors` and `storeys` are those of its floors and storeys that are the bare building's, in its order: what is put
    in may add a base slab, or a storey of isolators. `strokes` are the rows of storeys that it adds.
    """

    row: Row
    building: Building
    devices: tuple[Device, ...]
    law: ControlLaw | None
    floors: tuple[int, ...]
    storeys: tuple[int, ...]
    strokes: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Study(Summarised):
    """What a study file says; the first arrangements are the building without dampers and, with them, i = 0.

    `synthetic` are the motions that were made, `detailed` is the one that is drawn in time, `drawn` the arrangements
    that are; the histories of the motions `histories` are kept.
    """

    title: str
    building: Building
    arrangements: tuple[Arrangement, ...]
    motions: tuple[GroundMotion, ...]
    synthetic: tuple[int, ...]
    hardware: Hardware
    device_names: tuple[str, ...]
    command_unit: str
    facts: tuple[tuple[str, str], ...]
    detailed: int
    drawn: tuple[int, ...]
    histories: tuple[int, ...]

    def _summary(self) -> Summary:
        return Summary(
            title=f"Study: {self.title}",
            facts=(
                ("building", f"{self.building.name}, {len(self.building.floors)} floors"),
                ("dampers", listed(self.device_names)),
                ("sample time", f"{self.hardware.sample_time:g} s"),
                ("motions", listed([motion.name for motion in self.motions])),
            ),
            columns=("arrangement", "what it is"),
            rows=[(each.row.label, each.row.says) for each in self.arrangements],
        )


def arranged(
    bare: Building, row: Row, building: Building, devices: tuple[Device, ...], law: ControlLaw | None
) -> Arrangement:
    """An arrangement, with its floors and storeys told apart from those of the bare building."""
    floors = tuple(building.floor_names.index(name) for name in bare.floor_names)
    own = bare.storey_names[: len(bare.drifts)]
    storeys = tuple(building.storey_names.index(name) for name in own)
    strokes = tuple(number for number in range(len(building.storey_names)) if number not in storeys)
    return Arrangement(
        row=row, building=building, devices=devices, law=law, floors=floors, storeys=storeys, strokes=strokes
    )
