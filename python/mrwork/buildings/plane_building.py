"""Plane building model: a structure that is checked, with its modes and what is said of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import groupby
from typing import ClassVar, Final

import numpy as np
import scipy
from numpy.typing import NDArray

from mrwork.base.arguments import checked
from mrwork.base.numbers import counted, format_rounded
from mrwork.base.plotted import Plotted
from mrwork.base.remark import Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary, named
from mrwork.base.table import Column, Table
from mrwork.base.values import Floats, array_dataclass, freeze_samples
from mrwork.buildings.building_checks import ARRAYS, check_form, check_motion, check_size
from mrwork.buildings.building_remarks import MOST_QUESTIONED, asked_of
from mrwork.buildings.modes import Modes, damping_remarks, modes_of, settle_shapes
from mrwork.buildings.structure import BY_COORDINATE, Structure, floors_upward
from mrwork.errors import SettingError, UnknownNameError

# Modes that the summary shows, and floors that a notebook draws.
_SHOWN_MODES, _MOST_DRAWN = 10, 100
_DEFAULTS: Mapping[str, Callable[[Structure], Floats]] = {
    "damping": lambda building: np.zeros_like(building.mass),
    "influence": lambda building: np.ones(len(building.mass)),
    "floors": lambda building: np.eye(len(building.mass)),
    "storeys": lambda building: np.diff(building.floors, axis=0, prepend=0.0),
}
"""Arrays of a building whose coordinates are displacements of its floors, one above the other."""
_ORDERED: Final = RemarkKind(
    "floors_ordered",
    "{0}: by its stiffness coordinate {lowest} stands on the ground and coordinate {highest} is the top, so floors are "
    "taken from the ground up: {1}",
)


def source_with(building: Building, change: str) -> str:
    """Source of a changed building: that of the original and, behind a semicolon, the change."""
    return f"{building.source}; {change}".removeprefix("; ")


@checked
@array_dataclass(repr=False)
class Building(Structure, Plotted, Summarised):
    """Plane building `M q'' + C q' + K q = -sum_d e_d' f_d - M r a_g`, with q relative to the ground.

    Passive elements, if it has any, add the part of their force that M, C and K do not have, as a device does.

    The arrays are stored as read-only copies. Whether mass, stiffness and damping can belong to a building is checked
    once, by `check`, where modes, a law or a simulation first need it.

    Parameters
    ----------
    mass, damping, stiffness
        M [kg], C [N s/m], K [N/m], shape (n, n); without C no damping.
    influence
        r, the coordinates under a unit rigid-body displacement of the ground, shape (n,); ones by default.
    floors
        Displacement of each floor relative to the ground = floors @ q, shape (n_floors, n), lowest first; its
        absolute acceleration = floors @ q'' + a_g. By default each coordinate is a floor.
    storeys
        Drift of each storey = storeys @ q, shape (n_storeys, n), lowest first. A device across a storey is
        elongated by the drift, and acts on the coordinates with minus its row times the force. By default the
        differences of the floors.
    floor_names, storey_names
        Their names in reports; "floor 1", "storey 1" and so on by default.
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
    isolators
        Names of storeys that are isolators, as those of height 0 are: strokes and no drifts, whatever carries them.
    condensed, condensing
        Numbers of the coordinates that `static_condensation` has condensed, and its remarks.
    ordering
        Remark that floors without rows were taken from the ground up, as the stiffness has them, in another order than
        the coordinates. Names go with their coordinates then.

    Raises
    ------
    SettingError
        If it has more than 3000 coordinates, shapes disagree, a number is above 1e50, or M or K is not symmetric.
    """

    _made_by: ClassVar[str] = "mr.building(name) or mr.buildings.read_building(path)"

    def __post_init__(self) -> None:
        n = len(self.mass) if self.mass.ndim else 0
        check_size(n, self.name)
        is_ordered = (
            n and self.floors.shape == (0,) and (self.influence == 1.0).all() and self._order_floors()
        )
        for name in (*ARRAYS, "heights", "loads"):
            given = getattr(self, name)
            is_default = n and given.shape == (0,) and name in _DEFAULTS
            object.__setattr__(self, name, freeze_samples(_DEFAULTS[name](self) if is_default else given))
        if is_ordered:
            for name, values in self.from_coordinates(named(self, *BY_COORDINATE)).items():
                object.__setattr__(self, name, values)
        for noun, rows in (("floor", self.floors), ("storey", self.storeys)):
            if not getattr(self, f"{noun}_names"):
                names = tuple(f"{noun} {number + 1}" for number in range(len(rows) if rows.ndim else 0))
                object.__setattr__(self, f"{noun}_names", names)
        check_form(self)

    def _order_floors(self) -> bool:
        """Take coordinates for floors from the ground up; whether the stiffness has them in another order."""
        order = floors_upward(self.mass, self.stiffness)
        is_other = bool((np.diff(order) <= 0).any())
        if is_other:
            lowest, highest = int(order[0]) + 1, int(order[-1]) + 1
            object.__setattr__(self, "floors", np.eye(len(order))[order])
            upward = [f"coordinate {place + 1}" for place in order]
            said = _ORDERED.remark(self.name, ", ".join(upward), lowest=lowest, highest=highest)
            object.__setattr__(self, "ordering", (said,))
        return is_other

    def check(self) -> Building:
        """The building itself, which keeps that it was checked.

        Raises
        ------
        SettingError
            If M is singular, K unstable, weights exceed the stiffness of a storey, or C makes a mode grow.
        """
        if not self._is_sound:
            check_motion(self)
            object.__setattr__(self, "_is_sound", True)
        return self

    def _repr_html_(self) -> str:
        """The summary, and of a chain of floors the drawing."""
        is_drawn = len(self.storey_stiffnesses) == self.n_coordinates <= _MOST_DRAWN
        return f"{self._summary().html()}{self.plot._repr_html_() if is_drawn else ''}"

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
    def modes(self) -> Floats:
        """Mode shapes as columns, shape (n, n), scaled so that modes' M modes = I.

        Of modes of one frequency, as of equal towers, they are those that damping does not couple.
        """
        return self._modal().shapes

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

    @property
    def damping_ratios(self) -> Floats:
        """Ratio of damping to critical damping of each mode, shape (n,), without the coupling between modes.

        Exact for classical damping (Rayleigh, modal). Otherwise, as with a damper at one storey, the poles give the
        actual decay.
        """
        # Infinite or NaN for a mode without stiffness.
        return self._modal().damping_ratios

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
        """Of ordered floors, condensed coordinates, damping, and questions on modes, coordinates and strength."""
        asks = len(self.mass) <= MOST_QUESTIONED and self.follows_ground
        asked = asked_of(self, self._modal()) if asks else ()
        return (*self.ordering, *self.condensing, *self.damping_remarks, *asked)

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

    def _modal(self, most: int | None = None) -> Modes:
        omega, shapes = modes_of(self.check().mass, self.stiffness, most)
        moved = self.mass @ self.influence
        shapes = settle_shapes(omega, shapes, self.damping, moved)
        driven = shapes.T @ moved
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = np.einsum("im,im->m", shapes, self.damping @ shapes) / (2.0 * omega)
        return Modes(
            omega=omega,
            shapes=shapes,
            damping_ratios=ratios,
            participation=driven * (self.floors[-1] @ shapes),
            effective_masses=driven**2,
        )

    def _summary(self) -> Summary:
        modal = self._modal(_SHOWN_MODES)
        masses = modal.effective_masses / (self.total_mass or 1.0)
        columns = (
            Column("", "mode", of=lambda mode: str(mode + 1)),
            Column("", "period", "s", of=modal.periods.item),
            Column("", "frequency", "Hz", of=(modal.omega / (2.0 * np.pi)).item),
            Column("", "damping", "%", of=(100.0 * modal.damping_ratios).item),
            Column("", "participation", of=modal.participation.item),
            Column("", "mass", "%", of=(100.0 * masses).item),
            Column("", "sum", "%", of=(100.0 * np.cumsum(masses)).item),
        )
        return Summary(
            title=f"Building {self.name}: {counted(len(self.floors), 'floor')}, {self.total_mass:.5g} kg",
            facts=(
                ("masses", _listed(np.diag(self.mass), "kg") if len(self.storey_stiffnesses) else ""),
                ("stiffnesses", _listed(self.storey_stiffnesses, "N/m")),
                ("heights", _listed(self.of_drifts(self.heights), "m")),
                ("yield at", _listed(1e3 * self.of_drifts(self.yield_drifts), "mm of drift")),
                ("P-delta", _listed(self.of_drifts(self.loads), "N") if self.loads.any() else ""),
                ("passive", ", ".join(element.name for element in self.added)),
                ("source", f"{self.source} ({self.status})" if self.source else self.status),
            ),
            tables=[Table.of(columns, range(len(masses)))],
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


def _index(key: int | str, names: tuple[str, ...], refusal: str) -> int:
    """Index of a row given by name or by number from 1."""
    if isinstance(key, str) and key in names:
        return names.index(key)
    if isinstance(key, int) and not isinstance(key, bool) and 1 <= key <= len(names):
        return key - 1
    raise UnknownNameError(
        f"{refusal} {key!r}; give a number from 1 to {len(names)} or one of {', '.join(names)}"
    )
