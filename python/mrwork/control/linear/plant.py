"""The plant of a controller: a building with devices as a linear system in s = [q; q'], and its outputs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mrwork.base.arguments import checked
from mrwork.base.summary import Summarised, list_names
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.plane_building import Building
from mrwork.errors import SettingError, UnknownNameError


@array_dataclass(repr=False)
class Plant(Summarised):
    """`s' = A s + B f + E a_g` with s = [q; q'] and f the resisting force of each device.

    From `M q'' + C q' + K q = -e' f - M r a_g` follows `B = [0; -M^-1 e']`, `E = [0; -r]`: a positive force resists
    elongation, and the device takes energy out of the building if `f e q' > 0`. `attachment` is e: the elongation of
    each device is e @ q, shape (n_devices, n).

    s' energy s is twice the energy of the building [J], from the symmetric parts of K and M. `scaling` is T of s = T z
    such that z'z is this energy; if the stiffness is not positive definite, T balances A. Riccati and Lyapunov
    equations are solved in z.
    """

    _made_by: ClassVar[str] = "mr.control.plant_of(building, rows)"

    building: Building
    A: Floats
    B: Floats
    E: Floats
    attachment: Floats
    device_names: tuple[str, ...]
    scaling: Floats
    energy: Floats

    @property
    def n_coordinates(self) -> int:
        """Number of coordinates q of the building; the state has twice as many."""
        return int(self.attachment.shape[1])

    @property
    def n_devices(self) -> int:
        """Number of devices, each with one force."""
        return int(self.attachment.shape[0])


@checked
def plant_of(building: Building, attachment: ArrayLike, device_names: Sequence[str] = ()) -> Plant:
    """The linear system of a building with devices.

    Parameters
    ----------
    attachment
        e, elongation of each device = e @ q, shape (n_devices, n); a row of `building.storeys` for a device across
        a storey.
    device_names
        Names of the devices in reports; "device 1", "device 2" by default.

    Raises
    ------
    SettingError
        If the attachment does not fit the building, or the names do not fit the devices.

    Examples
    --------
    >>> from mrwork.control.linear.plant import plant_of
    >>> plant = plant_of(building, building.storeys[:1])  # doctest: +SKIP
    """
    n = building.check().n_coordinates
    rows = np.atleast_2d(np.asarray(attachment, dtype=np.float64))
    if rows.ndim != 2 or rows.shape[0] == 0 or rows.shape[1] != n:
        raise SettingError(
            f"`attachment` has shape {rows.shape}, {building.name} takes (n_devices, {n}): "
            f"one row for each device, its displacement per unit of each coordinate"
        )
    if not np.any(rows, axis=1).all():
        raise SettingError("a row of `attachment` is zero; each device must be elongated by some coordinate")
    names = tuple(device_names) or tuple(f"device {number + 1}" for number in range(len(rows)))
    if len(names) != len(rows) or len(set(names)) < len(names):
        counts = Counter(names).items()
        several = list_names([name if count == 1 else f"{name} ({count} times)" for name, count in counts])
        raise SettingError(
            f"{len(rows)} devices have the names {several}; give each device a name of its own"
        )
    A, B, E = building.state_matrices(rows)
    energy = scipy.linalg.block_diag(symmetric_part(building.stiffness), symmetric_part(building.mass))
    return Plant(
        building=building,
        A=A,
        B=B,
        E=E,
        attachment=rows,
        device_names=names,
        scaling=_scaling(A, energy),
        energy=energy,
    )


def symmetric_part(matrix: Floats) -> Floats:
    """Symmetric part (A + A') / 2 of a matrix, without what rounding has made unequal."""
    return np.asarray(0.5 * (matrix + matrix.T), dtype=np.float64)


def hold_input(A: Floats, B: Floats, duration: float) -> tuple[Floats, Floats]:
    """Transition over a duration, and the effect of an input that is held, by the exponential of [A B; 0 0]."""
    n, m = B.shape
    both = scipy.linalg.expm(duration * np.block([[A, B], [np.zeros((m, n + m))]]))
    return both[:n, :n], both[:n, n:]


def _scaling(A: Floats, energy: Floats) -> Floats:
    """T of s = T z, with T' energy T = 1 if the energy is positive definite."""
    try:
        lower = np.linalg.cholesky(energy)
    except np.linalg.LinAlgError:
        # A building with a mode of no stiffness has no energy norm; A is balanced instead.
        _, (diagonal, _) = scipy.linalg.matrix_balance(A, permute=False, separate=True)
        return np.diag(np.asarray(diagonal, dtype=np.float64))
    return np.asarray(np.linalg.inv(lower.T), dtype=np.float64)


@checked
@array_dataclass(repr=False)
class Outputs(Summarised):
    """`y = C s + D f + G a_g`: names and rows, shapes (n_outputs, 2n), (n_outputs, n_devices), (n_outputs,).

    G is zero except for accelerations of a reduced building, whose floors do not follow the ground exactly.
    """

    _made_by: ClassVar[str] = "mr.control.drifts(plant) and its neighbours"

    names: tuple[str, ...]
    C: Floats
    D: Floats
    G: Floats

    def __post_init__(self) -> None:
        n = len(self.names)
        if len(set(self.names)) < n:
            raise SettingError("two outputs have one name; give each output once")
        if (
            self.C.ndim != 2
            or self.D.ndim != 2
            or {(n,)} != {self.C.shape[:1], self.D.shape[:1], self.G.shape}
        ):
            raise SettingError(
                f"{n} outputs have C, D and G of shapes {self.C.shape}, {self.D.shape} and {self.G.shape}; give "
                f"({n}, 2n), ({n}, n_devices) and ({n},)"
            )

    def select(self, names: Sequence[str]) -> Outputs:
        """The named outputs, in the order of the names."""
        for name in names:
            if name not in self.names:
                raise UnknownNameError(f"no output is called {name!r}; choose from {', '.join(self.names)}")
        rows = [self.names.index(name) for name in names]
        return Outputs(names=tuple(names), C=self.C[rows], D=self.D[rows], G=self.G[rows])


def stack_outputs(*parts: Outputs) -> Outputs:
    """Concatenate groups of outputs."""
    if not parts:
        raise SettingError("no outputs were given; give one group or more")
    shapes = {(part.C.shape[1], part.D.shape[1]) for part in parts}
    if len(shapes) > 1:
        raise SettingError(
            "the outputs are of plants with other numbers of states or devices; give outputs of one plant"
        )
    return Outputs(
        names=tuple(name for part in parts for name in part.names),
        C=np.vstack([part.C for part in parts]),
        D=np.vstack([part.D for part in parts]),
        G=np.concatenate([part.G for part in parts]),
    )


def check_outputs(plant: Plant, outputs: Outputs) -> None:
    """Refuse outputs of another plant."""
    n, m = 2 * plant.n_coordinates, plant.n_devices
    if outputs.C.shape[1:] != (n,) or outputs.D.shape[1:] != (m,):
        raise SettingError(
            f"the outputs are over {outputs.C.shape[1]} states and {outputs.D.shape[1]} devices, the plant of "
            f"{plant.building.name} has {n} and {m}; give outputs of this plant"
        )


@checked
def drifts(plant: Plant) -> Outputs:
    """Drift of each storey [m]: "drift NAME"."""
    return _of_state(plant, "drift", plant.building.storeys, plant.building.storey_names)


@checked
def displacements(plant: Plant) -> Outputs:
    """Displacement of each floor relative to the ground [m]: "displacement NAME"."""
    return _of_state(plant, "displacement", plant.building.floors, plant.building.floor_names)


@checked
def velocities(plant: Plant) -> Outputs:
    """Velocity of each floor relative to the ground [m/s]: "velocity NAME"."""
    return _of_state(plant, "velocity", plant.building.floors, plant.building.floor_names, rates=True)


@checked
def relative_velocities(plant: Plant) -> Outputs:
    """Rate of the drift of each storey [m/s]: "relative velocity NAME"."""
    building = plant.building
    return _of_state(plant, "relative velocity", building.storeys, building.storey_names, rates=True)


@checked
def accelerations(plant: Plant) -> Outputs:
    """Absolute acceleration of each floor [m/s^2]: "acceleration NAME".

    `floors q'' + a_g`, so `C = floors [-M^-1 K, -M^-1 C]`; device forces enter directly: `D = -floors M^-1 e'`.
    """
    n = plant.n_coordinates
    floors = plant.building.floors
    direct = 1.0 + floors @ plant.E[n:]
    return Outputs(
        names=tuple(f"acceleration {name}" for name in plant.building.floor_names),
        C=floors @ plant.A[n:],
        D=floors @ plant.B[n:],
        # Rounding errors of a floor that follows the ground exactly become zero.
        G=np.where(np.abs(direct) < 1e-12, 0.0, direct),
    )


@checked
def deformations(plant: Plant) -> Outputs:
    """Elongation of each device [m]: "deformation NAME"."""
    return _of_state(plant, "deformation", plant.attachment, plant.device_names)


def deformation_rates(plant: Plant) -> Outputs:
    """Rate of elongation of each device [m/s]: "rate NAME"."""
    return _of_state(plant, "rate", plant.attachment, plant.device_names, rates=True)


def _of_state(
    plant: Plant, quantity: str, rows: Floats, places: Sequence[str], *, rates: bool = False
) -> Outputs:
    """Outputs of the displacements of a plant, or of their rates, without a direct term."""
    none = np.zeros_like(rows)
    return Outputs(
        names=tuple(f"{quantity} {location}" for location in places),
        C=np.hstack([none, rows] if rates else [rows, none]),
        D=np.zeros((len(rows), plant.n_devices)),
        G=np.zeros(len(rows)),
    )
