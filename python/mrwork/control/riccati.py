"""Algebraic Riccati equations: the continuous one, scaled, refined and checked; both by doubling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from mrwork.errors import SettingError

Floats = NDArray[np.float64]

# Of the sum of the norms of the terms, in units in which the solution is the identity.
_LARGEST_RESIDUAL = 1e-7
_KLEINMAN_STEPS = 12
# Each doubling squares the decay of the closed loop: sixty suffice for every loop that is stable in double precision.
_DOUBLINGS = 60
_LARGEST_NORM = 1e60


@dataclass(frozen=True, slots=True, kw_only=True)
class RiccatiSolution:
    """P, shape (2n, 2n), the gain K of f = -K s, shape (n_devices, 2n), and the poles of A - B K [1/s].

    `residual` is relative to the terms of the equation, in units in which P is the identity.
    """

    P: Floats
    gain: Floats
    poles: NDArray[np.complex128]
    residual: float


def solve_riccati(
    A: Floats, B: Floats, Q: Floats, R: Floats, N: Floats, *, scaling: Floats
) -> RiccatiSolution:
    """Solve `A'P + P A - (P B + N) R^-1 (B'P + N') + Q = 0` for the stabilising P.

    In SI units the terms span twenty orders of magnitude, more than double precision resolves. The equation is
    therefore scaled: the state to the coordinates z of s = `scaling` z, time such that |A| = 1, each force such that
    its column of B has norm 1, and the cost such that |R| = 1. The result then does not depend on the units.
    With a small control weight the solution still spans many orders of magnitude; each refinement is therefore taken in
    coordinates in which the previous solution is the identity (P = L L', z = L'^-1 w), by Kleinman's step, a Lyapunov
    equation (IEEE Trans. Automatic Control 13(1), 1968, 114-115), until the residual stops falling.

    Raises
    ------
    SettingError
        If no stabilising solution exists or none is found to the required precision.
    """
    T = scaling
    inverse = np.linalg.inv(T)
    A_z, B_z = inverse @ A @ T, inverse @ B
    rate = float(np.linalg.norm(A_z, 2))
    if rate < 1e-9 * np.linalg.norm(B_z):  # B dominates, as on a sliding surface
        rate = float(np.linalg.norm(B_z))
    forces = rate / np.maximum(np.linalg.norm(B_z, axis=0), np.finfo(float).tiny)
    A_z, B_z = A_z / rate, B_z * forces / rate
    Q_z, N_z = T.T @ Q @ T, T.T @ N * forces
    R_z = R * np.outer(forces, forces)
    cost = float(np.linalg.norm(R_z, 2))
    Q_z, N_z, R_z = _symmetric(Q_z) / cost, N_z / cost, _symmetric(R_z) / cost
    P_z, residual = _solved(A_z, B_z, Q_z, R_z, N_z)
    gain_z = np.linalg.solve(R_z, B_z.T @ P_z + N_z.T)
    poles = rate * np.linalg.eigvals(A_z - B_z @ gain_z)
    if not np.all(poles.real < 0.0):
        raise SettingError(
            f"the loop closed with the Riccati gain has a pole at {max(poles.real):.3g} 1/s and is not stable; "
            f"weigh every mode that is not damped"
        )
    if not residual <= _LARGEST_RESIDUAL:
        raise SettingError(
            f"the Riccati equation is met only to {residual:.1e} of its terms, {_LARGEST_RESIDUAL:g} is "
            f"required; make the weights less extreme: a larger control weight or a smaller output weight"
        )
    P = inverse.T @ P_z @ inverse * (cost / rate)
    gain = forces[:, None] * gain_z @ inverse
    return RiccatiSolution(P=_symmetric(P), gain=gain, poles=poles.astype(np.complex128), residual=residual)


def _solved(A: Floats, B: Floats, Q: Floats, R: Floats, N: Floats) -> tuple[Floats, float]:
    """P and its residual: by ordered eigenvalues, and by doubling if that fails."""
    best: tuple[Floats, float] | None = None
    for attempt in (_by_eigenvalues, _by_doubling):
        try:
            solved = _polished(A, B, Q, R, N, attempt(A, B, Q, R, N))
        # SciPy raises either, depending on the step that fails; doubling raises a SettingError, which is a ValueError.
        except (np.linalg.LinAlgError, ValueError):
            continue
        if best is None or solved[1] < best[1]:
            best = solved
        if best[1] <= _LARGEST_RESIDUAL:
            return best
    if best is None:
        raise SettingError(
            "the Riccati equation has no stabilising solution; weigh every mode that is not damped, and see "
            "that a device can move it"
        )
    return best


def _by_eigenvalues(A: Floats, B: Floats, Q: Floats, R: Floats, N: Floats) -> Floats:
    P = scipy.linalg.solve_continuous_are(A, B, Q, R, s=N)
    return _symmetric(np.asarray(P, dtype=np.float64))


def _by_doubling(A: Floats, B: Floats, Q: Floats, R: Floats, N: Floats) -> Floats:
    of_N, of_B = np.linalg.solve(R, N.T), np.linalg.solve(R, B.T)
    # |A| = 1 after scaling.
    return solve_continuous(A - B @ of_N, _symmetric(B @ of_B), _symmetric(Q - N @ of_N), shift=1.0)


def _polished(A: Floats, B: Floats, Q: Floats, R: Floats, N: Floats, P: Floats) -> tuple[Floats, float]:
    """P after Kleinman's steps in scaled coordinates, and the remaining relative residual."""
    best, smallest = P, np.inf
    for _ in range(_KLEINMAN_STEPS):
        L, back = _root(P)
        A_w, B_w = L.T @ A @ back, L.T @ B
        Q_w, N_w = back.T @ Q @ back, back.T @ N
        P_w = back.T @ P @ back
        residual = _relative_residual(A_w, B_w, Q_w, R, N_w, P_w)
        if residual < smallest:
            best, smallest = P, residual
        elif residual >= 0.5 * smallest:
            break
        gain = np.linalg.solve(R, B_w.T @ P_w + N_w.T)
        weight = Q_w - N_w @ gain - gain.T @ N_w.T + gain.T @ R @ gain
        closed = A_w - B_w @ gain
        if not np.linalg.eigvals(closed).real.max() < -1e-12 * np.linalg.norm(closed):
            break
        P_w = np.asarray(
            scipy.linalg.solve_continuous_lyapunov(closed.T, -_symmetric(weight)), dtype=np.float64
        )
        P = L @ _symmetric(P_w) @ L.T
    return best, smallest


def _root(P: Floats) -> tuple[Floats, Floats]:
    """L of P = L L' and the inverse of L'; a floor replaces eigenvalues that rounding made zero or negative."""
    values, vectors = np.linalg.eigh(P)
    if not values[-1] > 0.0:
        raise np.linalg.LinAlgError("nothing is weighed")
    lengths = np.sqrt(np.maximum(values, 1e-14 * values[-1]))
    return vectors * lengths, vectors / lengths


def _relative_residual(A: Floats, B: Floats, Q: Floats, R: Floats, N: Floats, P: Floats) -> float:
    half = P @ B + N
    terms = (A.T @ P, P @ A, -half @ np.linalg.solve(R, half.T), Q)
    return float(np.linalg.norm(sum(terms)) / sum(np.linalg.norm(term) for term in terms))


def solve_discrete(A: Floats, G: Floats, H: Floats) -> Floats:
    """The stabilising X of `X = A'X (1 + G X)^-1 A + H` with G and H symmetric and positive semidefinite.

    `A_+ = A W^-1 A, G_+ = G + A W^-1 G A', H_+ = H + A'H W^-1 A` with `W = 1 + G H`: H tends to X (Chu, Fan, Lin &
    Wang, Int. J. Control 77(8), 2004, 767-788). SciPy orders the eigenvalues of a pencil instead, which fails if
    they lie close to the unit circle, as those of a tall building do at a short sample time.

    Raises
    ------
    SettingError
        If the iteration does not converge.
    """
    one = np.eye(len(A))
    for _ in range(_DOUBLINGS):
        W = one + G @ H
        try:
            right, left = np.linalg.solve(W, A), np.linalg.solve(W.T, A.T).T
        except np.linalg.LinAlgError:
            break
        added = A.T @ H @ right
        A, G, H = A @ right, _symmetric(G + left @ G @ A.T), _symmetric(H + added)
        # A mode that is not stabilised grows quadratically.
        if not max(np.linalg.norm(A), np.linalg.norm(H)) < _LARGEST_NORM:
            break
        if np.linalg.norm(added) <= 1e-15 * np.linalg.norm(H):
            return H
    raise SettingError(
        "the Riccati equation has no stabilising solution; weigh, or measure, every mode that is not damped"
    )


def solve_continuous(A: Floats, G: Floats, H: Floats, shift: float) -> Floats:
    """The stabilising X of `A'X + X A - X G X + H = 0`, by Cayley's transform to a discrete equation.

    `shift` should be near the geometric mean of the moduli of the closed-loop poles (Chu, Fan & Lin, Linear Algebra and
    its Applications 396, 2005, 55-80).
    """
    shifted = A - shift * np.eye(len(A))
    forth = np.linalg.solve(shifted, G)
    back = np.linalg.inv(shifted.T + H @ forth)
    return solve_discrete(
        np.eye(len(A)) + 2.0 * shift * back.T,
        _symmetric(2.0 * shift * forth @ back),
        _symmetric(2.0 * shift * back @ np.linalg.solve(shifted.T, H.T).T),
    )


def _symmetric(matrix: Floats) -> Floats:
    return np.asarray(0.5 * (matrix + matrix.T), dtype=np.float64)
