"""Sizing: the smallest damper with a desired force and dynamic range in an envelope, by a search of the registry."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from mrwork.base.arguments import Count, NotNegative, Positive, Seed, checked
from mrwork.base.hints import Within
from mrwork.base.keys import look_up
from mrwork.base.progress import OnProgress, Progress
from mrwork.base.summary import Summarised, Summary
from mrwork.base.values import Floats
from mrwork.dampers.design.damper_design import Current, DamperDesign, Speed, Voltage, wire_diameter
from mrwork.dampers.design.flow import FlowModel, Length
from mrwork.dampers.design.materials import MRFluid, Steel
from mrwork.errors import SettingError
from mrwork.search import SearchResult, StopRules, run_search
from mrwork.search.registry import ALL_OPTIMISERS
from mrwork.store.long_call import LongCall

# Free dimensions with their ranges, in log scale: shares of the largest outer diameter, the gap over the least one,
# and the depth of a groove as a share of what the rod leaves.
_RANGES = {
    "bore": (0.2, 1.0), "wall": (0.01, 0.3), "gap": (1.0, 10.0), "pole_length": (0.01, 0.5),
    "coil_length": (0.02, 1.0), "coil_depth": (0.05, 0.9),
}  # fmt: skip
# Numbers of coils and gauges of their wire, also in log scale: whole numbers below the end.
_STAGES, _GAUGES = (1, 5), (8, 33)
_ENDS = np.array([*_RANGES.values(), _STAGES, _GAUGES], dtype=np.float64)
N_FREE = len(_ENDS)
# Share of copper in a winding, and depth of the winding below the poles in gaps: the slot is three times as wide there,
# so that a coil takes 1/27 of the viscous pressure of a pole of its length.
_FILL, _CLEARANCE = 0.6, 2.0
# The search takes parallel plates for the annulus; this factor of force, range and stress covers the difference.
_MARGIN = 1.003
# Shortfall of what cannot be built.
_IMPOSSIBLE = 1e3


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DamperWishes(Summarised):
    """Requirements on a damper and limits on its size and power.

    Parameters
    ----------
    force, dynamic_range, velocity
        Least force at the largest current [N], and least ratio to the force at zero current, at this velocity [m/s].
    stroke
        To either side [m].
    outer_diameter, length
        Largest diameter of the cylinder and length between its covers [m].
    voltage, current
        Largest of the supply [V] and [A]; all coils are in series.
    response_time
        Longest time in which 63 % of the current flows with this supply [s]; `None` for any.
    current_density
        Largest of the copper [A/m^2]; 4 A/mm^2 is usual for coils without cooling.
    stress
        Largest stress of the steel [Pa]: of the rod under the force, which sets its diameter, and of the cylinder, as a
        thin ring under the pressure of the force.
    least_gap
        Smallest radial gap that can be made [m].
    friction
        Friction of the seals [N].
    """

    _units: ClassVar[Mapping[str, str]] = {"force": "N", "velocity": "m/s", "stroke": "m", "outer_diameter": "m"} | {
        "length": "m", "voltage": "V", "current": "A", "response_time": "s", "current_density": "A/m^2",
        "stress": "Pa", "least_gap": "m", "friction": "N",
    }  # fmt: skip

    force: Annotated[float, Within(least=1e-3, most=1e9)]
    dynamic_range: Annotated[float, Within(above=1.0, most=1e3)]
    stroke: Length
    velocity: Speed
    outer_diameter: Length
    length: Length
    voltage: Voltage
    current: Current
    response_time: Positive | None = None
    current_density: Annotated[float, Within(least=1.0, most=1e9)] = 4e6
    stress: Annotated[float, Within(least=1e3, most=1e10)] = 1e8
    least_gap: Length = 5e-4
    friction: NotNegative = 0.0

    @property
    def volume(self) -> float:
        """Volume of the largest cylinder that the wishes allow [m^3]."""
        return float(np.pi / 4.0 * self.outer_diameter**2 * self.length)

    @checked
    def missed(self, design: DamperDesign, *, flow_model: FlowModel = "annulus") -> dict[str, float]:
        """Relative shortfall of a design for each wish that it does not meet; its forces are by the `flow_model`."""
        currents = np.array([design.largest_current, 0.0])
        on, off = design.force(design.velocity, currents, flow_model=flow_model).tolist()
        shortfalls = {
            "force": 1.0 - on / self.force,
            "dynamic_range": 1.0 - on / off / self.dynamic_range,
            "velocity": 1.0 - design.velocity / self.velocity,
            "stroke": 1.0 - design.stroke / self.stroke,
            "outer_diameter": design.outer_diameter / self.outer_diameter - 1.0,
            "length": design.chamber_length / self.length - 1.0,
            "voltage": design.resistance * design.largest_current / self.voltage - 1.0,
            "current": design.largest_current / self.current - 1.0,
            "least_gap": 1.0 - design.gap / self.least_gap,
            "stress": on / design.piston_area * design.bore / (2.0 * design.wall) / self.stress - 1.0,
            "current_density": design.current_density / self.current_density - 1.0,
        }
        if self.response_time is not None:
            try:
                shortfalls["response_time"] = design.response_time(self.voltage) / self.response_time - 1.0
            except SettingError:
                # The supply cannot drive the current, which misses the voltage, too.
                shortfalls["response_time"] = 1.0
        return {name: value for name, value in shortfalls.items() if value > 1e-9}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class SizedDamper(Summarised):
    """A design that meets the wishes, and how many candidates were tried for it."""

    design: DamperDesign
    wishes: DamperWishes
    evaluations: int

    def _summary(self) -> Summary:
        summary = self.design._summary()
        share = self.design.envelope_volume / self.wishes.volume
        facts = (
            ("volume", f"{share:.3g} of the envelope, after {self.evaluations} candidates"),
            *summary.facts,
        )
        return replace(summary, facts=facts)


@checked
def size_damper(
    wishes: DamperWishes,
    *,
    fluid: MRFluid,
    steel: Steel,
    search: str = "differential_evolution",
    budget: Count = 4000,
    rng: Seed = 0,
    on_progress: OnProgress | None = None,
) -> SizedDamper:
    """The damper of the least volume that meets the wishes.

    Free are the bore, the thickness of the cylinder, the gap, the poles, the grooves, the number of coils and the gauge
    of the wire. The current is the largest that supply and wire allow, 0.6 of a winding is copper, and it lies two gaps
    below the poles (our rules). Whatever misses a wish loses against whatever misses less, and against all that meet
    all.

    Parameters
    ----------
    wishes
        What the damper has to do within its envelope.
    fluid, steel
        Its materials.
    search
        Name of an optimiser, in `mr.search.OPTIMISERS` or `mr.search.PEERS`.
    budget
        Most candidates, a generation at least.
    rng
        Seed of the search.
    on_progress
        Called after every generation with the `evaluations`, and the `volume` [m^3] of the smallest damper that meets
        the wishes or NaN; where it returns true the search ends with the best so far.

    Raises
    ------
    Interrupted
        On Ctrl-C, carrying the `SizedDamper` so far, `None` where no candidate meets the wishes.
    SettingError
        If no candidate meets the wishes; the message says what the best one misses.

    Examples
    --------
    >>> import mrwork as mr
    >>> from mrwork.dampers.design import DamperWishes, fluid, size_damper, steel
    >>> wishes = DamperWishes(
    ...     force=2e3, dynamic_range=5.0, stroke=0.025, velocity=0.05, outer_diameter=0.08, length=0.2, voltage=12.0,
    ...     current=2.0,
    ... )
    >>> sized = size_damper(wishes, fluid=fluid("MRF-132DG"), steel=steel("AISI 1010"), budget=600)
    >>> sized.design.largest_force >= 2e3
    True
    """
    optimiser = look_up(search, ALL_OPTIMISERS, f"no search is called {search!r}")
    # Wishes that a design has to meet between parallel plates so that it meets the true ones in the annulus.
    harder = replace(
        wishes,
        force=_MARGIN * wishes.force,
        dynamic_range=min(_MARGIN * wishes.dynamic_range, 1e3),
        stress=wishes.stress / _MARGIN,
    )
    best, evaluations = None, 0

    def misfit(unit: Floats) -> float:
        """Share of the envelope, or above 1 by what the design misses."""
        design = candidate(unit, wishes, fluid, steel)
        if design is None:
            return _IMPOSSIBLE
        missed = sum(harder.missed(design, flow_model="plates").values())
        return 1.0 + missed if missed > 0.0 else design.envelope_volume / harder.volume

    def sized() -> SizedDamper | None:
        if best is None or wishes.missed(best):
            return None
        return SizedDamper(design=best, wishes=wishes, evaluations=evaluations)

    call = LongCall(on_progress=on_progress, so_far=sized)

    def on_generation(result: SearchResult) -> bool:
        nonlocal best, evaluations
        best, evaluations = candidate(result.best_unit, wishes, fluid, steel), result.evaluations
        volume = result.best_misfit * wishes.volume if result.best_misfit <= 1.0 else math.nan
        smallest = "none meets the wishes yet" if math.isnan(volume) else f"smallest {1e3 * volume:.3g} l"
        return call.ends(
            Progress(
                stage="smallest",
                said=("smallest", f"{evaluations} candidates", smallest),
                share=min(evaluations / budget, 1.0),
                numbers={"evaluations": evaluations, "volume": volume},
            )
        )

    with call.keeping("sizing"):
        run_search(
            replace(
                optimiser, stop=StopRules(max_evaluations=max(budget, optimiser.population), confidence=None)
            ),
            lambda units: np.array([misfit(unit) for unit in units]),
            rng=rng,
            n_params=N_FREE,
            on_generation=on_generation,
        )
    if (result := sized()) is not None:
        return result
    missed = {"all": 1.0} if best is None else wishes.missed(best)
    worst = ", ".join(f"{name} by {100.0 * share:.3g} %" for name, share in missed.items())
    raise SettingError(
        f"no damper with {fluid.name} meets the wishes after {evaluations} candidates, the best misses {worst}; "
        "allow a larger envelope, a stronger supply or more candidates (`budget`)"
    )


def candidate(unit: Floats, wishes: DamperWishes, fluid: MRFluid, steel: Steel) -> DamperDesign | None:
    """The design at a point of the unit cube, shape (N_FREE,); `None` where nothing can be built."""
    low, high = _ENDS.T
    bore, wall, gap, pole_length, coil_length, depth, stages, gauge = (low * (high / low) ** unit).tolist()
    size = wishes.outer_diameter
    n_stages, wire_gauge = min(int(stages), _STAGES[1] - 1), min(int(gauge), _GAUGES[1] - 1)
    gap = gap * wishes.least_gap
    rod = 2.0 * np.sqrt(wishes.force / (np.pi * wishes.stress))
    piston = bore * size / 2.0 - gap
    coil_depth = depth * (piston - rod / 2.0)
    clearance = min(_CLEARANCE * gap, 0.5 * coil_depth)
    copper = np.pi / 4.0 * wire_diameter(wire_gauge) ** 2
    turns = int(_FILL * coil_length * size * (coil_depth - clearance) / copper)
    if turns < 1:
        return None
    try:
        design = DamperDesign(
            fluid=fluid,
            steel=steel,
            bore=bore * size,
            wall=wall * size,
            rod=float(rod),
            gap=gap,
            stages=n_stages,
            pole_length=pole_length * size,
            coil_length=coil_length * size,
            coil_depth=float(coil_depth),
            coil_clearance=float(clearance),
            turns=turns,
            wire_gauge=wire_gauge,
            largest_current=wishes.current,
            stroke=wishes.stroke,
            velocity=wishes.velocity,
            friction=wishes.friction,
        )
        current = min(
            wishes.current, wishes.voltage / design.resistance, wishes.current_density * design.wire_area
        )
        return replace(design, largest_current=float(current))
    except SettingError:
        return None
