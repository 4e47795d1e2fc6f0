"""A plane structure: its matrices and rows, the passive elements in it, and what follows from them without modes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import NotNegative, Whole
from mrwork.base.remark import Remark
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.passive_element import PassiveElement
from mrwork.errors import InvalidSettingError

Status = Literal["verified", "published", "ours", "masses not known"]
"""Origin of the numbers of a building; the masses of a state space without M are not known."""
# Decimals of coordinates under a unit drift, which are ones and zeros of most frames; what is rounding of a spring.
_DECIMALS, _CHAIN = 12, 1e-9
# Share of the masses below which what follows the ground is rounding.
_NOTHING = 1e-12
# Displacements under one force that differ by rounding of matrices which are published with three digits.
_DIGITS = 0.02
# Floors whose rows a sentence writes out.
_WRITTEN = 6


BY_COORDINATE: Final = ("floor_names", "storey_names", "heights", "loads")
"""What is listed by floor or storey beside matrices."""


def floors_upward(mass: Floats, stiffness: Floats) -> NDArray[np.intp]:
    """Coordinates of floors that stand on one another, from the ground up, shape (n,); empty where they do not.

    Under its masses as forces a floor moves further than those below it, and under any one force no less.
    """
    try:
        moved = np.linalg.solve(stiffness, mass.sum(axis=1))
        order = np.argsort(moved, kind="stable")
        flexible = np.linalg.inv(stiffness)[np.ix_(order, order)]
    except np.linalg.LinAlgError:
        return np.empty(0, dtype=np.intp)
    stand = (flexible > 0.0).all() and (np.diff(flexible, axis=0) >= -_DIGITS * flexible[:-1]).all()
    return order if stand else np.empty(0, dtype=np.intp)


@array_dataclass(repr=False)
class Structure:
    """What `Building` has without its modes, and what its checks and remarks look at."""

    name: str
    mass: Floats
    stiffness: Floats
    damping: Floats = field(default_factory=lambda: np.empty(0))
    influence: Floats = field(default_factory=lambda: np.empty(0))
    floors: Floats = field(default_factory=lambda: np.empty(0))
    storeys: Floats = field(default_factory=lambda: np.empty(0))
    floor_names: tuple[str, ...] = ()
    storey_names: tuple[str, ...] = ()
    source: str = ""
    status: Status = "ours"
    n_strokes: int = 0
    elements: tuple[PassiveElement, ...] = ()
    heights: Floats = field(default_factory=lambda: np.empty(0))
    loads: Floats = field(default_factory=lambda: np.empty(0))
    drift_limit: NotNegative = 0.0
    isolators: tuple[str, ...] = ()
    condensed: tuple[Whole, ...] = ()
    condensing: tuple[Remark, ...] = ()
    ordering: tuple[Remark, ...] = ()
    _is_sound: bool = field(default=False, init=False, repr=False, compare=False)

    @property
    def n_coordinates(self) -> int:
        """Number n of coordinates: the size of mass, damping and stiffness."""
        return len(self.mass)

    @property
    def kept(self) -> NDArray[np.intp]:
        """Index of each coordinate among those before some were condensed, shape (n,)."""
        whole = np.arange(self.n_coordinates + len(self.condensed))
        return np.delete(whole, np.array(self.condensed, dtype=np.intp) - 1)

    def from_coordinates(self, stated: Mapping[str, Any]) -> dict[str, Any]:
        """Statements beside the matrices of a building whose floors were ordered: names follow their coordinates.

        Numbers that are not the same from the ground and in the order of the coordinates are refused.
        """
        order, result = self.floors.argmax(axis=1), dict(stated)
        own_rows = not np.array_equal(self.storeys, np.diff(self.floors, axis=0, prepend=0.0))
        for name in BY_COORDINATE if self.ordering else ():
            values = result.get(name)
            if values is None or len(values) != len(order) or (own_rows and name != "floor_names"):
                continue
            upward = [values[place] for place in order]
            if name.endswith("names"):
                result[name] = tuple(upward)
            elif upward != [*values]:
                rows = [[int(entry) for entry in row] for row in self.floors]
                raise InvalidSettingError(
                    name,
                    f"{name} may begin at coordinate 1 or at coordinate {order[0] + 1}, which stands on the ground; "
                    + (f"give floors = {rows}" if len(rows) <= _WRITTEN else "sort the matrices by floors")
                    + f", lowest first, and {name} and names likewise",
                )
        return result

    @property
    def chain(self) -> Floats:
        """The rows of `storeys` that stand between ground and floors: drifts and isolators, without other strokes."""
        return self.storeys[: len(self.storeys) - self.n_strokes]

    @property
    def isolates(self) -> NDArray[np.bool_]:
        """Whether a row of `storeys` is of isolators, named or without height between storeys with one."""
        of_chain = np.arange(len(self.storeys)) < len(self.chain)
        found = of_chain & np.array([name in self.isolators for name in self.storey_names], dtype=bool)
        if self.heights.any():
            found |= of_chain & (self.heights == 0.0)
        return found if (of_chain & ~found).any() else np.zeros_like(found)

    @property
    def drifts(self) -> Floats:
        """The rows of `storeys` that are drifts of a frame: no isolators, no other strokes; shape (n_drifts, n)."""
        return self.of_drifts(self.storeys)

    def of_drifts(self, values: Floats) -> Floats:
        """Those of numbers for each storey that belong to `drifts`; empty where they are not known."""
        is_drift = ~self.isolates & (np.arange(len(self.storeys)) < len(self.chain))
        return values[is_drift] if len(values) else values

    @property
    def drift_names(self) -> tuple[str, ...]:
        """Names of the storeys whose drifts `drifts` has."""
        return tuple(self.of_drifts(np.array(self.storey_names, dtype=object)).tolist())

    @property
    def frame_floors(self) -> tuple[str, ...]:
        """Names of the floors without the slabs that isolators carry alone."""
        slabs = self.storeys[self.isolates]
        pairs = zip(self.floor_names, self.floors, strict=True)
        return tuple(name for name, row in pairs if not (slabs == row).all(axis=1).any())

    @property
    def site_stiffness(self) -> Floats:
        """Stiffness matrix in the simulation, beside the elements [N/m], shape (n, n).

        It is K without the initial stiffness of the parts of the frame that yield, whose loops take its place, and
        without P / h of each storey under the weight P (P-delta). Modes, regulators and observers go by K.
        """
        beside = self._beside_loops
        return beside - self._geometric if self.loads.any() else beside

    @property
    def loops(self) -> tuple[PassiveElement, ...]:
        """The elements that are parts of the frame, whose initial stiffness K has: storeys that yield."""
        return tuple(element for element in self.elements if element.in_stiffness)

    @property
    def added(self) -> tuple[PassiveElement, ...]:
        """The elements that are no parts of the frame: its passive devices."""
        return tuple(element for element in self.elements if not element.in_stiffness)

    @property
    def _beside_loops(self) -> Floats:
        """K without the initial stiffness of the parts of the frame that yield [N/m], shape (n, n); K if none does."""
        loops = self.loops
        if not loops:
            return self.stiffness
        rows = np.array([element.row for element in loops])
        springs = np.array([element.yield_force / element.yield_displacement for element in loops])
        return np.asarray(self.stiffness - rows.T @ (springs[:, None] * rows))

    @property
    def yield_drifts(self) -> Floats:
        """Drift at which each storey yields [m], shape (n_storeys,), 0 where a storey does not; empty if none does."""
        drifts = np.zeros(len(self.storeys))
        for element in self.loops:
            drifts[(self.storeys == element.row).all(axis=1)] = element.yield_displacement
        return drifts if drifts.any() else np.empty(0)

    @property
    def _geometric(self) -> Floats:
        """P / h of each storey under the weight P, as a matrix [N/m], shape (n, n)."""
        return np.asarray(self.storeys.T @ np.diag(self._softer) @ self.storeys)

    @property
    def _softer(self) -> Floats:
        """P / h of each storey [N/m], shape (n_storeys,)."""
        return np.divide(self.loads, self.heights, out=np.zeros(len(self.loads)), where=self.heights > 0.0)

    @property
    def nonlinear(self) -> str:
        """Name of the first part that is simulated and not in the matrices; empty for a linear building."""
        beside = "P-delta" if self.loads.any() else ""
        return next((element.name for element in self.elements if not element.is_linear), beside)

    @property
    def unit_drifts(self) -> Floats:
        """Coordinates under a unit drift of each storey alone, on which all above it moves, shape (n_storeys, n).

        The inertia that does work on such a row is the shear of the storey. Zeros for strokes, and for all rows where
        drifts and strokes do not determine the coordinates or the floors are no chain.
        """
        none, drifts, inverse = np.zeros_like(self.storeys), len(self.chain), self._from_stretched
        if not inverse.size or len(self.floors) != drifts:
            return none
        none[:drifts] = inverse.T[:drifts]
        is_chain = np.allclose(self.floors @ none[:drifts].T, np.tri(drifts), atol=1e-6)
        return none if is_chain else np.zeros_like(none)

    @property
    def storey_springs(self) -> Floats:
        """Stiffness of the springs of each storey beside its elements [N/m], shape (n_storeys,); zeros of no chain."""
        springs = self._springs_of(self._beside_loops)
        return np.append(springs, np.zeros(len(self.storeys) - len(springs)))

    @property
    def storey_stiffnesses(self) -> Floats:
        """Stiffness of each storey [N/m] of a chain of floors, lowest first; empty where it is no chain."""
        springs = self._springs_of(self.stiffness)
        return np.asarray(springs if (springs > 0.0).all() else np.empty(0))

    def _springs_of(self, stiffness: Floats) -> Floats:
        """Storey springs [N/m], shape (n_chain,), that make a stiffness matrix; empty if no springs do."""
        inverse = self._from_stretched
        if not inverse.size:
            return np.empty(0)
        springs = inverse.T @ stiffness @ inverse
        diagonal = np.diag(springs)
        is_chain = np.allclose(springs, np.diag(diagonal), rtol=0.0, atol=_CHAIN * np.abs(diagonal).max())
        return np.array(diagonal[: len(self.chain)]) if is_chain else np.empty(0)

    @property
    def _from_stretched(self) -> Floats:
        """Coordinates from what stretches the springs of storeys and additions, shape (n, n); empty if that is not n.

        It is drifts and strokes, of a brace its own deformation in place of the stroke of its damper.
        """
        rows = self.storeys.copy()
        if rows.shape != self.mass.shape:
            return np.empty(0)
        for row in rows[len(self.chain) :]:
            last = int(np.flatnonzero(row)[-1]) if row.any() else 0
            if row[last] < 0.0:
                row[:] = np.eye(len(row))[last]
        try:
            inverse = np.linalg.inv(rows).round(_DECIMALS)
        except np.linalg.LinAlgError:
            return np.empty(0)
        return np.asarray(
            inverse if np.allclose(inverse @ rows, np.eye(len(rows)), atol=1e-6) else np.empty(0)
        )

    @property
    def knows_masses(self) -> bool:
        """Whether the masses are known, without which nobody knows what a force does to it."""
        return self.status != "masses not known"

    @property
    def total_mass(self) -> float:
        """Mass in rigid-body motion with the ground: r' M r [kg]."""
        return float(self.influence @ self.mass @ self.influence)

    @property
    def follows_ground(self) -> bool:
        """Whether anything of it moves with the ground; a deck or a cable in its own coordinates does not."""
        return self.total_mass > _NOTHING * float(np.trace(self.mass))

    @property
    def reference_mass(self) -> float:
        """What forces on it are compared with: `total_mass`, or that of all coordinates if none follows [kg]."""
        return self.total_mass if self.follows_ground else float(np.trace(self.mass))
