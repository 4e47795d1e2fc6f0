"""Kinds of the rows of a study: what tables, references, fragilities, advice and counts of dampers ask of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Kind = Literal[
    "uncontrolled", "passive_off", "passive", "best_passive", "best_passive_by_group", "baseline", "controller",
    "actuator",
]  # fmt: skip
"""What a row is: the building without dampers, i = 0, a constant command, the best of those, the best of one for each
group of dampers, other devices, a control law of the dampers, or one of ideal actuators."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rank:
    """Rows that are compared with each other: their name in files, and a heading of tables."""

    name: str
    title: str


LAWS = Rank(name="law", title="Control laws")
_PASSIVE = Rank(name="passive", title="Passive dampers")
_ACTUATORS = Rank(name="actuator", title="Ideal actuators")
_DEVICES = Rank(name="other_device", title="Other devices")
_BARE = Rank(name="uncontrolled", title="No dampers")
RANKS = (LAWS, _PASSIVE, _ACTUATORS, _DEVICES, _BARE)
"""Ranks in the order of tables."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RowKind:
    """What rows of a kind are.

    `is_reference`: laws are compared with it; commands by group are none, as laws have one share of all largest
    commands. `is_designed` for the motions, or chosen on them. `has_commands` says that its dampers follow a command,
    `is_alternative` that it is none of the states that others are to improve, `is_counted` that `size` tries it under
    other numbers of dampers.
    """

    rank: Rank
    is_reference: bool = False
    is_designed: bool = False
    has_commands: bool = True
    is_alternative: bool = True
    is_counted: bool = True


ROW_KINDS: Mapping[Kind, RowKind] = {
    "uncontrolled": RowKind(rank=_BARE, has_commands=False, is_alternative=False),
    "passive_off": RowKind(rank=_PASSIVE, is_reference=True, is_alternative=False),
    "passive": RowKind(rank=_PASSIVE, is_reference=True),
    "best_passive": RowKind(rank=_PASSIVE, is_reference=True, is_designed=True),
    "best_passive_by_group": RowKind(rank=_PASSIVE, is_designed=True, is_counted=False),
    "baseline": RowKind(rank=_DEVICES, has_commands=False, is_counted=False),
    "controller": RowKind(rank=LAWS, is_designed=True),
    "actuator": RowKind(rank=_ACTUATORS, is_designed=True, has_commands=False, is_counted=False),
}
