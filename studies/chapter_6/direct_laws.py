"""The direct-current laws of the thesis as they were tuned, beside i = 0 and the best constant current."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mrwork.closed_loop import Device
from mrwork.control import ControlLaw
from mrwork.motions import GroundMotion
from studies.chapter_6.kept_settings import kept
from studies.chapter_6.tuning import control_law_of
from studies.common.frame import LEVELS, Bench, pair

OFF, CONSTANT = "i = 0", "best constant"
LYAPUNOV, PROPORTIONAL, INVERSE = "lyapunov_direct", "proportional_direct", "inverse_direct"
DIRECT = (LYAPUNOV, PROPORTIONAL, INVERSE)
"""That of figures 6.3 to 6.6 and table 6.1, then two forms of that of figures 6.7 to 6.10 and table 6.2."""
SHOWN = (LYAPUNOV, PROPORTIONAL)
"""One of each: those of the sheets."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Controlled:
    """A law with its numbers, and the device that it drives."""

    label: str
    law: ControlLaw
    device: Device


def controlled_at(level: int, constant: float, laws: Sequence[str] = DIRECT) -> tuple[Controlled, ...]:
    """i = 0, the constant current [A], and laws with their settings of a level, by its place in `LEVELS`."""
    settings = kept()
    return (
        *(
            Controlled(label=label, law=constant_current(current), device=pair())
            for label, current in ((OFF, 0.0), (CONSTANT, constant))
        ),
        *(
            Controlled(label=law, law=control_law_of(tuned), device=tuned.device)
            for law in laws
            for tuned in [settings[law][level]]
        ),
    )


def constant_current(*currents: float) -> ControlLaw:
    """A candidate for each current [A]."""
    return ControlLaw(name="passive", gains={"command": [[current] for current in currents]})


def motions_at(over: Bench, level: int) -> tuple[GroundMotion, ...]:
    """The motions of a level, by its place in `LEVELS`."""
    count = len(over.motions) // len(LEVELS)
    return over.motions[level * count : (level + 1) * count]
