"""Plane building model: its matrices, its passive elements, the devices that follow a command, and checks on them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from itertools import groupby
from typing import Annotated, ClassVar, Final, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from mrwork.base.arguments import NotNegative, Positive, checked
from mrwork.base.hints import Says, Within
from mrwork.base.numbers import counted, format_rounded, significant
from mrwork.base.plotted import Plotted
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Table
from mrwork.base.units import STANDARD_GRAVITY, unusual_number
from mrwork.base.values import Floats, array_dataclass, freeze_samples, keep_arrays
from mrwork.buildings.modes import (
    OF_ADDITIONS,
    apart_of,
    damping_remarks,
    growing_modes,
    is_positive,
    modes_of,
    settle_shapes,
)
from mrwork.dampers.spec import DamperSpec, with_changed_laws
from mrwork.dampers.tested_range import OperatingRange, Outside, beyond_rating, outside_of
from mrwork.errors import SettingError, UnknownNameError

KNEE: Final = Says("sharpness of the knee: 1 is round, 10 nearly bilinear")
Sharpness = Annotated[float, Within(least=1.0, most=50.0), KNEE]
Status = Literal["verified", "published", "ours", "masses not known"]
WITHOUT_MASSES: Final = "masses not known"
"""Status of a building of a state space without M: what a force does to it is not known."""


@checked
@array_dataclass(repr=False)
class PassiveElement(Summarised):
    """A passive device `f = k x + c v + d |v| v + f_y w` across a row of a building, x its elongation and v = x'.

    `w' = (v - (|v| |w|^(n-1) w + v |w|^n) / 2) / x_y` is the normalised Bouc-Wen loop, which goes to elastic-perfectly
    plastic as n grows (Ikhouane, Rodellar, Systems with Hysteresis, Wiley, 2007). The spring k [N/m] and the dashpot c
    [N s/m] are in the matrices of the building, so that modes, observers and regulators see them; whoever adds the
    element adds them there. The rest they do not see: `head_loss` d [N s2/m2], `yield_force` f_y [N] and
    `yield_displacement` x_y [m] with the initial stiffness f_y / x_y, and `sharpness` n of the knee, 1 for a round and
    10 for a nearly bilinear one. Of a part of the frame, `in_stiffness`, they see this stiffness too: the stiffness
    matrix belongs to the elastic frame, and the loop takes its place when the building is simulated.
    """

    _made_by: ClassVar[str] = (
        "mr.buildings.with_friction_damper(...) and its like, or mr.buildings.PassiveElement(...)"
    )

    name: Annotated[str, Says("name in tables")]
    row: Annotated[Floats, Says("its displacement over the coordinates: a number for each")]
    stiffness: Annotated[NotNegative, Says("spring, which is in the matrices", unit="N/m")] = 0.0
    damping: Annotated[NotNegative, Says("dashpot, which is in the matrices", unit="N s/m")] = 0.0
    head_loss: Annotated[NotNegative, Says("coefficient of head loss, in N s2/m2")] = 0.0
    yield_force: Annotated[NotNegative, Says("force at which it yields or slips", unit="N")] = 0.0
    yield_displacement: Annotated[Positive, Says("displacement at which it does", unit="m")] = 1.0
    sharpness: Sharpness = 10.0
    in_stiffness: Annotated[
        bool,
        Says(
            "whether the stiffness matrix has the initial stiffness of its loop too, as of a storey that yields"
        ),
    ] = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "row", freeze_samples(self.row))

    def _summary(self) -> Summary:
        facts = (
            ("spring", self.stiffness, "N/m"),
            ("dashpot", self.damping, "N s/m"),
            ("head loss", self.head_loss, "N s2/m2"),
            ("yields at", self.yield_force, "N"),
        )
        return Summary(
            title=f"Passive element {self.name}",
            facts=tuple((name, f"{format_rounded(value)} {unit}") for name, value, unit in facts if value),
        )

    @property
    def is_linear(self) -> bool:
        """Whether the matrices contain the whole element, as they do a viscous damper."""
        return not (self.head_loss or self.yield_force)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Its parameters k, c, d, f_y, 1 / x_y, n, for the digest of a run, and 1 where it is part of the frame."""
        linear = self.stiffness, self.damping, self.head_loss
        loop = self.yield_force, 1.0 / self.yield_displacement, self.sharpness
        return (*linear, *loop, *((1.0,) if self.in_stiffness else ()))


def transform_elements(elements: Sequence[PassiveElement], onto: Floats) -> tuple[PassiveElement, ...]:
    """The elements of a building in other coordinates y, with q = onto @ y."""
    return tuple(replace(element, row=element.row @ onto) for element in elements)


def source_with(building: Building, change: str) -> str:
    """Source of a changed building: that of the original and, behind a semicolon, the change."""
    return f"{building.source}; {change}".removeprefix("; ")


@checked
@array_dataclass(repr=False)
class Building(Plotted, Summarised):
    """Plane building `M q'' + C q' + K q = -sum_d e_d' f_d - M r a_g`, with q relative to the ground.

    Passive elements, if it has any, add the part of their force that M, C and K do not have, as a device does.

    The arrays are stored as read-only copies. Whether mass, stiffness and damping can belong to a building is checked
    once, by `check`, where modes, a law or a simulation first need it.

    Parameters
    ----------
    mass, damping, stiffness
        M [kg], C [N s/m], K [N/m], shape (n, n).
    influence
        r, the coordinates under a unit rigid-body displacement of the ground, shape (n,): ones for floor displacements.
    floors
        Displacement of each floor relative to the ground = floors @ q, shape (n_floors, n), lowest first; its
        absolute acceleration = floors @ q'' + a_g.
    storeys
        Drift of each storey = storeys @ q, shape (n_storeys, n), lowest first. A device across a storey is
        elongated by the drift, and acts on the coordinates with minus its row times the force.
    floor_names, storey_names
        Their names in reports.
    source, status
        Origin of the numbers; the status is "verified", "published", "ours" or "masses not known".
    n_strokes
        Number of last rows of `storeys` that are strokes of additions (a tuned mass, a damper behind its brace).
        They are not drifts and do not count in drift criteria.
    elements
        Elements that yield, slip or lose head; modes, regulators and observers do not see them.
    heights
        Height of each storey [m], shape (n_storeys,), lowest first, 0 for a row that is no storey, such as isolators or
        a stroke; empty where they are not known. Drift ratios stand on them.
    loads
        Weight on each storey [N], shape (n_storeys,), as `with_p_delta` gives it: its second-order forces act when the
        building is simulated, and are not in K. Empty without them.
    drift_limit
        Drift ratio that the building is to keep, as 0.01; 0 if none is stated. Pages draw it.

    Raises
    ------
    SettingError
        If it has more than 3000 coordinates, shapes disagree, a number is above 1e50, or M or K is not symmetric.
    """

    _made_by: ClassVar[str] = "mr.building(name) or mr.buildings.read_building(path)"

    name: str
    mass: Floats
    damping: Floats
    stiffness: Floats
    influence: Floats
    floors: Floats
    storeys: Floats
    floor_names: tuple[str, ...]
    storey_names: tuple[str, ...]
    source: str = ""
    status: Status = "ours"
    n_strokes: int = 0
    elements: tuple[PassiveElement, ...] = ()
    heights: Floats = field(default_factory=lambda: np.empty(0))
    loads: Floats = field(default_factory=lambda: np.empty(0))
    drift_limit: NotNegative = 0.0
    _is_sound: bool = field(default=False, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_size(len(self.mass) if self.mass.ndim else 0, f"building {self.name}")
        for name in (*_ARRAYS, "heights", "loads"):
            object.__setattr__(self, name, freeze_samples(getattr(self, name)))
        _check_form(self)

    def check(self) -> Building:
        """The building itself, which keeps that it was checked.

        Raises
        ------
        SettingError
            If M is singular, K unstable, weights exceed the stiffness of a storey, or C makes a mode grow.
        """
        if not self._is_sound:
            _check_motion(self)
            object.__setattr__(self, "_is_sound", True)
        return self

    def _repr_html_(self) -> str:
        """The summary, and of a chain of floors the drawing."""
        is_drawn = len(self.storey_stiffnesses) == self.n_coordinates <= _MOST_DRAWN
        return f"{self._summary().html()}{self.plot._repr_html_() if is_drawn else ''}"

    @property
    def n_coordinates(self) -> int:
        """Number n of coordinates: the size of mass, damping and stiffness."""
        return len(self.mass)

    @property
    def drifts(self) -> Floats:
        """The rows of `storeys` that are drifts between floors, shape (n_storeys - n_strokes, n)."""
        return self.storeys[: len(self.storeys) - self.n_strokes]

    @property
    def drift_names(self) -> tuple[str, ...]:
        """Names of the storeys whose drifts `drifts` has."""
        return self.storey_names[: len(self.drifts)]

    @property
    def drift_heights(self) -> Floats:
        """Heights of the storeys whose drifts `drifts` has [m], shape (n_storeys - n_strokes,), or empty."""
        return self.heights[: len(self.drifts)]

    @property
    def site_stiffness(self) -> Floats:
        """Stiffness matrix in the simulation, beside the elements [N/m], shape (n, n).

        It is K without the initial stiffness of the parts of the frame that yield, whose loops take its place, and
        without P / h of each storey under the weight P (P-delta). Modes, regulators and observers go by K.
        """
        beside = self._beside_loops
        return beside - self._geometric if self.loads.any() else beside

    @property
    def _beside_loops(self) -> Floats:
        """K without the initial stiffness of the parts of the frame that yield [N/m], shape (n, n); K if none does."""
        loops = [element for element in self.elements if element.in_stiffness]
        if not loops:
            return self.stiffness
        rows = np.array([element.row for element in loops])
        springs = np.array([element.yield_force / element.yield_displacement for element in loops])
        return np.asarray(self.stiffness - rows.T @ (springs[:, None] * rows))

    @property
    def yield_drifts(self) -> Floats:
        """Drift at which each storey yields [m], shape (n_storeys,), 0 where a storey does not; empty if none does."""
        drifts = np.zeros(len(self.storeys))
        for element in self.elements:
            if element.in_stiffness:
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
        none, drifts, inverse = np.zeros_like(self.storeys), len(self.drifts), self._from_stretched
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
        """Storey springs [N/m], shape (n_drifts,), that make a stiffness matrix; empty if no springs do."""
        inverse = self._from_stretched
        if not inverse.size:
            return np.empty(0)
        springs = inverse.T @ stiffness @ inverse
        diagonal = np.diag(springs)
        is_chain = np.allclose(springs, np.diag(diagonal), rtol=0.0, atol=_CHAIN * np.abs(diagonal).max())
        return np.array(diagonal[: len(self.drifts)]) if is_chain else np.empty(0)

    @property
    def _from_stretched(self) -> Floats:
        """Coordinates from what stretches the springs of storeys and additions, shape (n, n); empty if that is not n.

        It is drifts and strokes, of a brace its own deformation in place of the stroke of its damper.
        """
        rows = self.storeys.copy()
        if rows.shape != self.mass.shape:
            return np.empty(0)
        for row in rows[len(self.drifts) :]:
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
    def total_mass(self) -> float:
        """Mass in rigid-body motion with the ground: r' M r [kg]."""
        return float(self.influence @ self.mass @ self.influence)

    @property
    def frequencies(self) -> Floats:
        """Undamped natural frequencies [Hz], shape (n,), lowest first."""
        # Without the shapes, a fifth of the time of all modes.
        squares = scipy.linalg.eigh(self.stiffness, self.check().mass, eigvals_only=True)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi))

    @property
    def periods(self) -> Floats:
        """Undamped natural periods [s], shape (n,), longest first; infinite of a motion without stiffness."""
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / self.frequencies)

    @property
    def effective_masses(self) -> Floats:
        """Effective modal masses `(phi' M r)^2` with phi' M phi = 1 [kg], shape (n,); their sum is `total_mass`.

        The base shear of a mode is this mass times its pseudo-acceleration (Chopra, Dynamics of Structures, 13.2.5).
        """
        return self._modal().effective_masses

    @property
    def participation(self) -> Floats:
        """Participation factors `phi' M r / phi' M phi`, shape (n,), of shapes that are 1 at the highest floor.

        A mode that does not move this floor has 0. Where there are no additions, their sum is 1.
        """
        return self._modal().participation

    def _modal(self, most: int | None = None) -> _Modal:
        omega, modes = self._shapes(most)
        driven = modes.T @ self.mass @ self.influence
        with np.errstate(divide="ignore", invalid="ignore"):
            return _Modal(
                period=2.0 * np.pi / omega,
                damping_ratio=np.einsum("im,im->m", modes, self.damping @ modes) / (2.0 * omega),
                participation=driven * (self.floors[-1] @ modes),
                effective_masses=driven**2,
            )

    @property
    def modes(self) -> Floats:
        """Mode shapes as columns, shape (n, n), scaled so that modes' M modes = I.

        Of modes of one frequency, as of equal towers, they are those that damping does not couple.
        """
        return self._shapes(None)[1]

    def _shapes(self, most: int | None) -> tuple[Floats, Floats]:
        omega, modes = modes_of(self.check().mass, self.stiffness, most)
        return omega, settle_shapes(omega, modes, self.damping, self.mass @ self.influence)

    @property
    def damping_ratios(self) -> Floats:
        """Ratio of damping to critical damping of each mode, shape (n,), without the coupling between modes.

        Exact for classical damping (Rayleigh, modal). Otherwise, as with a damper at one storey, the poles give the
        actual decay.
        """
        # Infinite or NaN for a mode without stiffness.
        return self._modal().damping_ratio

    @property
    def damping_remarks(self) -> tuple[Remark, ...]:
        """On modes without damping or without stiffness, on which dampers look better than they are.

        Where all modes are damped and stiff, this takes one or two matrix factorisations. Passive elements do not
        count, as in all modes.
        """
        matrices = self.check().mass, self.damping, self.stiffness, self.floors
        return tuple(damping_remarks(self.name, *matrices))

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """`damping_remarks`, and what a colleague would ask about modes, coordinates, damping and strength."""
        is_asked = len(self.mass) <= _MOST_QUESTIONED and self.total_mass > 0.0
        asks = (_mode_remarks, _coordinate_remarks, _storey_remarks) if is_asked else ()
        return (*self.damping_remarks, *(remark for ask in asks for remark in ask(self)))

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of the state matrix [rad/s], shape (2 n,), sorted by magnitude."""
        poles = np.linalg.eigvals(self.state_matrices()[0]).astype(np.complex128)
        return poles[np.lexsort((poles.imag, np.abs(poles).round(9)))]

    @checked
    def state_matrices(self, rows: Floats | None = None) -> tuple[Floats, Floats, Floats]:
        """A, B, E of `s' = A s + B f + E a_g`, with s = [q; q'].

        Parameters
        ----------
        rows
            Elongation of each device = row @ q, shape (n_devices, n). By default one device across each storey.

        Returns
        -------
        A, B, E
            Shapes (2 n, 2 n), (2 n, n_devices), (2 n,). B has the sign of a resisting force.
        """
        n = self.check().n_coordinates
        rows = self.storeys if rows is None else rows
        if rows.ndim != 2 or rows.shape[1] != n:
            raise SettingError(f"`rows` has shape {rows.shape}, {self.name} takes (n_devices, {n})")
        solved = np.linalg.solve(self.mass, np.hstack([-self.stiffness, -self.damping, -rows.T]))
        A = np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), solved[:, : 2 * n]])
        B = np.vstack([np.zeros((n, len(rows))), solved[:, 2 * n :]])
        E = np.concatenate([np.zeros(n), -self.influence])
        return A, B, E

    @checked
    def storey_row(self, storey: int | str) -> Floats:
        """Row of a storey, shape (n,), by its number from 1 or by its name."""
        return np.asarray(self.storeys[self._storey(storey)])

    @checked
    def floor_row(self, floor: int | str) -> Floats:
        """Row of a floor, shape (n,), by its number from 1 or by its name."""
        return np.asarray(self.floors[_index(floor, self.floor_names, f"{self.name}: there is no floor")])

    @checked
    def storey_name(self, storey: int | str) -> str:
        """Name of the storey of a number from 1 or of a name; refused where the building has none."""
        return self.storey_names[self._storey(storey)]

    def _storey(self, storey: int | str) -> int:
        return _index(storey, self.storey_names, f"{self.name}: there is no storey")

    def _summary(self) -> Summary:
        modal = self._modal(_SHOWN_MODES)
        masses = modal.effective_masses / (self.total_mass or 1.0)
        columns = (
            modal.period,
            1.0 / modal.period,
            100.0 * modal.damping_ratio,
            modal.participation,
            100.0 * masses,
            100.0 * np.cumsum(masses),
        )
        rows = [
            (str(mode + 1), *(significant(float(column[mode]), 4) for column in columns))
            for mode in range(len(masses))
        ]
        heads = ("mode", "period [s]", "[Hz]", "damping [%]", "participation", "mass [%]", "sum [%]")
        return Summary(
            title=f"Building {self.name}: {counted(len(self.floors), 'floor')}, {self.total_mass:.5g} kg",
            facts=(
                ("masses", _listed(np.diag(self.mass), "kg") if len(self.storey_stiffnesses) else ""),
                ("stiffnesses", _listed(self.storey_stiffnesses, "N/m")),
                ("heights", _listed(self.drift_heights, "m")),
                ("yield at", _listed(1e3 * self.yield_drifts[: len(self.drifts)], "mm of drift")),
                ("P-delta", _listed(self.loads[: len(self.drifts)], "N") if self.loads.any() else ""),
                ("passive", ", ".join(element.name for element in self.elements if not element.in_stiffness)),
                ("source", f"{self.source} ({self.status})" if self.source else self.status),
            ),
            tables=[Table(columns=heads, rows=rows)],
            notes=(
                "damping: diagonal of the modal damping over 2 omega, without coupling; participation: of shapes that "
                "are 1 at the highest floor; mass: effective modal mass over the mass of the building",
            ),
            remarks=self.remarks,
        )


def _listed(values: Floats, unit: str) -> str:
    """Numbers with their unit, equal ones beside each other once, as "337, 4 x 330 kg"."""
    texts = [format_rounded(float(value)) for value in values]
    runs = [(text, len(list(same))) for text, same in groupby(texts)]
    return f"{', '.join(text if n == 1 else f'{n} x {text}' for text, n in runs)} {unit}" if texts else ""


@array_dataclass()
class _Modal:
    """Periods [s], damping ratios, participation factors and effective masses [kg] of the modes, shape (n,) each."""

    period: Floats
    damping_ratio: Floats
    participation: Floats
    effective_masses: Floats


def _index(key: int | str, names: tuple[str, ...], refusal: str) -> int:
    """Index of a row given by name or by number from 1."""
    if isinstance(key, str) and key in names:
        return names.index(key)
    if isinstance(key, int) and not isinstance(key, bool) and 1 <= key <= len(names):
        return key - 1
    raise UnknownNameError(
        f"{refusal} {key!r}; give a number from 1 to {len(names)} or one of {', '.join(names)}"
    )


_ARRAYS: Final = ("mass", "damping", "stiffness", "influence", "floors", "storeys")
# Published matrices have five or six digits, with each triangle rounded separately.
_ASYMMETRY: Final = 1e-6
# First periods of frames [s]: the shortest for each storey, and the longest by number of storeys, with room for models
# of a laboratory and for isolation. A mass or stiffness that is off by a thousand changes a period by 32.
_SHORTEST, _LONGEST = 0.005, (1.5, 0.5)
# Share of the first mode within the lowest storey from which on a frame stands on isolators; their longest period [s].
_RIGID, _ISOLATED = 0.75, 10.0
# Share of the mass up to which the first mode belongs to a small part.
_SMALL_PART: Final = 0.1
# Frequency [Hz] and share of the mass of a mode that is of no use to a frame; damping ratio of its main mode.
_STIFF, _MOVES_LITTLE, _OVERDAMPED = 1e3, 1e-3, 0.5
# Positive coupling of two coordinates beside their stiffness, and share of the largest mass that is light.
_COUPLED, _LIGHT = 0.1, 1e-4
DRIFT_RATIOS: Final = (5e-4, 0.1)
"""Usual limits of a drift ratio."""
# Height of a storey for people [m], and least mass of the heaviest floor of such a building [kg].
_HUMAN, _LEAST_FLOOR = 2.0, 200.0
_SHOWN_MODES: Final = 10
_MOST_DRAWN: Final = 100
# Stiffness of a storey over that of ordinary ones; isolators are a hundred times softer.
_STIFFER: Final = 300.0
# Coordinates of a building whose modes take a fraction of a second.
_MOST_QUESTIONED: Final = 300
# Decimals of coordinates under a unit drift, which are ones and zeros of most frames; what is rounding of a spring.
_DECIMALS: Final = 12
_CHAIN: Final = 1e-9
# Height of a storey [m].
_TALLEST: Final = 200.0
# Products of several such numbers are finite.
_LARGEST: Final = 1e50
# Ratio of the smallest to the largest eigenvalue, after scaling to a unit diagonal.
_SINGULAR: Final = 1e-12
# A negative stiffness below this fraction of the largest is rounding.
_ROUNDING: Final = 1e-9

# Five matrices, the copies of a reader and of the checks: gigabytes per coordinate squared.
_GIGABYTES: Final = 1.1e-7
# They fit into 1 GiB.
MOST_COORDINATES: Final = 3000


def check_size(n_coordinates: int, where: str) -> None:
    """Refuse a building whose matrices would not fit into memory."""
    if n_coordinates > MOST_COORDINATES:
        raise SettingError(
            f"{where}: it has {n_coordinates:,} coordinates, and its matrices would take "
            f"{_GIGABYTES * n_coordinates**2:,.1f} GB until they are checked; condense it to at most "
            f"{MOST_COORDINATES:,} coordinates"
        )


def _check_form(building: Building) -> None:
    """Refuse arrays, names and numbers that do not fit together."""
    where = f"building {building.name}"
    _check_shapes(building, where)
    for title in _ARRAYS:
        matrix: Floats = getattr(building, title)
        possible = np.abs(matrix) <= _LARGEST
        if not possible.all():
            index = tuple(np.argwhere(~possible)[0])
            entry = ", ".join(str(number + 1) for number in index)
            raise SettingError(
                f"{where}: entry {entry} of {title} is {matrix[index]:g}, which is beyond any building; correct it"
            )
    _check_heights(building, where)
    _check_loads(building, where)
    for element in building.elements:
        if element.row.shape != building.influence.shape:
            raise SettingError(
                f"{where}: the row of {element.name} has shape {element.row.shape}; give "
                f"({building.influence.size},), a row of `storeys`"
            )
    for title in ("mass", "stiffness"):
        _check_symmetric(getattr(building, title), title, where)
    _check_names(building.floor_names, len(building.floors), "floor", where)
    _check_names(building.storey_names, len(building.storeys), "storey", where)
    if not 0 <= building.n_strokes <= len(building.storeys):
        raise SettingError(
            f"{where}: {building.n_strokes} of {len(building.storeys)} storey rows are declared as strokes; "
            "give a number from zero to all"
        )


def _check_motion(building: Building) -> None:
    """Refuse masses, a stiffness or damping that no building has."""
    where = f"building {building.name}"
    _check_mass(building.mass, where)
    _check_stiffness(building.stiffness, where)
    _check_weight(building)
    yields = any(element.in_stiffness for element in building.elements)
    if yields and not is_positive(building._beside_loops, 1e-9 * float(np.trace(building.stiffness))):
        raise SettingError(
            f"{where}: the storeys that yield are stiffer than the stiffness matrix, which has their initial "
            "stiffness; give the matrix of the elastic frame, and let its storeys yield once"
        )
    if growing := growing_modes(building.mass, building.damping, building.stiffness, building.floors):
        raise SettingError(
            f"{where}: {growing}, so that motion grows without end; check the signs of the damping matrix, and give a "
            "device that feeds energy as a control law, not as damping"
        )


_PERIOD: Final = RemarkKind(
    "period_unusual",
    "{0}: the {1} period is {value:.3g} s for {storeys}, and frames have about 0.1 s a storey",
    "masses are in kg, stiffnesses in N/m: check whether one is off by a thousand",
)
_SOFT_PART: Final = RemarkKind(
    "part_soft",
    "{0}: mode 1 moves {first:.0f} % of the mass and mode {main} {most:.0f} %; a part is softer than the frame",
    "check its stiffness",
)
_MODE_DAMPING: Final = RemarkKind(
    "mode_overdamped",
    "{0}: mode {mode} at {frequency:.4g} Hz has {percent:.3g} % of critical damping",
    "check damping in N s/m and ratios as shares, or give modal_damping",
)
_STIFF_MODE: Final = RemarkKind(
    "mode_stiff",
    "{0}: mode {mode} at {frequency:.4g} Hz has {percent:.3g} % of critical damping; it moves {share:.1g} of the mass, "
    "by coordinate {part}, {mass:g} kg",
    "condense this coordinate out of the matrices, or damp its mode by modal_damping",
)


def _mode_remarks(building: Building) -> Iterator[Remark]:
    """Remarks on periods, on a part that is softer than its frame, on stiff coordinates without mass, on damping."""
    omega, modes = building._shapes(None)
    modal, storeys = building._modal(), len(building.drifts) or 1
    shares, frequency = modal.effective_masses / building.total_mass, omega / (2.0 * np.pi)
    moved = np.abs(building.floors @ modes[:, 0]).max(initial=0.0)
    # A frame on isolators moves as a whole in its first mode, and bends in the second.
    isolated = storeys > 1 and abs(building.drifts[0] @ modes[:, 0]) > _RIGID * moved
    mode = int(isolated and float(modal.period[0]) <= _ISOLATED)
    period = float(modal.period[mode])
    longest = _ISOLATED if isolated else _LONGEST[0] + _LONGEST[1] * storeys
    if np.isfinite(period) and not _SHORTEST * storeys <= period <= longest:
        words, measured = (building.name, ("first", "second")[mode]), Measured(period, "s")
        yield _PERIOD.remark(*words, measured=measured, storeys=counted(storeys, "storey"))
    most, apart = int(shares.argmax()), apart_of(modes, building.mass, building.floors) >= OF_ADDITIONS
    if not apart[0] and shares[0] < _SMALL_PART and shares[most] > 2.0 * shares[0]:
        yield _SOFT_PART.remark(
            building.name, first=100.0 * shares[0], main=most + 1, most=100.0 * shares[most]
        )
    dashpots = (
        element.damping * (element.row @ modes) ** 2
        for element in building.elements
        if not element.in_stiffness
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = modal.damping_ratio - sum(dashpots) / (2.0 * omega)
    seen = (omega > 0.0) & ~apart
    stiff = seen & (frequency > _STIFF) & (shares < _MOVES_LITTLE)
    damped = seen & (ratios > np.where(np.arange(len(omega)) == most, _OVERDAMPED, 1.0))
    for number in np.flatnonzero(stiff if stiff.any() else damped)[-1:]:
        part = int((np.abs(modes[:, number]) * np.sqrt(np.diag(building.mass))).argmax())
        yield (_STIFF_MODE if stiff.any() else _MODE_DAMPING).remark(
            building.name,
            measured=Measured(float(ratios[number]), ""),
            mode=number + 1,
            frequency=frequency[number],
            percent=100.0 * ratios[number],
            share=shares[number],
            part=part + 1,
            mass=building.mass[part, part],
        )


_ROTATION: Final = RemarkKind(
    "coordinate_no_displacement",
    "{0}: by its stiffness coordinate {coordinate} is no displacement of a floor, and the ground moves it as one",
    "give influence, 0 of a rotation, and the rows floors and storeys of those that there are, in [building]",
)


def _coordinate_remarks(building: Building) -> Iterator[Remark]:
    """Warn of coordinates that the influence says the ground moves, but whose stiffness shows no displacements.

    Springs between displacements have negative entries beside the diagonal, and condensed frames positive ones between
    every second floor. Rotations have positive ones between neighbours, and without their own influence K r there.
    """
    follows = np.flatnonzero(building.influence)
    stiffness = building.stiffness[np.ix_(follows, follows)]
    diagonal, mass = np.diag(stiffness), np.diag(building.mass)[follows]
    if building.status == WITHOUT_MASSES or (diagonal <= 0.0).any():
        return
    coupled = stiffness / np.sqrt(np.outer(diagonal, diagonal)) > _COUPLED
    np.fill_diagonal(coupled, val=False)
    index = np.arange(len(follows))
    wrong = coupled & ((index[:, None] - index) % 2 == 1)
    held = (building.stiffness @ building.influence)[follows] / diagonal
    light = (mass < _LIGHT * mass.max()) & (np.abs(held) > _ASYMMETRY)
    wrong |= coupled & (light[:, None] | light)
    if wrong.any() or (light & (held < 0.0)).any():
        first = int(follows[(light if light.any() else wrong.any(axis=1)).argmax()])
        yield _ROTATION.remark(building.name, coordinate=first + 1)


_STOREY_STIFF: Final = RemarkKind(
    "storey_stiff",
    "{0}: {1} has {value:.3g} N/m, and half of the storeys {ordinary:.3g} N/m or less",
    "check whether one is off by a thousand",
)
_FLOORS_LIGHT: Final = RemarkKind(
    "floors_light",
    "{0}: its heaviest floor has {value:.3g} kg, and its storeys are {height:g} m high",
    "masses are in kg, stiffnesses in N/m and forces in N: check whether all are off by a thousand",
)


def _storey_remarks(building: Building) -> Iterator[Remark]:
    """Remarks on heights, drifts, strengths and passive devices, beside weight and modes."""
    heights, weight = building.drift_heights, building.total_mass * STANDARD_GRAVITY
    real, drifts = heights[heights > 0.0], building.yield_drifts[: len(building.drifts)]
    numbers = [("the height of a storey", height, (0.05, 25.0), "m") for height in (*real[:1], *real[-1:])]
    if building.drift_limit:
        numbers.append(("drift_limit", building.drift_limit, DRIFT_RATIOS, "1"))
    if drifts.any():
        first, springs = int((drifts > 0.0).argmax()), building.storey_stiffnesses
        if springs.size:
            strength = float(springs[first] * drifts[first]) / weight
            numbers.append(("the yield shear of a storey over the weight", strength, (2e-3, 100.0), ""))
        if heights.size and (heights[drifts > 0.0] > 0.0).all():
            ratio = float((drifts[drifts > 0.0] / heights[drifts > 0.0]).max())
            numbers.append(("the drift ratio at which a storey yields", ratio, (2e-4, 0.05), "1"))
        else:
            numbers.append(("the drift at which a storey yields", float(drifts.max()), (1e-5, 0.5), "m"))
    omega, modes = building._shapes(None)
    for element in building.elements:
        ratio = float((element.damping * (element.row @ modes) ** 2 / np.maximum(2.0 * omega, 1e-9)).max())
        if element.yield_force and not element.in_stiffness:
            share = element.yield_force / weight
            numbers.append((f"the force of {element.name} over the weight", share, (2e-4, 3.0), ""))
        elif element.is_linear and ratio:
            numbers.append((f"the damping ratio that {element.name} adds to a mode", ratio, (2e-4, 50.0), ""))
    for name, value, usual, unit in dict.fromkeys(numbers):
        yield from unusual_number(name, float(value), usual, unit, where=f"{building.name}: ")
    springs = building.storey_stiffnesses
    ordinary = float(np.sort(springs)[(springs.size - 1) // 2]) if springs.size else np.inf
    if springs.max(initial=0.0) > _STIFFER * ordinary:
        words = building.name, building.drift_names[int(springs.argmax())]
        yield _STOREY_STIFF.remark(*words, measured=Measured(float(springs.max()), "N/m"), ordinary=ordinary)
    heaviest = float(np.diag(building.mass).max())
    if real.size and real.min() > _HUMAN and heaviest < _LEAST_FLOOR:
        measured = Measured(heaviest, "kg")
        yield _FLOORS_LIGHT.remark(building.name, measured=measured, height=float(real.max()))


def _check_heights(building: Building, where: str) -> None:
    heights = building.heights
    if heights.shape not in ((0,), (len(building.storeys),)):
        raise SettingError(
            f"{where}: heights is {_sides(heights)} where {len(building.storeys)} entries were expected, one for each "
            "storey"
        )
    if heights.size and not (((heights >= 0.0) & (heights <= _TALLEST)).all() and heights.any()):
        wrong = next((value for value in heights.tolist() if not 0.0 <= value <= _TALLEST), 0.0)
        raise SettingError(
            f"{where}: the height of a storey is {wrong:g} m, which is beyond any storey; give heights in m, as 3.5"
        )


def _check_loads(building: Building, where: str) -> None:
    loads = building.loads
    if loads.shape not in ((0,), (len(building.storeys),)) or not (loads >= 0.0).all():
        raise SettingError(
            f"{where}: loads is {_sides(loads)} from {loads.min(initial=0.0):g}; give a weight of 0 N or more for each "
            f"of {counted(len(building.storeys), 'storey')}"
        )
    if building.drift_limit and not building.heights.size:
        raise SettingError(f"{where}: drift_limit stands on heights; give height or heights in [building]")
    if loads.any() and not (building.heights.size and (building.heights[loads > 0.0] > 0.0).all()):
        raise SettingError(
            f"{where}: P-delta stands on the heights of the storeys; give height or heights in [building]"
        )


def _check_weight(building: Building) -> None:
    """Refuse a building that falls under its weight."""
    if building.loads.any() and not is_positive(building.stiffness - building._geometric):
        softer, springs = building._softer, building.storey_stiffnesses
        storey = int(np.argmax(softer / springs if springs.shape == softer.shape else softer))
        raise SettingError(
            f"{building.name} falls under its weight: in {building.storey_names[storey]} P / h is "
            f"{softer[storey]:.4g} N/m; check masses in kg, stiffnesses in N/m and heights in m"
        )


def _check_shapes(building: Building, where: str) -> None:
    n = len(building.mass) if building.mass.ndim else 0
    if n == 0:
        raise SettingError(f"{where}: it has no coordinate; give a mass matrix of at least 1 x 1")
    for title in _ARRAYS[:3]:
        if (matrix := getattr(building, title)).shape != (n, n):
            raise SettingError(
                f"{where}: {title} is {_sides(matrix)} where {n} x {n} was expected; "
                "M, C and K have one row and one column for each coordinate"
            )
    if building.influence.shape != (n,):
        raise SettingError(
            f"{where}: influence is {_sides(building.influence)} where {n} entries were expected"
        )
    for title, rows in (("floors", building.floors), ("storeys", building.storeys)):
        if rows.ndim != 2 or rows.shape[1] != n:
            raise SettingError(
                f"{where}: {title} is {_sides(rows)}; give rows of {n} entries, one for each coordinate"
            )


def _check_symmetric(matrix: Floats, title: str, where: str) -> None:
    skew = np.abs(matrix - matrix.T)
    row, column = np.unravel_index(int(skew.argmax()), skew.shape)
    if skew[row, column] > _ASYMMETRY * np.abs(matrix).max():
        raise SettingError(
            f"{where}: {title} is not symmetric, entry {row + 1}, {column + 1} is {matrix[row, column]:g} "
            f"and entry {column + 1}, {row + 1} is {matrix[column, row]:g}; make them equal"
        )


def _check_mass(mass: Floats, where: str) -> None:
    diagonal = np.diag(mass)
    remedy = "give it a mass, or condense it out of the matrices"
    if (diagonal < 1.0 / _LARGEST).any():
        first = int(np.flatnonzero(diagonal < 1.0 / _LARGEST)[0])
        raise SettingError(
            f"{where}: the mass of coordinate {first + 1} is {diagonal[first]:g} kg, so the mass matrix is "
            f"singular or worse; {remedy}"
        )
    scale = 1.0 / np.sqrt(diagonal)
    scaled = mass * np.outer(scale, scale)
    # No eigenvalue is above the largest sum of a row.
    if is_positive(scaled, -_SINGULAR * float(np.abs(scaled).sum(axis=1).max())):
        return
    values, vectors = np.linalg.eigh(scaled)
    if values[0] <= _SINGULAR * values[-1]:
        # Largest coordinate of the motion that moves no mass.
        first = int(np.abs(vectors[:, 0]).argmax())
        kind = "singular" if abs(values[0]) <= _SINGULAR * values[-1] else "not positive definite"
        raise SettingError(
            f"{where}: the mass matrix is {kind}, a motion dominated by coordinate {first + 1} moves no mass; {remedy}"
        )


def _check_stiffness(stiffness: Floats, where: str) -> None:
    # The largest eigenvalue is not below the largest entry of the diagonal.
    if is_positive(stiffness, _ROUNDING * max(float(np.diag(stiffness).max()), 0.0)):
        return
    values, vectors = np.linalg.eigh(stiffness)
    if values[0] < -_ROUNDING * max(values[-1], 0.0) and values[0] < 0.0:
        first = int(np.abs(vectors[:, 0]).argmax())
        raise SettingError(
            f"{where}: the stiffness is unstable, a motion dominated by coordinate {first + 1} has the stiffness "
            f"{values[0]:g} N/m; check its signs"
        )


def _check_names(names: Sequence[str], n_rows: int, noun: str, where: str) -> None:
    if len(names) != n_rows:
        raise SettingError(f"{where}: {len(names)} {noun} names for {n_rows} {noun} rows; name each of them")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise SettingError(f"{where}: two {noun}s are called {twice!r}; give each a different name")


def _sides(matrix: Floats) -> str:
    return " x ".join(str(side) for side in matrix.shape) if matrix.ndim > 1 else f"{matrix.size} long"


# A command with a mean above this share of its peak is constant but for the lag of the driver.
_CONSTANT = 0.9


@checked
@array_dataclass(repr=False)
class Device(Summarised):
    """Dampers at one place that follow one command between 0 and `largest_command`.

    `theta` belongs to one damper. The force of the device in responses and laws, and the weights and slopes of a law,
    count all its dampers together.

    Parameters
    ----------
    spec, theta
        Damper model and its parameters, shape (n_params,), or one row per draw.
    row
        Elongation = row @ q, shape (n,): a row of `building.storeys`.
    largest_command
        Largest command of the driver [A or V]; a passive model, which follows no command, needs none.
    count
        Number of dampers in parallel.
    differential
        Whether as many dampers act in the opposite direction, so that constant forces cancel.
    tested
        Ranges in which one of the dampers was tested, as `Fit.tested`; `None` if unknown.
    lag
        Rate of a first-order lag of the driver [1/s], in place of the lag in `theta`, if there is one. The rate becomes
        the last parameter of `spec` and `theta`.
    command
        Command that the dampers hold [A or V], whatever a law sends; `None` where a law commands them.
    rated_force, rated_stroke, rated_command
        Force [N], stroke [m] and largest command [A or V] that one of the dampers is made for, beyond which runs are
        told; `None` if unknown.
    """

    _made_by: ClassVar[str] = "mr.Device(name=..., spec=..., theta=..., row=..., largest_command=...)"

    name: str
    spec: DamperSpec
    theta: ArrayLike
    row: ArrayLike
    largest_command: float = 0.0
    count: Positive = 1.0
    differential: bool = False
    tested: OperatingRange | None = None
    lag: Positive | None = None
    command: NotNegative | None = None
    rated_force: Positive | None = None
    rated_stroke: Positive | None = None
    rated_command: Positive | None = None

    def __post_init__(self) -> None:
        if not self.spec.follows_command:
            for name in ("lag", "command"):
                if getattr(self, name) is not None:
                    raise SettingError(f"{self.name}: a passive damper takes no command; leave `{name}` out")
            # Nothing follows it.
            object.__setattr__(self, "largest_command", self.largest_command or 1.0)
        elif self.lag is not None:
            self._take_lag(self.lag)
        keep_arrays(self, "theta", "row")
        n_params = len(self.spec.parameters)
        if self.draws.ndim != 2 or self.draws.shape[1] != n_params:
            raise SettingError(
                f"{self.name}: `theta` has shape {np.shape(self.theta)}, {self.spec.name} takes ({n_params},) or "
                f"(n_draws, {n_params})"
            )
        if not self.largest_command > 0.0:
            raise SettingError(
                f"{self.name}: the largest command is {self.largest_command}; give a positive number"
            )
        if self.command is not None and self.command > self.largest_command:
            raise SettingError(
                f"{self.name}: it is to hold {self.command:g}, and its driver gives {self.largest_command:g} at most"
            )

    def _take_lag(self, lag: float) -> None:
        """Replace the rate of the lag, or append it to model and parameters; from then on it is one of them."""
        theta = np.atleast_1d(np.array(self.theta, dtype=np.float64))
        theta = theta[..., : theta.shape[-1] - self.spec.lagged]
        object.__setattr__(self, "spec", with_changed_laws(self.spec, lagged=True))
        object.__setattr__(self, "theta", np.insert(theta, theta.shape[-1], lag, axis=-1))
        object.__setattr__(self, "lag", None)

    @property
    def is_commanded(self) -> bool:
        """Whether a law commands the dampers: they follow a command, and hold none."""
        return self.spec.follows_command and self.command is None

    @property
    def draws(self) -> Floats:
        """Parameters of each draw, shape (n_draws, n_params); one draw where `theta` is one set."""
        return np.atleast_2d(np.asarray(self.theta, dtype=np.float64))

    @checked
    def demand(
        self,
        *,
        stroke: NotNegative,
        velocity: NotNegative,
        force: NotNegative,
        energy: float,
        seconds: Positive,
        peak_command: NotNegative,
        mean_command: NotNegative,
        least_stroke: NotNegative | None = None,
    ) -> OperatingRange:
        """Demand of a run on one of the dampers, from peaks and the dissipated energy of all of them.

        The frequency belongs to a sinusoid with the peak velocity and the peak stroke. A command whose mean is within
        10 % of its peak is taken for constant, any other to start from zero, as every run does. `least_stroke` is
        defined in `OperatingRange`; `None` where the run has no history.
        """
        n_dampers = self.count * (2.0 if self.differential else 1.0)
        frequency = velocity / (2.0 * np.pi * stroke) if stroke > 0.0 else None
        command = None
        if self.command is not None:
            command = (self.command, self.command)
        elif self.spec.follows_command:
            constant = mean_command > _CONSTANT * peak_command
            command = (peak_command if constant else 0.0, peak_command)
        return OperatingRange(
            stroke=stroke,
            velocity=velocity,
            frequency=None if frequency is None else (frequency, frequency),
            command=command,
            command_unit=None if command is None else self.spec.command_unit,
            force=force / n_dampers,
            power=max(0.0, energy / n_dampers / seconds),
            least_stroke=least_stroke,
        )

    @property
    def knows_least_stroke(self) -> bool:
        """Whether the demand can be below the tested strokes, which only the history of a run shows."""
        return self.tested is not None and self.tested.least_stroke is not None

    @checked
    def outside(self, demand: OperatingRange) -> Outside:
        """Quantities of a demand outside the tested ranges and ratings; laws are at the median of the draws."""
        outside = outside_of(self.spec, np.median(self.draws, axis=0), self.tested, demand)
        rated = beyond_rating(
            demand, force=self.rated_force, stroke=self.rated_stroke, command=self.rated_command
        )
        return replace(outside, exceedances=(*rated, *outside.exceedances))

    def _summary(self) -> Summary:
        rows = [
            (parameter.name, format_rounded(float(np.median(self.draws[:, index]))), parameter.unit)
            for index, parameter in enumerate(self.spec.parameters)
        ]
        return Summary(
            title=f"Device {self.name}: {self.spec.name}",
            facts=(
                ("dampers", f"{self.count:g}{', and as many in opposition' if self.differential else ''}"),
                ("command", f"0 to {self.largest_command:g}"),
                ("draws", str(len(self.draws))),
                ("tested", self.tested.in_words if self.tested else "not known"),
            ),
            tables=[Table(columns=("parameter", "value", "unit"), rows=rows)],
        )


def elongation_rows(building: Building, devices: Sequence[Device]) -> Floats:
    """Rows that give elongations of devices from coordinates, shape (n_devices, n); refused where one does not fit."""
    n = building.check().n_coordinates
    if not devices:
        raise SettingError(f"no device was given for {building.name}; give one or more")
    for device in devices:
        if np.shape(device.row) != (n,) or not np.any(device.row):
            raise SettingError(
                f"{device.name}: `row` has shape {np.shape(device.row)}; {building.name} takes ({n},), not all zero: "
                "a row of `building.storeys`"
            )
    return np.array([device.row for device in devices], dtype=np.float64)
