"""Modes of `M q'' + C q' + K q = 0`: frequencies and shapes, damping, and modes that no damping reaches or that grow.

For a complex mode x with the pole s, s^2 x*Mx + s x*Cx + x*Kx = 0, so its damping ratio is x*Cx / (2 sqrt(x*Kx x*Mx))
(Tisseur, Meerbergen, SIAM Rev. 43, 2001, 235-286). Since 2 w <= w0 + w^2 / w0 for every w0, no ratio is below zeta
where C - zeta (w0 M + K / w0) is positive definite: one factorisation, n^3 / 3 operations, clears a building that is
damped throughout. The poles are computed only where that is not certain.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.values import Floats, array_dataclass

UNDAMPED: Final = 1e-6
"""Damping ratio below which a mode counts as undamped."""
# A mode above minus this ratio does not grow: published matrices have five or six digits.
_GROWS: Final = 1e-5
# Margin of ratios that rounding makes negative.
_NEGATIVE_RATIO: Final = 1e-9
# Modes below this share of the highest frequency, or of a typical one, are motions without stiffness.
_FREE: Final = 1e-6
# Squares of frequencies that differ by less are equal, relative to their own and to the highest.
_EQUAL_SQUARES: Final = 1e-8
_EPSILON: Final = 1e-14
# Weight of the motion that the ground drives beside damping, where both single out shapes.
_DRIVEN: Final = 1e-6
OF_ADDITIONS: Final = 0.9
"""Share of the kinetic energy in coordinates of additions above which a mode does not belong to the frame."""
# With more coordinates, damping ratios leave out the coupling between modes: poles would take minutes.
_MOST_COUPLED: Final = 300


@array_dataclass()
class ModalDamping:
    """Frequencies [Hz] and damping ratios of the modes with stiffness, lowest first, and how many have none.

    `apart` is the share of a mode's kinetic energy in coordinates that move no floor, as the end of a brace.
    """

    frequency: Floats
    ratio: Floats
    apart: Floats
    n_free: int


@array_dataclass()
class Modes:
    """Modes of a building, lowest first: circular frequencies [rad/s], shape (n,), shapes as columns, and what follows.

    The shapes have shapes' M shapes = I; damping ratios are infinite or NaN for a mode without stiffness.
    """

    omega: Floats
    shapes: Floats
    damping_ratios: Floats
    participation: Floats
    effective_masses: Floats

    @property
    def periods(self) -> Floats:
        """Periods [s], shape (n,); infinite of a motion without stiffness."""
        with np.errstate(divide="ignore"):
            return np.asarray(2.0 * np.pi / self.omega)


def modes_of(mass: Floats, stiffness: Floats, most: int | None = None) -> tuple[Floats, Floats]:
    """Circular frequencies [rad/s], shape (n,), lowest first, and mode shapes as columns with modes' M modes = I.

    The largest entry of each shape is positive. Of large buildings the `most` lowest modes take a fraction of the time.
    """
    some = None if most is None or most >= len(mass) else (0, most - 1)
    squares, modes = scipy.linalg.eigh(stiffness, mass, subset_by_index=some)
    # A free coordinate has frequency zero; rounding may make its square negative.
    return np.sqrt(np.maximum(squares, 0.0)), _with_signs(modes)


def _with_signs(modes: Floats) -> Floats:
    largest = np.take_along_axis(modes, np.abs(modes).argmax(axis=0)[None, :], axis=0)
    return np.asarray(modes * np.where(largest < 0.0, -1.0, 1.0))


def spaces_of(squares: Floats) -> list[slice]:
    """Ranges of modes of equal frequency within rounding, from the squared frequencies in rising order, shape (n,).

    Of several such modes any combination is a mode, so that only the space of their shapes is determined.
    """
    apart = np.diff(squares) > _EQUAL_SQUARES * squares[1:] + _EPSILON * squares[-1]
    ends = np.concatenate([[0], np.flatnonzero(apart) + 1, [len(squares)]]).tolist()
    return [slice(start, stop) for start, stop in pairwise(ends)]


def settle_shapes(omega: Floats, modes: Floats, damping: Floats, driven: Floats) -> Floats:
    """Mode shapes that damping does not couple where several have one frequency; of equally damped ones one is driven.

    `driven` is M r, shape (n,): the first of modes with equal damping has all their participation, the others none.
    """
    settled = modes.copy()
    for space in spaces_of(omega**2):
        if space.stop - space.start > 1:
            shapes = modes[:, space]
            coupled, drive = shapes.T @ damping @ shapes, shapes.T @ driven
            weight = _DRIVEN * (float(np.abs(coupled).max()) or 1.0) / (float(drive @ drive) or 1.0)
            _, turn = np.linalg.eigh(coupled - weight * np.outer(drive, drive))
            settled[:, space] = _with_signs(shapes @ turn)
    return settled


def modal_damping(mass: Floats, damping: Floats, stiffness: Floats, floors: Floats) -> ModalDamping:
    """Damping of every mode with stiffness, from the poles; without the coupling of modes above 300 coordinates."""
    omega, modes = modes_of(mass, stiffness)
    coupled = modes.T @ damping @ modes
    free = omega <= _FREE * omega[-1]
    n, n_free = len(omega), int(free.sum())
    if n > _MOST_COUPLED:
        elastic = ~free
        return ModalDamping(
            frequency=omega[elastic] / (2.0 * np.pi),
            ratio=np.diag(coupled)[elastic] / (2.0 * omega[elastic]),
            apart=apart_of(modes[:, elastic], mass, floors),
            n_free=n_free,
        )
    # In modal coordinates the state [omega y; y'] scales all entries alike.
    stiff = np.diag(omega)
    poles, states = np.linalg.eig(np.block([[np.zeros_like(stiff), stiff], [-stiff, -coupled]]))
    moving = np.abs(poles) > (_FREE * omega[-1] if n_free else 0.0)
    complex_, real = moving & (poles.imag > 0.0), np.sort(poles.real[moving & (poles.imag == 0.0)])
    pairs, shapes = poles[complex_], modes @ states[n:, complex_]
    # Two real poles of one sign are an overdamped mode; a motion without stiffness has one pole that is not zero.
    grows, decays = real[real > 0.0], real[real <= 0.0]
    grows = np.append(grows, grows[len(grows) - len(grows) % 2 :])
    decays = decays[len(decays) % 2 :]
    overdamped = np.concatenate([grows, decays])
    frequency = np.concatenate([np.abs(pairs), np.sqrt(overdamped[::2] * overdamped[1::2])])
    ratio = np.concatenate([-pairs.real / np.abs(pairs), -np.sign(overdamped[::2])])
    apart = np.concatenate([apart_of(shapes, mass, floors), np.zeros(len(overdamped) // 2)])
    order = np.argsort(frequency)
    return ModalDamping(
        frequency=frequency[order] / (2.0 * np.pi), ratio=ratio[order], apart=apart[order], n_free=n_free
    )


def apart_of(shapes: NDArray[np.complex128] | Floats, mass: Floats, floors: Floats) -> Floats:
    """Share of the kinetic energy of each shape, a column, in coordinates that move no floor."""
    hidden = ~floors.any(axis=0)
    if not hidden.any():
        return np.zeros(shapes.shape[1])
    inner = shapes[hidden]
    part = np.einsum("im,im->m", inner.conj(), mass[np.ix_(hidden, hidden)] @ inner).real
    return np.asarray(part / np.einsum("im,im->m", shapes.conj(), mass @ shapes).real)


def growing_modes(mass: Floats, damping: Floats, stiffness: Floats, floors: Floats) -> str:
    """Number of modes with negative damping and the worst of them, in words; empty if none has."""
    if not damping.any() or is_damped(mass, damping, stiffness, -_NEGATIVE_RATIO):
        return ""
    damped = modal_damping(mass, damping, stiffness, floors)
    grows = damped.ratio < -_GROWS
    if not grows.any():
        return ""
    n, worst = len(mass), int(damped.ratio.argmin())
    return (
        f"{_modes_have(int(grows.sum()), n)} negative damping, the worst is mode "
        f"{n - len(damped.ratio) + worst + 1} at {damped.frequency[worst]:.4g} Hz "
        f"with the ratio {damped.ratio[worst]:.3g}"
    )


_CURE: Final = (
    "every damper looks better on a frame without damping: give it modal_damping with ratios of 0.01 to 0.02, "
    "rayleigh, or a damping matrix"
)
_UNDAMPED: Final = RemarkKind("modes_undamped", "{0}: {modes} no damping{lowest}", _CURE)
_FREE_MODES: Final = RemarkKind(
    "modes_free",
    "{0}: {modes} no stiffness, so that nothing limits its drift",
    "give the isolators or the lowest storey a stiffness",
)
_DRIVEN_MOTION: Final = RemarkKind(
    "damping_drives",
    "{0}: the damping matrix drives some motion, although every mode decays",
    "check the signs of its entries",
)


def damping_remarks(
    name: str, mass: Floats, damping: Floats, stiffness: Floats, floors: Floats
) -> Iterator[Remark]:
    """Remarks on modes without stiffness, on modes without damping, and on damping that drives some motion.

    A mode of an addition alone, as of a brace behind which a damper is to stand, may be undamped.
    """
    n = len(mass)
    # Whether it is certain that every mode has a stiffness.
    held = is_positive(stiffness - (_FREE * _typical_frequency(mass, stiffness)) ** 2 * mass)
    if held and not damping.any():
        yield _UNDAMPED.remark(name, modes=_modes_have(n, n), lowest="")
        return
    if held and is_damped(mass, damping, stiffness, UNDAMPED):
        return
    damped = modal_damping(mass, damping, stiffness, floors)
    if damped.n_free:
        yield _FREE_MODES.remark(name, modes=_modes_have(damped.n_free, n))
    undamped = (damped.ratio < UNDAMPED) & (damped.apart < OF_ADDITIONS)
    if undamped.any():
        lowest = float(damped.frequency[undamped][0])
        yield _UNDAMPED.remark(
            name,
            measured=Measured(lowest, "Hz"),
            modes=_modes_have(int(undamped.sum()), n),
            lowest=f", the lowest of these at {lowest:.4g} Hz",
        )
    elif not is_damped(mass, damping, stiffness, -_NEGATIVE_RATIO):
        yield _DRIVEN_MOTION.remark(name)


def _modes_have(count: int, n_modes: int) -> str:
    return f"{count} of {n_modes} modes {'has' if count == 1 else 'have'}"


def is_damped(mass: Floats, damping: Floats, stiffness: Floats, ratio: float) -> bool:
    """Whether it is certain that no damping ratio is below `ratio`."""
    typical = _typical_frequency(mass, stiffness)
    # A skew part of C does no work.
    rest = damping + damping.T
    rest *= 0.5
    rest -= (ratio * typical) * mass
    rest -= (ratio / typical) * stiffness
    return is_positive(rest)


def _typical_frequency(mass: Floats, stiffness: Floats) -> float:
    """Median of the frequencies of single coordinates [rad/s]; 1 without stiffness.

    A few stiff links do not change a median.
    """
    alone = np.sqrt(np.maximum(np.diag(stiffness), 0.0) / np.diag(mass))
    moving = alone[alone > 0.0]
    return float(np.median(moving)) if moving.size else 1.0


def is_positive(matrix: Floats, shift: float = 0.0) -> bool:
    """Whether a symmetric matrix plus `shift` I has positive eigenvalues only: a tenth of the time of finding them.

    A diagonal that outweighs the rest of every row, as of diagonal matrices and chains of springs, tells it at once.
    """
    diagonal = np.diag(matrix) + shift
    if (diagonal <= 0.0).any():
        return False
    if (2.0 * diagonal - shift > np.abs(matrix).sum(axis=1)).all():
        return True
    try:
        np.linalg.cholesky(matrix + shift * np.eye(len(matrix)) if shift else matrix)
    except np.linalg.LinAlgError:
        return False
    return True
