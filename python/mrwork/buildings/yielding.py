"""Frames that yield: storeys as bilinear loops, weights on displaced storeys (P-delta), and a push that shows both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
import scipy

from mrwork.base.arguments import Positive, checked
from mrwork.base.hints import Says, Within
from mrwork.base.numbers import format_rounded, significant
from mrwork.base.plotted import Plotted
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Column, Table
from mrwork.base.units import STANDARD_GRAVITY
from mrwork.base.values import Floats, array_dataclass, one_for_each
from mrwork.buildings.modes import modes_of
from mrwork.buildings.passive_element import KNEE, PassiveElement
from mrwork.buildings.plane_building import Building, source_with
from mrwork.errors import SettingError


@checked
def with_storeys_that_yield(
    building: Building,
    *,
    yield_drift: Annotated[
        Positive | Sequence[Positive] | None,
        Says("drift at which a storey yields; or yield_drift_ratio, or yield_shear", unit="m"),
    ] = None,
    yield_drift_ratio: Annotated[
        float | Sequence[float] | None,
        Within(above=0.0, below=1.0),
        Says("the same over the height of the storey, as 0.5 %"),
    ] = None,
    yield_shear: Annotated[
        Positive | Sequence[Positive] | None, Says("shear at which it yields", unit="N")
    ] = None,
    post_yield_ratio: Annotated[
        float | Sequence[float],
        Within(least=0.0, below=1.0),
        Says("stiffness after yielding over that before, r"),
    ] = 0.03,
    sharpness: Annotated[float | Sequence[float], Within(least=1.0, most=50.0), KNEE] = 10.0,
) -> Building:
    """The building with storeys that yield; one number for all, or one for each, lowest first.

    A storey of stiffness k that yields at the drift d_y has the shear `r k d + (1 - r) k d_y w` with the loop w of
    `PassiveElement`, bilinear but for the rounded knee, without degradation of strength or stiffness. The stiffness
    matrix stays elastic, and so do periods, Rayleigh damping, regulators and observers.

    Raises
    ------
    SettingError
        If not one of drift, ratio and shear is given, heights are not known for a ratio, the storeys yield already, or
        the building is no chain of floors on springs.
    """
    stiffnesses = building.storey_stiffnesses
    if not stiffnesses.size:
        raise SettingError(
            f"{building.name} is no chain of floors, each on the spring of its storey, so that its matrices do not say "
            "what a storey carries; give masses and stiffnesses, or the elements themselves, as [[building.element]]"
        )
    if building.loops:
        raise SettingError(
            f"the storeys of {building.name} yield already; give a building whose storeys are elastic"
        )
    settings = {
        "yield_drift": yield_drift, "yield_drift_ratio": yield_drift_ratio, "yield_shear": yield_shear,
    }  # fmt: skip
    if sum(value is not None for value in settings.values()) != 1:
        raise SettingError(f"give one of {', '.join(settings)}, which follow from each other")
    if yield_drift_ratio is not None and not building.heights.size:
        raise SettingError("yield_drift_ratio stands on heights; give height or heights in [building]")
    count = len(stiffnesses)
    ((name, value),) = ((name, value) for name, value in settings.items() if value is not None)
    drifts, ratios, knees = (
        one_for_each(each, np.squeeze(np.array(given)), count, "storey")
        for each, given in ((name, value), ("post_yield_ratio", post_yield_ratio), ("sharpness", sharpness))
    )
    if yield_drift_ratio is not None:
        drifts = drifts * building.heights[:count]
    elif yield_shear is not None:
        drifts = drifts / stiffnesses
    loops = tuple(
        PassiveElement(
            name=f"{building.storey_names[storey]}, which yields",
            row=building.storeys[storey],
            stiffness=float(ratios[storey] * stiffnesses[storey]),
            yield_force=float((1.0 - ratios[storey]) * stiffnesses[storey] * drifts[storey]),
            yield_displacement=float(drifts[storey]),
            sharpness=float(knees[storey]),
            in_stiffness=True,
        )
        for storey in range(count)
    )
    words = ", ".join(dict.fromkeys(f"{1e3 * drift:.4g}" for drift in drifts))
    return replace(
        building,
        elements=(*building.elements, *loops),
        source=source_with(building, f"storeys yield at drifts of {words} mm"),
        status="ours",
    )


def elastic_frame(building: Building) -> Building:
    """The building whose storeys stay elastic, without P-delta: itself, where they do."""
    if not building.loops and not building.loads.any():
        return building
    return replace(building, elements=building.added, loads=np.empty(0))


def with_factors(
    building: Building, *, stiffness: float = 1.0, yield_drift: float = 1.0, post_yield: float = 1.0
) -> Building:
    """The building with other stiffness and, of the storeys that yield, other yield drift and post-yield ratio.

    The strength follows: `(1 - r) k d_y`. Damping and what is built into the frame stay.
    """
    if stiffness == yield_drift == post_yield == 1.0:
        return building

    def changed(each: PassiveElement) -> PassiveElement:
        if not each.in_stiffness:
            return each
        drift = yield_drift * each.yield_displacement
        springs = stiffness * (each.stiffness + each.yield_force / each.yield_displacement)
        spring = stiffness * post_yield * each.stiffness
        if spring >= springs:
            raise SettingError(
                f"{each.name} would be as stiff after yielding as before; give a smaller factor of the post-yield ratio"
            )
        return replace(
            each, stiffness=spring, yield_force=(springs - spring) * drift, yield_displacement=drift
        )

    return replace(
        building,
        stiffness=stiffness * building.stiffness,
        elements=tuple(changed(element) for element in building.elements),
    )


@checked
def with_p_delta(building: Building) -> Building:
    """Return the building with P-delta forces: P / h of the weight P above is taken from the stiffness of each storey.

    P is the weight of all masses above a storey, h its height (Chopra, Dynamics of Structures, 2.1; as linear geometric
    stiffness). Matrices and the design of laws do not contain these forces. A row without height, as a row of
    isolators, gets none; weights without mass, as on columns that lean on the frame, are given as `loads` of
    `Building`.

    Raises
    ------
    SettingError
        If heights are not known, the floors are no chain, or the elastic frame would fall under its weight.
    """
    if not building.heights.size:
        raise SettingError(
            f"{building.name}: P-delta stands on heights; give height or heights in [building]"
        )
    if not building.unit_drifts.any():
        raise SettingError(
            f"{building.name} is no chain of floors, so that the weight on a storey cannot be told from its masses; "
            "give the weights, as loads"
        )
    above = STANDARD_GRAVITY * building.unit_drifts @ building.mass @ building.influence
    return replace(
        building,
        loads=np.where(building.heights > 0.0, above, 0.0),
        source=source_with(building, "P-delta of its weight"),
    ).check()


LoadPattern = Literal["first mode", "uniform", "triangular"]


@array_dataclass(repr=False)
class Pushover(Plotted, Summarised):
    """A frame that is pushed sideways by forces on its floors in a fixed pattern, which grow without dynamics.

    Parameters
    ----------
    roof, base_shear
        Displacement of the highest floor [m] and sum of the forces [N], shape (n,), from rest.
    drifts, shears
        Drift [m] and shear of springs and elements [N] of each storey, shape (n, n_storeys).
    weight
        Of the building [N].
    """

    _made_by: ClassVar[str] = "mr.buildings.pushover(building)"

    name: str
    pattern: str
    roof: Floats
    base_shear: Floats
    drifts: Floats
    shears: Floats
    weight: float
    height: float

    def _summary(self) -> Summary:
        points = np.unique(np.linspace(0, len(self.roof) - 1, _POINTS_SHOWN).round().astype(int))[1:].tolist()
        peak, slopes = int(np.argmax(self.base_shear)), np.diff(self.base_shear) / np.diff(self.roof)
        first, last = (format_rounded(float(slopes[end])) for end in (0, -1))
        largest = (
            f"{format_rounded(self.base_shear[peak] / 1e3)} kN at {significant(1e3 * self.roof[peak], 4)} mm"
        )
        over_height = 100.0 * self.roof / self.height if self.height else np.full(len(self.roof), np.nan)
        columns = (
            Column("", "roof", "mm", of=(1e3 * self.roof).item),
            Column("", "over height", "%", shown=3, of=over_height.item),
            Column("", "base shear", "kN", of=(self.base_shear / 1e3).item),
            Column("", "largest drift", "mm", of=(1e3 * np.abs(self.drifts).max(axis=1)).item),
            Column("", "in storey", of=(1 + np.abs(self.drifts).argmax(axis=1)).item),
        )
        return Summary(
            title=f"Pushover of {self.name}, forces as {self.pattern}",
            facts=(
                ("largest base shear", largest),
                ("over weight", significant(self.base_shear[peak] / self.weight, 3)),
                ("stiffness at the roof", f"{first} N/m at first, {last} N/m at last"),
            ),
            tables=[Table.of(columns, points)],
        )


@checked
def pushover(
    building: Building,
    *,
    pattern: LoadPattern = "first mode",
    roof: Positive | None = None,
    steps: Annotated[int, Within(least=2, most=100_000)] = 1000,
) -> Pushover:
    """Push a frame sideways until its highest floor is displaced by `roof` [m], and return forces and drifts.

    The forces on the floors are mass times the first mode, mass ("uniform"), or mass times height ("triangular", by the
    number of the floor where heights are not known). The loops of elements follow the push, weights act where the
    building has P-delta; dampers and damping take no part. By default the roof goes to 4 % of the height of the
    building; where heights are not known to eight times the displacement at which the first storey yields, or where
    none does to that under its weight as force. It ends before where weights leave the frame no shear.

    Raises
    ------
    SettingError
        If the floors are no chain.
    """
    drifts, floors = building.check().chain, building.floors
    if not building.unit_drifts.any():
        raise SettingError(f"{building.name} is no chain of floors; a pushover is of one")
    units = building.unit_drifts[: len(drifts)]
    heights = building.heights[: len(drifts)]
    levels = np.cumsum(heights) if heights.size else np.arange(1.0, len(floors) + 1.0)
    shape = building.influence.copy()
    if pattern == "first mode":
        shape = modes_of(building.mass, building.stiffness, 1)[1][:, 0]
        shape = shape * np.sign(floors[-1] @ shape)
    elif pattern == "triangular":
        shape = np.linalg.lstsq(floors, levels, rcond=None)[0]
    force = building.mass @ shape
    force = force / float(units[0] @ force)
    goal = roof if roof is not None else _far(building, force, float(levels[-1]) if heights.size else 0.0)
    rows = np.array([element.row for element in building.elements]).reshape(-1, building.n_coordinates)
    loops = np.array([element.numbers[3:6] for element in building.elements]).reshape(-1, 3)
    stiffness, top, n = building.site_stiffness, floors[-1], building.n_coordinates

    def rates(_: float, state: Floats) -> Floats:
        """Coordinates and loops per displacement of the roof."""
        w, signs = state[n:], np.ones(len(rows))
        for _turn in range(_TURNS):
            rising = 1.0 - 0.5 * (np.sign(w) * signs + 1.0) * np.abs(w) ** loops[:, 2]
            # Storeys that have yielded without any stiffness would be a mechanism.
            slope = loops[:, 1] * np.maximum(rising, _FLAT)
            unit = np.linalg.solve(stiffness + rows.T @ np.diag(loops[:, 0] * slope) @ rows, force)
            moved = unit / float(top @ unit)
            # A loop that turns back unloads with its initial stiffness.
            if (signs == (signs := np.sign(rows @ moved))).all():
                break
        return np.concatenate([moved, slope * (rows @ moved)])

    start, way = np.zeros(n + len(rows)), np.linspace(0.0, goal, steps + 1)
    tolerances: dict[str, Any] = {"rtol": 1e-8, "atol": np.repeat([1e-10 * goal, 1e-10], [n, len(rows)])}
    path = scipy.integrate.solve_ivp(rates, (0.0, goal), start, method="LSODA", t_eval=way, **tolerances).y
    q, of_loops = path[:n], rows.T @ (loops[:, :1] * path[n:])
    load = units[0] @ (stiffness @ q + of_loops)
    fallen = np.flatnonzero(load[1:] <= 0.0)
    pushed = slice(None if not fallen.size else int(fallen[0]) + 2)
    # The frame carries what the weight on it adds.
    carrying = replace(building, loads=np.empty(0)).site_stiffness
    return Pushover(
        name=building.name,
        pattern=pattern,
        roof=way[pushed],
        base_shear=load[pushed],
        drifts=(drifts @ q).T[pushed],
        shears=(units @ (carrying @ q + of_loops)).T[pushed],
        weight=building.total_mass * STANDARD_GRAVITY,
        height=float(heights.sum()),
    )


def _far(building: Building, force: Floats, height: float) -> float:
    """Displacement of the roof that a push goes to [m], where none is asked for."""
    if height > 0.0:
        return _FAR * height
    yields = building.yield_drifts[: len(building.chain)]
    elastic = np.linalg.solve(building.stiffness, force)
    if not yields.any():
        return building.total_mass * STANDARD_GRAVITY * float(abs(building.floors[-1] @ elastic))
    drifts = np.abs(building.chain @ elastic)
    first = float(np.min(np.divide(yields, drifts, out=np.full(len(yields), np.inf), where=yields > 0.0)))
    return _DUCTILE * first * float(abs(building.floors[-1] @ elastic))


_FAR: Final = 0.04
_DUCTILE: Final = 8.0
_POINTS_SHOWN: Final = 13
_TURNS: Final = 4
# Slope of a loop that has yielded, over the initial one.
_FLAT: Final = 1e-9
