"""A building in the plane: matrices of its coordinates, and how floors and storeys follow from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.buildings.checks import check_building
from mrwork.buildings.modal import damping_ratios_of, modes_of
from mrwork.errors import UnknownNameError
from mrwork.summary import Summarised, Summary, rounded

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Building(Summarised):
    """`M q'' + C q' + K q = -sum_d e_d' f_d - M r a_g`, with q relative to the ground.

    The arrays are kept as read-only copies.

    Parameters
    ----------
    mass, damping, stiffness
        M [kg], C [N s/m], K [N/m], shape (n, n).
    influence
        r, how the coordinates follow the ground when all moves as one, shape (n,): ones for floor displacements.
    floors
        Displacement of each floor relative to the ground = floors @ q, shape (n_floors, n), lowest first; its
        absolute acceleration = floors @ q'' + a_g.
    storeys
        Drift of each storey = storeys @ q, shape (n_storeys, n), lowest first. A device across a storey is
        elongated by its drift, and pulls the coordinates back by its row times the force.
    floor_names, storey_names
        What reports call them.
    source, status
        Where the numbers come from: "verified", "published" or "ours".
    n_strokes
        How many of the last rows of `storeys` are strokes of what was put in (a tuned mass, a damper behind its
        brace). They are no drifts, and criteria of drift leave them out.

    Raises
    ------
    SettingError
        Where shapes disagree, a number is not finite, M or K is not symmetric, M is singular or K unstable.
    """

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
    status: str = "ours"
    n_strokes: int = 0

    def __post_init__(self) -> None:
        for field in ("mass", "damping", "stiffness", "influence", "floors", "storeys"):
            kept = np.array(getattr(self, field), dtype=np.float64, order="C")
            kept.setflags(write=False)
            object.__setattr__(self, field, kept)
        check_building(self)

    @property
    def n_coordinates(self) -> int:
        """How many coordinates q has."""
        return len(self.mass)

    @property
    def drifts(self) -> Floats:
        """Those rows of `storeys` that are drifts between floors, shape (n_storeys - n_strokes, n)."""
        return self.storeys[: len(self.storeys) - self.n_strokes]

    @property
    def total_mass(self) -> float:
        """What the ground feels when all moves as one: r' M r [kg]."""
        return float(self.influence @ self.mass @ self.influence)

    @property
    def frequencies(self) -> Floats:
        """Undamped natural frequencies [Hz], shape (n,), lowest first."""
        return modes_of(self.mass, self.stiffness)[0] / (2.0 * np.pi)

    @property
    def modes(self) -> Floats:
        """Mode shapes as columns, shape (n, n), scaled so that modes' M modes = I."""
        return modes_of(self.mass, self.stiffness)[1]

    @property
    def damping_ratios(self) -> Floats:
        """Damping of each mode over its critical damping, shape (n,); what couples modes is left out.

        Exact where damping is classical (Rayleigh, modal). Elsewhere, as with a damper at one storey, the poles
        tell how a motion really decays.
        """
        return damping_ratios_of(self.mass, self.damping, self.stiffness)

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of the state matrix [rad/s], shape (2 n,), by magnitude."""
        poles = np.linalg.eigvals(self.state_matrices()[0]).astype(np.complex128)
        return poles[np.lexsort((poles.imag, np.abs(poles).round(9)))]

    def state_matrices(self, rows: Floats | None = None) -> tuple[Floats, Floats, Floats]:
        """A, B, E of `s' = A s + B f + E a_g`, with s = [q; q'].

        Parameters
        ----------
        rows
            Attachment of each device, shape (n_devices, n): its elongation = row @ q. By default one device across
            each storey.

        Returns
        -------
        A, B, E
            Shapes (2 n, 2 n), (2 n, n_devices), (2 n,). B carries the sign of a force that resists.
        """
        n = self.n_coordinates
        rows = self.storeys if rows is None else np.asarray(rows, dtype=np.float64)
        solved = np.linalg.solve(self.mass, np.hstack([-self.stiffness, -self.damping, -rows.T]))
        A = np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), solved[:, : 2 * n]])
        B = np.vstack([np.zeros((n, len(rows))), solved[:, 2 * n :]])
        E = np.concatenate([np.zeros(n), -self.influence])
        return A, B, E

    def storey_row(self, storey: int | str) -> Floats:
        """Row of a storey, shape (n,), by its number from 1 or by its name.

        Raises
        ------
        UnknownNameError
            Where no storey has that number or name.
        """
        row: Floats = self.storeys[_place(storey, self.storey_names, f"{self.name}: there is no storey")]
        return row

    def floor_row(self, floor: int | str) -> Floats:
        """Row of a floor, shape (n,), by its number from 1 or by its name.

        Raises
        ------
        UnknownNameError
            Where no floor has that number or name.
        """
        row: Floats = self.floors[_place(floor, self.floor_names, f"{self.name}: there is no floor")]
        return row

    def storey_name(self, storey: int | str) -> str:
        """Name of a storey, by its number from 1 or by its name."""
        return self.storey_names[_place(storey, self.storey_names, f"{self.name}: there is no storey")]

    def _summary(self) -> Summary:
        frequencies = self.frequencies
        return Summary(
            title=f"Building {self.name}: {len(self.floors)} floors, {self.total_mass:.5g} kg",
            facts=(
                ("frequencies", f"{', '.join(rounded(float(each)) for each in frequencies[:6])} Hz"),
                ("source", f"{self.source} ({self.status})" if self.source else self.status),
            ),
        )


def _place(wanted: int | str, names: tuple[str, ...], refusal: str) -> int:
    """Index of a name, or of a number from 1."""
    if isinstance(wanted, str) and wanted in names:
        return names.index(wanted)
    if isinstance(wanted, int) and not isinstance(wanted, bool) and 1 <= wanted <= len(names):
        return wanted - 1
    raise UnknownNameError(
        f"{refusal} {wanted!r}; give a number from 1 to {len(names)} or one of {', '.join(names)}"
    )
