"""Pareto front of dampers that meet the same wishes: size against dynamic range against power."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import Count, Seed, Within, checked
from mrwork.dampers.design.damper_design import DamperDesign
from mrwork.dampers.design.fluids import MRFluid
from mrwork.dampers.design.sizing import (
    N_FREE,
    DamperWishes,
    candidate,
    harder_wishes,
    rated_forces,
    shortfall,
    smallest,
)
from mrwork.dampers.design.steels import Steel
from mrwork.errors import Interrupted, SettingError
from mrwork.search.nondominated import nondominated, run_front
from mrwork.summary import Summarised, Summary

Floats = NDArray[np.float64]

_PENALTY = 1e3


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class SizeFront(Summarised):
    """Designs of which no other one is smaller, has a larger dynamic range and needs less power; the smallest first."""

    _made_by: ClassVar[str] = "mr.dampers.design.size_front(wishes, fluid=..., steel=...)"

    designs: tuple[DamperDesign, ...]
    evaluations: int

    def _summary(self) -> Summary:
        return Summary(
            title=f"Front of {len(self.designs)} dampers after {self.evaluations} candidates",
            columns=("volume [l]", "dynamic range", "power [W]", "bore [mm]", "length [mm]", "coils"),
            rows=[
                (
                    f"{1e3 * each.envelope_volume:.3g}",
                    f"{each.dynamic_range:.3g}",
                    f"{each.power:.3g}",
                    f"{1e3 * each.bore:.3g}",
                    f"{1e3 * each.chamber_length:.3g}",
                    str(each.stages),
                )
                for each in self.designs
            ],
        )


@checked
def size_front(
    wishes: DamperWishes,
    *,
    fluid: MRFluid,
    steel: Steel,
    population: Annotated[int, Within(least=8, most=10_000)] = 60,
    budget: Count = 6000,
    rng: Seed = 0,
) -> SizeFront:
    """The front of volume, dynamic range and power among dampers that meet the wishes, by NSGA-II.

    The dynamic range of the wishes is the least on the front. The smallest damper, found by a third of the budget, is
    among the first generation. The search is that of the library pymoo, of the extra `peers`.

    Parameters
    ----------
    wishes, fluid, steel, rng
        As in `size_damper`.
    population, budget
        Candidates of a generation, and most of all; a generation of either search at least.

    Raises
    ------
    Interrupted
        On Ctrl-C in the search of the smallest damper, carrying nothing.
    SettingError
        If no candidate meets the wishes, or pymoo is not installed.
    """
    try:
        first = smallest(wishes, fluid, steel, search="differential_evolution", budget=budget // 3, rng=rng)
    except Interrupted as interrupt:
        raise Interrupted(None, "front") from interrupt
    tried = first.evaluations
    harder = harder_wishes(wishes)

    def objectives(units: Floats) -> Floats:
        return np.array([_objectives(candidate(unit, wishes, fluid, steel), harder) for unit in units])

    found = run_front(
        objectives,
        n_params=N_FREE,
        n_objectives=3,
        population=population,
        budget=budget - tried,
        rng=rng,
        starts=first.best_unit[None],
    )
    designs = [
        design
        for unit in found.units
        if (design := candidate(unit, wishes, fluid, steel)) is not None and not wishes.missed(design)
    ]
    if not designs:
        raise SettingError(
            f"no damper with {fluid.name} meets the wishes after {tried + found.evaluations} candidates; size_damper "
            "says what is missed"
        )
    # With the exact flow, in place of that of the search.
    values = np.array([(each.envelope_volume, -each.dynamic_range, each.power) for each in designs])
    kept = nondominated(values)
    order = kept[np.argsort(values[kept, 0])]
    return SizeFront(designs=tuple(designs[index] for index in order), evaluations=tried + found.evaluations)


def _objectives(design: DamperDesign | None, harder: DamperWishes) -> tuple[float, float, float]:
    """Volume over that of the envelope, 1 over dynamic range, power [W]; all worse by what the design misses."""
    if design is None:
        return (_PENALTY**2,) * 3
    on, off = forces = rated_forces(design, "plates")
    worse = _PENALTY * shortfall(harder, design, forces)
    return design.envelope_volume / harder.volume + worse, off / on + worse, design.power + worse
