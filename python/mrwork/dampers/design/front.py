"""Pareto front of dampers that meet the same wishes: size against dynamic range against power."""

from __future__ import annotations

from collections.abc import Sequence
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
    OnSizing,
    SizingReporter,
    candidate,
    harder_wishes,
    missed_with,
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
    on_progress: OnSizing | None = None,
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
    on_progress
        Called after every generation of either search; where it returns true the search ends with the front so far.

    Raises
    ------
    Interrupted
        On Ctrl-C, carrying the `SizeFront` of the smallest damper alone, `None` while no candidate meets the wishes;
        a front, whose dampers all take an exact solution of their flow, takes seconds, see `on_progress`.
    SettingError
        If no candidate meets the wishes, or pymoo is not installed.
    """
    harder = harder_wishes(wishes)
    reporter = SizingReporter(on_progress=on_progress, budget=budget, envelope=wishes.volume)
    # Points of which no other one was better in everything, with their objectives, and candidates so far.
    units, values, tried = np.empty((0, N_FREE)), np.empty((0, 3)), 0

    def keep(points: Floats) -> Floats:
        nonlocal units, values
        found = np.array([_objectives(candidate(unit, wishes, fluid, steel), harder) for unit in points])
        units, values = np.vstack([units, points]), np.vstack([values, found])
        kept = nondominated(values)
        units, values = units[kept], values[kept]
        return found

    def built(points: Floats) -> SizeFront | None:
        return _front([candidate(unit, wishes, fluid, steel) for unit in points], wishes, tried)

    try:
        try:
            first = smallest(
                wishes,
                fluid,
                steel,
                search="differential_evolution",
                budget=budget // 3,
                rng=rng,
                reporter=reporter,
            )
        except Interrupted as interrupt:
            tried = interrupt.result.evaluations
            keep(interrupt.result.best_unit[None])
            raise
        before = tried = first.evaluations
        keep(first.best_unit[None])

        def on_generation(evaluations: int) -> bool:
            nonlocal tried
            tried = before + evaluations
            return reporter.report("front", tried, float(values[:, 0].min()))

        if first.stop_reason != "callback":
            run_front(
                keep,
                n_params=N_FREE,
                n_objectives=3,
                population=population,
                budget=budget - tried,
                rng=rng,
                starts=first.best_unit[None],
                on_generation=on_generation,
            )
        found = built(units)
    except KeyboardInterrupt as interrupt:
        least = units[values[:, 0].argmin()][None] if len(units) else units
        raise Interrupted(built(least), "front") from interrupt
    if found is None:
        raise SettingError(
            f"no damper with {fluid.name} meets the wishes after {tried} candidates; size_damper says what is missed"
        )
    return found


def _front(
    designs: Sequence[DamperDesign | None], wishes: DamperWishes, evaluations: int
) -> SizeFront | None:
    """The front with the exact flow, in place of that of the search; `None` where no design meets the wishes."""
    met, values = [], []
    for design in designs:
        if design is None:
            continue
        on, off = forces = rated_forces(design)
        if not missed_with(wishes, design, forces):
            met.append(design)
            values.append((design.envelope_volume, -on / off, design.power))
    if not met:
        return None
    kept = nondominated(np.array(values))
    order = kept[np.argsort(np.array(values)[kept, 0], kind="stable")]
    return SizeFront(designs=tuple(met[index] for index in order), evaluations=evaluations)


def _objectives(design: DamperDesign | None, harder: DamperWishes) -> tuple[float, float, float]:
    """Volume over that of the envelope, 1 over dynamic range, power [W]; all worse by what the design misses."""
    if design is None:
        return (_PENALTY**2,) * 3
    on, off = forces = rated_forces(design, "plates")
    worse = _PENALTY * shortfall(harder, design, forces)
    return design.envelope_volume / harder.volume + worse, off / on + worse, design.power + worse
