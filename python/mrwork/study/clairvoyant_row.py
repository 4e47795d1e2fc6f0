"""The table [clairvoyant] of a study file, and the row that it asks for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mrwork.buildings.devices import Device
from mrwork.closed_loop.clairvoyant_search import ClairvoyantSettings
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.prescribed import samples_of
from mrwork.keys import Place, key
from mrwork.study.declared import located
from mrwork.study.study import ClairvoyantRow, Row

CLAIRVOYANT = "Clairvoyant"
"""Label of the row, unless the study file has another."""

_DEFAULT = ClairvoyantSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class ClairvoyantTable:
    """The non-causal optimum of the command history under each motion, a row of every table; off without this table.

    It shows how much is left for any law: a local optimum, found by gradients from several starts with the motion
    known in advance, and not certified. It takes minutes for each motion.
    """

    label: str = key("label in tables", default=CLAIRVOYANT)
    interval: float = key(
        "interval over which a command is held, a whole number of samples",
        unit="s",
        default=_DEFAULT.interval,
        above=0.0,
    )
    explore: int = key("iterations from every start", default=_DEFAULT.explore, least=1)
    finish: int = key("iterations from the best of them", default=_DEFAULT.finish, least=0)
    random_starts: int = key(
        "random starts, besides constant commands and the best law",
        default=_DEFAULT.random_starts,
        least=0,
    )
    place: Place


def clairvoyant_row(
    table: ClairvoyantTable, devices: Sequence[Device], hardware: Hardware, seed: int
) -> ClairvoyantRow:
    """The row of a table; `seed` is that of the random starts."""
    if not any(device.spec.follows_command for device in devices):
        table.place.refuse(
            "there is no command to be chosen: the study has no damper that follows one; leave this table out, or give "
            "a damper with laws"
        )
    if math.isfinite(hardware.command_rate):
        table.place.refuse(
            "the optimum knows no limit of the rate of the command, and [hardware] has a command_rate; leave one out"
        )
    with located(table.place.within("interval")):
        samples_of(table.interval, hardware.sample_time)
    return ClairvoyantRow(
        row=Row(
            label=table.label,
            kind="clairvoyant",
            description="the best command history found for each motion: non-causal, not certified",
        ),
        settings=ClairvoyantSettings(
            interval=table.interval,
            explore=table.explore,
            finish=table.finish,
            random_starts=table.random_starts,
            seed=seed,
        ),
    )
