"""The devices of the thesis' second chapter in place of the pair: viscous damper, tuned mass, isolation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mrwork.buildings import (
    TUNINGS,
    Building,
    with_base_isolation_of_period,
    with_optimal_tuned_mass,
    with_viscous_damper,
)
from studies.former.frame import FRAME, Bench, Figures, figures, idle


@dataclass(frozen=True, slots=True, kw_only=True)
class Baseline:
    """Figures of a device at each level; `says` describes the choice made there."""

    label: str
    says: tuple[str, ...]
    figures: tuple[Figures, ...]


def without_pair(over: Bench, frame: Building) -> Figures:
    """The frame, or one to which something was added, without the pair."""
    return figures(over, idle(frame), frame=frame)


def baselines(over: Bench) -> Iterator[Baseline]:
    """Uncontrolled frame, viscous damper, tuned masses and isolation, each the best of a few at each level."""
    yield _best(over, "no device", {"": FRAME})
    yield _best(
        over,
        "viscous damper",
        {
            f"{damping / 1e3:.3g} kN s/m": with_viscous_damper(FRAME, storey=1, damping=damping)
            for damping in np.geomspace(5e3, 3e5, 13)
        },
    )
    for share in (0.02, 0.05):
        yield _best(
            over,
            f"tuned mass, {share:.0%} on the roof",
            {
                tuning: with_optimal_tuned_mass(FRAME, floor=5, mass_ratio=share, tuning=tuning)
                for tuning in TUNINGS
            },
        )
    yield _best(
        over,
        "base isolation",
        {"2 s, 10 %": with_base_isolation_of_period(FRAME, mass=330.0, period=2.0, ratio=0.1)},
    )


def _best(over: Bench, label: str, frames: dict[str, Building]) -> Baseline:
    found = [without_pair(over, frame) for frame in frames.values()]
    best = np.array([each.score[0] for each in found]).argmin(axis=0)
    return Baseline(
        label=label,
        says=tuple(list(frames)[int(place)] for place in best),
        figures=tuple(found[int(place)] for place in best),
    )
