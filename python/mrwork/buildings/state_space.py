"""Buildings from state spaces `s' = A s + B u`, and reduced: to modes, or by static condensation."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Final

import numpy as np
import scipy
from numpy.typing import NDArray

from mrwork.base.arguments import May, NotNegative, checked
from mrwork.base.numbers import counted
from mrwork.base.remark import Measured, RemarkKind
from mrwork.base.values import Floats
from mrwork.buildings.modes import is_positive, modes_of, spaces_of
from mrwork.buildings.passive_element import transform_elements
from mrwork.buildings.plane_building import Building, source_with
from mrwork.buildings.structure import Status
from mrwork.errors import SettingError

# Tolerance relative to the largest entry where an exact zero or symmetry is expected.
_OFF_ZERO: Final = 1e-8
# Influences that are the same.
_SAME_INFLUENCE: Final = 1e-6
# How late a coordinate may follow the others statically, by dashpots [s].
_LATE: Final = 1e-4
_CONDENSED: Final = RemarkKind(
    "coordinates_condensed",
    "{0}: {1} condensed statically, which no floor, storey, device or influence names, with periods up to {period:.2g} "
    "s; the largest change of a kept frequency is {percent:.2g} %",
)
# What a building takes for the array that it has by default.
_DEFAULT: Final = np.empty(0)


def building_of(
    A: Floats,
    *,
    name: str,
    mass: Floats | None = None,
    influence: Floats = _DEFAULT,
    floors: Floats = _DEFAULT,
    storeys: Floats = _DEFAULT,
    source: str = "",
) -> Building:
    """The building of A = [0 I; -M^-1 K, -M^-1 C], perhaps in another order of its states.

    The coordinates have the order of the displacements among the states. A contains M only in products with M^-1.
    Without `mass`, M = (phi phi')^-1 is used, where phi are the modes of M^-1 K with unit length; it makes K symmetric,
    and is the unit matrix if M^-1 K is symmetric already. The response to a ground acceleration does not depend on this
    choice. The effect of a force does: its row is `-(M b)'`, where b is the lower half of its column of B. The building
    then has the status that its masses are not known. The influence is minus the lower half of the column of B for the
    ground acceleration.
    """
    order, n = order_of_states(A, name), len(A) // 2
    ordered = A[np.ix_(order, order)]
    stiffness, damping = -ordered[n:, :n], -ordered[n:, n:]
    status: Status = "masses not known" if mass is None else "ours"
    if mass is None:
        is_symmetric = np.abs(stiffness - stiffness.T).max() <= _OFF_ZERO * np.abs(stiffness).max()
        inverse = np.eye(n) if is_symmetric else np.linalg.inv(_real_modes(stiffness, name)[0])
        mass = inverse.T @ inverse
    if mass.shape != (n, n):
        raise SettingError(f"building {name}: the mass is not {n} x {n}, as half of A is")
    scaled = mass @ stiffness
    skew = np.abs(scaled - scaled.T).max()
    if skew > _OFF_ZERO * np.abs(scaled).max():
        raise SettingError(
            f"building {name}: with this mass the stiffness is not symmetric, by {skew:g} N/m; give the mass that A "
            "was made with"
        )
    return Building(
        name=name,
        mass=mass,
        damping=mass @ damping,
        stiffness=(scaled + scaled.T) / 2.0,
        influence=influence,
        floors=floors,
        storeys=storeys,
        source=source,
        status=status,
    )


def order_of_states(A: Floats, name: str) -> NDArray[np.intp]:
    """States in the order [q; q'], shape (n,): the row of a displacement in A is 1 at its rate and 0 elsewhere."""
    rates = np.abs(A).argmax(axis=1) if A.size else np.empty(0, dtype=np.intp)
    displacements = np.flatnonzero(np.abs(A - np.eye(len(A))[rates]).max(axis=1, initial=0.0) <= _OFF_ZERO)
    order = np.concatenate([displacements, rates[displacements]])
    if not len(A) or len(order) != len(A) or len(np.unique(order)) < len(A):
        raise SettingError(
            f"building {name}: {len(displacements)} of the {len(A)} rows of A are 1 at one state and 0 elsewhere, and "
            "in A = [0 I; -M^-1 K, -M^-1 C], whatever the order of its states, half of them are, each at a rate of its "
            "own; give states that are displacements [m] and their rates [m/s]"
        )
    return order


def mass_of_forces(A: Floats, B: Floats, rows: Floats, name: str) -> Floats:
    """M [kg], shape (n / 2, n / 2), from columns b of B of forces that stretch `rows`, (n_columns, n / 2): -M b = row'.

    With the modes phi of M^-1 K, `M = phi^-T diag(d) phi^-1`, and d follows from the forces in each mode, which resist
    or push.
    """
    order, n = order_of_states(A, name), len(A) // 2
    modes, spaces = _real_modes(-A[np.ix_(order[n:], order[:n])], name)
    inverse = np.linalg.inv(modes)
    moved, stretched = inverse @ B[order[n:]], modes.T @ rows.T
    # Shapes of unit length: what moves is in 1/kg.
    least = _OFF_ZERO * np.linalg.norm(moved)
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
    if np.abs(squares.imag).max() > _OFF_ZERO * largest or np.linalg.cond(shapes) > 1.0 / _OFF_ZERO:
        raise SettingError(
            f"building {name}: the modes of M^-1 K are no real shapes, so no mass makes K symmetric; "
            "give a state space of masses, springs and dashpots"
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


@checked
def static_condensation(
    building: Building,
    *,
    shortest_period: Annotated[NotNegative, May.BE_INFINITE] = 0.0,
    keep: Floats = _DEFAULT,
) -> Building:
    """Return the building without coordinates that nothing names, which follow the others statically.

    Named are coordinates in a row of floors, storeys, passive elements or `keep`, shape (n_rows, n), and those with
    mass that the influence moves. With the kept coordinates y, `q = T y` and `T = [I; -K_cc^-1 K_ck]`, the mass is
    T' M T, and so are damping and stiffness (Guyan, AIAA J. 3, 1965, 380), which is exact of coordinates without mass.
    By default these alone are condensed; else also those whose periods, where all others rest, or the times 2 pi m / c
    in which their damping c stops their mass m, are below `shortest_period` [s]. Those on which a dashpot acts stay.
    """
    mass, stiffness, influence = building.mass, building.stiffness, building.influence
    if keep.size and (keep.ndim != 2 or keep.shape[1] != len(mass)):
        raise SettingError(f"`keep` has shape {keep.shape}, {building.name} takes (n_rows, {len(mass)})")
    elements = [element.row for element in building.elements]
    rows = np.vstack([building.floors, building.storeys, *elements, *keep])
    free = ~rows.any(axis=0) & ~(mass.any(axis=0) & (influence != 0.0)) & (np.diag(stiffness) > 0.0)
    out, period = _static_coordinates(building, free, shortest_period)
    if not out.size:
        return building
    kept = np.delete(np.arange(len(mass)), out)
    onto = np.eye(len(mass))[:, kept]
    onto[out] = -np.linalg.solve(stiffness[np.ix_(out, out)], stiffness[np.ix_(out, kept)])
    matrices = {name: onto.T @ getattr(building, name) @ onto for name in ("mass", "damping", "stiffness")}
    change, given = 0.0, influence[kept]
    condensed = replace(
        building,
        **matrices,
        influence=given,
        floors=building.floors[:, kept],
        storeys=building.storeys[:, kept],
        elements=transform_elements(building.elements, onto),
    )
    if mass[:, out].any():
        reduced, whole = condensed.frequencies, building.frequencies[: len(kept)]
        ratios = np.divide(reduced, whole, out=np.ones_like(whole), where=whole > 0.0)
        change = float(np.abs(ratios - 1.0).max())
        # The ground acts on what is condensed, too; where that is of no weight, the influence stays as it was given.
        moved = np.linalg.solve(condensed.mass, onto.T @ mass @ (influence - onto @ given))
        condensed = replace(
            condensed, influence=given + np.where(np.abs(moved) > _SAME_INFLUENCE, moved, 0.0)
        )
    said = _CONDENSED.remark(
        *(building.name, counted(len(out), "coordinate")),
        measured=Measured(change, ""),
        period=period,
        percent=100.0 * change,
    )
    numbers = tuple(sorted([*building.condensed, *(building.kept[out] + 1).tolist()]))
    return replace(condensed, condensed=numbers, condensing=(*building.condensing, said))


def _static_coordinates(
    building: Building, free: NDArray[np.bool_], shortest: float
) -> tuple[NDArray[np.intp], float]:
    """The coordinates of these that follow the others statically, and the longest of their periods [s]."""
    mass, damping, stiffness = building.mass, building.damping, building.stiffness
    held = np.where(free, np.diag(stiffness), 1.0)
    # The slowest motion of several is slower than each alone.
    own = _time(np.diag(mass) / held, np.diag(damping) / held)
    out = np.flatnonzero(free & np.less_equal(own, shortest))
    while out.size:
        rest, inner = np.delete(np.arange(len(mass)), out), np.ix_(out, out)
        held, across = stiffness[inner], np.ix_(out, rest)
        if not rest.size or not is_positive(held):
            break
        statically = np.linalg.solve(held, stiffness[across])
        late = np.abs(np.linalg.solve(held, damping[across] - damping[inner] @ statically)).max(axis=1)
        squares, shapes = scipy.linalg.eigh(mass[inner], held)
        times = _time(squares, np.einsum("im,im->m", shapes, damping[inner] @ shapes))
        slow = np.flatnonzero(times > shortest)
        energy = np.diag(mass)[out][:, None] * shapes[:, slow] ** 2
        wrong = [*energy.argmax(axis=0).tolist(), *([int(late.argmax())] if late.max() > _LATE else [])]
        if not wrong:
            return out, float(2.0 * np.pi * np.sqrt(max(squares[-1], 0.0)))
        out = np.delete(out, wrong)
    return np.empty(0, dtype=np.intp), 0.0


def _time(squares: Floats, relaxations: Floats) -> Floats:
    """Periods [s] of m / k [s2], or the times 2 pi m / c, which are shorter where c / k [s] is large."""
    squares = np.maximum(squares, 0.0)
    return np.asarray(2.0 * np.pi * np.minimum(np.sqrt(squares), squares / np.maximum(relaxations, 1e-300)))
