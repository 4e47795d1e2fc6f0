"""Between a building and a linear system of first order, both ways."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.buildings.matrices import Building
from mrwork.buildings.matrix_files import read_matrices
from mrwork.buildings.shear import numbered
from mrwork.buildings.state_space import LinearSystem
from mrwork.errors import SettingError, UnknownNameError

Floats = NDArray[np.float64]

OUTPUTS: Final = ("displacement", "velocity", "acceleration", "drift", "drift rate")
# Of what is left against the largest entry, where an exact zero or symmetry was expected.
_ROUNDING: Final = 1e-8


def system_of(
    building: Building, *, outputs: Sequence[str] = ("displacement",), devices: Sequence[int | str] = ()
) -> LinearSystem:
    """Return a building as a linear system whose first input is the ground's acceleration.

    Parameters
    ----------
    outputs
        Among "displacement" and "velocity" of the floors relative to the ground, their absolute "acceleration", "drift"
        and "drift rate" of the storeys; each stands for all floors or storeys.
    devices
        Storeys, by number from 1 or name, across which a resisting force is a further input.

    Raises
    ------
    UnknownNameError
        Where there is no such output or storey.

    Examples
    --------
    >>> from mrwork.buildings.published import building
    >>> system = system_of(building("dyke1996"), outputs=["drift"], devices=[1])
    >>> system.input_names
    ('ground acceleration', 'force in storey 1')
    """
    n = building.n_coordinates
    rows = np.stack([building.storey_row(storey) for storey in devices]) if devices else np.zeros((0, n))
    A, B, E = building.state_matrices(rows)
    inputs = np.hstack([E[:, None], B])
    rate = np.hstack([np.zeros((n, n)), np.eye(n)])
    ground = np.append(1.0, np.zeros(len(rows)))
    C, D, names = [], [], []
    for output in outputs:
        if output not in OUTPUTS:
            raise UnknownNameError(f"a building has no output {output!r}; choose among {', '.join(OUTPUTS)}")
        of_storeys = output.startswith("drift")
        shapes = building.storeys if of_storeys else building.floors
        if output == "acceleration":
            C.append(shapes @ A[n:])
            D.append(shapes @ inputs[n:] + ground)
        else:
            C.append(shapes @ (rate if output in ("velocity", "drift rate") else np.eye(n, 2 * n)))
            D.append(np.zeros((len(shapes), inputs.shape[1])))
        names += [
            f"{output} of {name}" for name in (building.storey_names if of_storeys else building.floor_names)
        ]
    return LinearSystem(
        A=A,
        B=inputs,
        C=np.vstack([np.zeros((0, 2 * n)), *C]),
        D=np.vstack([np.zeros((0, inputs.shape[1])), *D]),
        input_names=("ground acceleration", *(f"force in {building.storey_name(each)}" for each in devices)),
        output_names=tuple(names),
    )


def building_of(
    system: LinearSystem,
    *,
    name: str,
    influence: Floats,
    floors: Floats,
    storeys: Floats,
    mass: Floats | None = None,
    floor_names: Sequence[str] = (),
    storey_names: Sequence[str] = (),
    source: str = "",
) -> Building:
    """Return a linear system as a building, where A = [0 I; -M^-1 K, -M^-1 C] lets it be one.

    A tells only products with M^-1. Where `mass` is not given, one is made of the modes phi of M^-1 K, each of length
    one: M = (phi phi')^-1, with which K is symmetric. It is the unit matrix where M^-1 K is symmetric already. The
    motion under a ground acceleration does not depend on this choice; a force does, and pulls by the row `-(M b)'`, b
    the lower half of its column of B.

    Parameters
    ----------
    influence, floors, storeys
        As in `Building`; of an input that is the ground's acceleration, the influence is minus the lower half of B.
    mass
        M [kg], shape (n / 2, n / 2).

    Raises
    ------
    SettingError
        Where A has another form, no mass makes K symmetric, or that which is given does not.
    """
    n = system.n_states // 2
    expected = np.hstack([np.zeros((n, n)), np.eye(n)])
    if system.n_states != 2 * n or n == 0 or np.abs(system.A[:n] - expected).max() > _ROUNDING:
        raise SettingError(
            f"building {name}: the upper half of A is not [0 I], so its states are no displacements and their rates; "
            "use it as a linear system"
        )
    stiffness, damping = -system.A[n:, :n], -system.A[n:, n:]
    mass = _mass_of(stiffness, name) if mass is None else np.asarray(mass, dtype=np.float64)
    if mass.shape != (n, n):
        raise SettingError(f"building {name}: the mass is not {n} x {n}, as half of A is")
    scaled = mass @ stiffness
    skew = np.abs(scaled - scaled.T).max()
    if skew > _ROUNDING * np.abs(scaled).max():
        raise SettingError(
            f"building {name}: with this mass the stiffness is not symmetric, by {skew:g} N/m; give the mass that A "
            "was made with, or use it as a linear system"
        )
    return Building(
        name=name,
        mass=mass,
        damping=mass @ damping,
        stiffness=(scaled + scaled.T) / 2.0,
        influence=influence,
        floors=floors,
        storeys=storeys,
        floor_names=tuple(floor_names) or numbered("floor", len(floors)),
        storey_names=tuple(storey_names) or numbered("storey", len(storeys)),
        source=source,
    )


def read_system(path: str | Path) -> LinearSystem:
    """Read A, B, C and, if it is there, D from a .mat file or a folder of A.csv, B.csv and so on.

    Raises
    ------
    RecordError
        The file is missing or damaged.
    SettingError
        A, B or C is not there, or their shapes disagree.
    """
    path = Path(path)
    matrices = read_matrices(path, ("A", "B", "C", "D"))
    for letter in "ABC":
        if letter not in matrices:
            found = ", ".join(matrices) or "nothing"
            raise SettingError(f"{path}: a linear system needs A, B and C; here is {found}")
    A, B, C = (matrices[letter] for letter in "ABC")
    return LinearSystem(A=A, B=B, C=C, D=matrices.get("D", np.zeros((len(C), B.shape[1]))))


def _mass_of(stiffness: Floats, name: str) -> Floats:
    """Return a mass that makes mass @ stiffness symmetric, from the modes of what is M^-1 K."""
    if np.abs(stiffness - stiffness.T).max() <= _ROUNDING * np.abs(stiffness).max():
        return np.eye(len(stiffness))
    squares, modes = np.linalg.eig(stiffness)
    if (
        np.abs(np.imag(squares)).max() > _ROUNDING * np.abs(squares).max()
        or np.linalg.cond(modes) > 1.0 / _ROUNDING
    ):
        raise SettingError(
            f"building {name}: the modes of M^-1 K are no real shapes, so no mass makes K symmetric; "
            "use it as a linear system"
        )
    inverse = np.linalg.inv(np.real(modes))
    return np.asarray(inverse.T @ inverse)
