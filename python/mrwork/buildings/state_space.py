"""Linear systems of first order: from and to buildings, to and from python-control, from files; reduction to modes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from mrwork.base.arguments import checked
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass, freeze_samples
from mrwork.buildings.frames import number_names
from mrwork.buildings.matrices import WITHOUT_MASSES, Building, Status, source_with, transform_elements
from mrwork.buildings.modes import modes_of, spaces_of
from mrwork.errors import ArgumentError, SettingError, UnknownNameError
from mrwork.files.matrices import read_matrices

if TYPE_CHECKING:
    from control import StateSpace
else:
    # python-control is loaded late, so that an argument of its class is not checked by the annotation.
    StateSpace = Any


@checked
@array_dataclass(repr=False)
class LinearSystem(Summarised):
    """Continuous-time linear system `s' = A s + B u`, `y = C s + D u`. The arrays are stored as read-only copies.

    Parameters
    ----------
    A, B, C, D
        Shapes (n, n), (n, n_inputs), (n_outputs, n), (n_outputs, n_inputs).
    input_names, output_names
        Empty where the inputs or outputs have no names.
    """

    _made_by: ClassVar[str] = "mr.buildings.system_of(building) or mr.buildings.read_system(path)"

    A: Floats
    B: Floats
    C: Floats
    D: Floats
    input_names: tuple[str, ...] = ()
    output_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for title in ("A", "B", "C", "D"):
            object.__setattr__(self, title, np.atleast_1d(freeze_samples(getattr(self, title))))
        n, n_inputs, n_outputs = len(self.A), self.B.shape[-1], len(self.C)
        shapes = {"A": (n, n), "B": (n, n_inputs), "C": (n_outputs, n), "D": (n_outputs, n_inputs)}
        for title, expected in shapes.items():
            if (shape := getattr(self, title).shape) != expected:
                raise SettingError(f"linear system: {title} has shape {shape}; give {expected}")
        for field, noun, count in (("input_names", "input", n_inputs), ("output_names", "output", n_outputs)):
            names = getattr(self, field)
            if names and len(names) != count:
                raise SettingError(
                    f"linear system: {len(names)} {noun} names for {count} {noun}s; name each of them"
                )

    @property
    def n_states(self) -> int:
        """Number of states: the size of the square matrix A."""
        return len(self.A)

    def to_control(self) -> StateSpace:
        """Convert to a StateSpace of python-control.

        Raises
        ------
        SettingError
            If python-control is not installed.
        """
        try:
            from control import StateSpace
        except ImportError as error:
            raise SettingError(
                "exchanging systems with python-control needs it; run: pip install 'mrwork[control]'"
            ) from error
        # python-control reserves the point in signal names.
        inputs, outputs = (
            [name.replace(".", ",") for name in names] or None
            for names in (self.input_names, self.output_names)
        )
        return StateSpace(self.A, self.B, self.C, self.D, inputs=inputs, outputs=outputs)


@checked
def from_control(system: StateSpace) -> LinearSystem:
    """Convert a StateSpace of python-control to a linear system."""
    if not all(hasattr(system, name) for name in ("A", "B", "C", "D", "dt", "input_labels", "output_labels")):
        raise ArgumentError(
            f"`system` of from_control is a {type(system).__name__}; give a StateSpace of python-control"
        )
    # A step of None, common in old models, leaves the time base open and is accepted.
    if system.dt not in (None, 0):
        raise SettingError(
            f"the system runs in discrete time with a step of {system.dt} s; give one in continuous time"
        )
    return LinearSystem(
        A=system.A,
        B=system.B,
        C=system.C,
        D=system.D,
        input_names=tuple(system.input_labels),
        output_names=tuple(system.output_labels),
    )


OUTPUTS: Final[Mapping[str, tuple[Literal["floor", "storey"], Literal[0, 1, 2]]]] = {
    "displacement": ("floor", 0),
    "velocity": ("floor", 1),
    "acceleration": ("floor", 2),
    "drift": ("storey", 0),
    "drift rate": ("storey", 1),
}
"""What each output of a building is of, and its order of differentiation."""
# Tolerance relative to the largest entry where an exact zero or symmetry is expected.
_ROUNDING: Final = 1e-8


@checked
def system_of(
    building: Building, *, outputs: Sequence[str] = ("displacement",), devices: Sequence[int | str] = ()
) -> LinearSystem:
    """Return a building as a linear system whose first input is the ground acceleration.

    Parameters
    ----------
    outputs
        Any of "displacement" and "velocity" (of the floors, relative to the ground), "acceleration" (absolute, of the
        floors), "drift" and "drift rate" (of the storeys); each gives one output per floor or storey.
    devices
        Storeys, by number from 1 or by name; the resisting force across each is a further input.

    Raises
    ------
    SettingError
        If the building has passive elements, which no linear system has.

    Examples
    --------
    >>> from mrwork.buildings.frames import building
    >>> system = system_of(building("dyke1996"), outputs=["drift"], devices=[1])
    >>> system.input_names
    ('ground acceleration', 'force in storey 1')
    """
    if building.nonlinear:
        raise SettingError(
            f"{building.name} has {building.nonlinear}, which is not in its matrices; give the building without it, as "
            "dataclasses.replace(building, elements=(), loads=np.empty(0)), for the system of its matrices alone"
        )
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
        of, order = OUTPUTS[output]
        shapes, names_of = (
            (building.storeys, building.storey_names)
            if of == "storey"
            else (building.floors, building.floor_names)
        )
        if order == 2:
            C.append(shapes @ A[n:])
            D.append(shapes @ inputs[n:] + ground)
        else:
            C.append(shapes @ (rate if order == 1 else np.eye(n, 2 * n)))
            D.append(np.zeros((len(shapes), inputs.shape[1])))
        names += [f"{output} of {name}" for name in names_of]
    return LinearSystem(
        A=A,
        B=inputs,
        C=np.vstack([np.zeros((0, 2 * n)), *C]),
        D=np.vstack([np.zeros((0, inputs.shape[1])), *D]),
        input_names=(
            "ground acceleration",
            *(f"force in {building.storey_name(storey)}" for storey in devices),
        ),
        output_names=tuple(names),
    )


@checked
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
    """Return a linear system with A = [0 I; -M^-1 K, -M^-1 C], perhaps in another order of its states, as a building.

    The coordinates have the order of the displacements among the states. A contains M only in products with M^-1.
    Without `mass`, M = (phi phi')^-1 is used, where phi are the modes of M^-1 K with unit length; it makes K symmetric,
    and is the unit matrix if M^-1 K is symmetric already. The response to a ground acceleration does not depend on this
    choice. The effect of a force does: its row is `-(M b)'`, where b is the lower half of its column of B. The building
    then has the status that its masses are not known.

    Parameters
    ----------
    influence, floors, storeys
        As in `Building`; the influence is minus the lower half of the column of B for the ground acceleration.
    mass
        M [kg], shape (n / 2, n / 2).

    Raises
    ------
    SettingError
        If A has another form, or no mass makes K symmetric, or the given one does not.
    """
    order, n = order_of_states(system.A, name), system.n_states // 2
    ordered = system.A[np.ix_(order, order)]
    stiffness, damping = -ordered[n:, :n], -ordered[n:, n:]
    status: Status = WITHOUT_MASSES if mass is None else "ours"
    if mass is None:
        is_symmetric = np.abs(stiffness - stiffness.T).max() <= _ROUNDING * np.abs(stiffness).max()
        inverse = np.eye(n) if is_symmetric else np.linalg.inv(_real_modes(stiffness, name)[0])
        mass = inverse.T @ inverse
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
        floor_names=tuple(floor_names) or number_names("floor", len(floors)),
        storey_names=tuple(storey_names) or number_names("storey", len(storeys)),
        source=source,
        status=status,
    )


def order_of_states(A: Floats, name: str) -> NDArray[np.intp]:
    """States in the order [q; q'], shape (n,): the row of a displacement in A is 1 at its rate and 0 elsewhere.

    Raises
    ------
    SettingError
        If the states are no displacements and their rates.
    """
    rates = np.abs(A).argmax(axis=1) if A.size else np.empty(0, dtype=np.intp)
    displacements = np.flatnonzero(np.abs(A - np.eye(len(A))[rates]).max(axis=1, initial=0.0) <= _ROUNDING)
    order = np.concatenate([displacements, rates[displacements]])
    if not len(A) or len(order) != len(A) or len(np.unique(order)) < len(A):
        raise SettingError(
            f"building {name}: {len(displacements)} of the {len(A)} rows of A are 1 at one state and 0 elsewhere, and "
            "in A = [0 I; -M^-1 K, -M^-1 C], whatever the order of its states, half of them are, each at a rate of its "
            "own; give states that are displacements [m] and their rates [m/s], or use it as a linear system"
        )
    return order


def mass_of_forces(system: LinearSystem, columns: Sequence[int], rows: Floats, name: str) -> Floats:
    """M [kg], shape (n / 2, n / 2), from columns b of B of forces that stretch `rows`, (n_columns, n / 2): -M b = row'.

    With the modes phi of M^-1 K, `M = phi^-T diag(d) phi^-1`, and d follows from the forces in each mode, which resist
    or push.

    Raises
    ------
    SettingError
        If no force moves some mode, or no mass agrees with the forces.
    """
    order, n = order_of_states(system.A, name), system.n_states // 2
    modes, spaces = _real_modes(-system.A[np.ix_(order[n:], order[:n])], name)
    inverse = np.linalg.inv(modes)
    moved, stretched = inverse @ system.B[order[n:]][:, list(columns)], modes.T @ rows.T
    # Shapes of unit length: what moves is in 1/kg.
    least = _ROUNDING * np.linalg.norm(moved)
    n_moved = sum(int(np.linalg.matrix_rank(moved[space], tol=least)) for space in spaces)
    if n_moved < n:
        raise SettingError(
            f"building {name}: the forces of these columns of B move {n_moved} of {n} modes, so they do not say "
            "the masses; give M, or the columns of forces in other storeys too"
        )
    # Shapes of modes of one frequency need not be orthogonal: their masses are a matrix.
    pushing = scipy.linalg.block_diag(*(-stretched[space] @ np.linalg.pinv(moved[space]) for space in spaces))
    side = np.sign(np.trace(pushing))
    weights = side * (pushing + pushing.T) / 2.0
    far = np.abs(weights @ moved + side * stretched).max() > 1e-6 * np.abs(stretched).max()
    if far or np.linalg.eigvalsh(weights)[0] <= 0.0:
        raise SettingError(
            f"building {name}: no masses give these columns of B for forces in these storeys; name the storeys in the "
            "order of the columns, or give M"
        )
    return np.asarray(inverse.T @ weights @ inverse)


@checked
def read_system(path: str | Path) -> LinearSystem:
    """Read A, B, C and optionally D from a .mat file or a folder of A.csv, B.csv and so on.

    Raises
    ------
    RecordError
        The file is missing or damaged.
    SettingError
        A, B or C is missing, or their shapes disagree.
    """
    path = Path(path)
    matrices = read_matrices(path, ("A", "B", "C", "D"))
    for letter in "ABC":
        if letter not in matrices:
            given_names = ", ".join(matrices) or "nothing"
            raise SettingError(f"{path}: a linear system needs A, B and C; found {given_names}")
    A, B, C = (matrices[letter] for letter in "ABC")
    return LinearSystem(A=A, B=B, C=C, D=matrices.get("D", np.zeros((len(C), B.shape[1]))))


def _real_modes(stiffness: Floats, name: str) -> tuple[Floats, list[slice]]:
    """Modes of M^-1 K as columns of unit length, and the ranges of modes of one frequency."""
    squares, modes = np.linalg.eig(stiffness)
    order = np.argsort(squares.real)
    largest, shapes, spaces = np.abs(squares).max(), modes[:, order].real, spaces_of(squares[order].real)
    for space in spaces:
        if space.stop - space.start > 1:
            square = float(squares[order[space]].real.mean())
            *_, rows = np.linalg.svd(stiffness - square * np.eye(len(stiffness)))
            shapes[:, space] = rows[space.start - space.stop :].T
    if np.abs(squares.imag).max() > _ROUNDING * largest or np.linalg.cond(shapes) > 1.0 / _ROUNDING:
        raise SettingError(
            f"building {name}: the modes of M^-1 K are no real shapes, so no mass makes K symmetric; "
            "use it as a linear system"
        )
    return np.asarray(shapes), spaces


@checked
def modal_truncation(building: Building, *, n_modes: int) -> Building:
    """Return the building in the coordinates of its lowest modes.

    With `q = modes y` over the modes kept and modes' M modes = I, the mass is I, the stiffness omega^2, the damping
    modes' C modes including the coupling between modes, and the influence `modes' M r`. Floors and storeys remain the
    same; the contribution of the truncated modes is lost, including its static part.
    """
    if not 1 <= n_modes <= building.n_coordinates:
        raise SettingError(
            f"building {building.name}: {n_modes} modes are to be kept; give a number from 1 "
            f"to {building.n_coordinates}"
        )
    omega, modes = modes_of(building.mass, building.stiffness)
    cut = next(space for space in spaces_of(omega**2) if n_modes <= space.stop)
    if n_modes < cut.stop:
        raise SettingError(
            f"building {building.name}: modes {cut.start + 1} to {cut.stop} have one frequency, "
            f"{omega[cut.start] / (2.0 * np.pi):.4g} Hz, and {n_modes} modes would keep an arbitrary part of their "
            f"motion; keep {' or '.join(str(count) for count in (cut.start, cut.stop) if count)} modes"
        )
    basis = modes[:, :n_modes]
    return replace(
        building,
        name=f"{building.name}, {n_modes} modes",
        mass=np.eye(n_modes),
        damping=basis.T @ building.damping @ basis,
        stiffness=np.diag(omega[:n_modes] ** 2),
        influence=basis.T @ building.mass @ building.influence,
        floors=building.floors @ basis,
        storeys=building.storeys @ basis,
        elements=transform_elements(building.elements, basis),
        source=source_with(building, f"reduced to {n_modes} modes"),
        status="ours",
    )
