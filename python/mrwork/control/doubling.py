"""Riccati equations by doubling, which holds where the ordering of a pencil's eigenvalues fails."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError

Floats = NDArray[np.float64]

# Each pass squares how far the closed loop has decayed: sixty reach any loop that double precision calls stable.
_MAX_PASSES = 60
_LARGEST = 1e60


def solve_discrete(A: Floats, G: Floats, H: Floats) -> Floats:
    """The stabilising X of `X = A'X (1 + G X)^-1 A + H` with G and H symmetric and without negative directions.

    `A_+ = A W^-1 A, G_+ = G + A W^-1 G A', H_+ = H + A'H W^-1 A` with `W = 1 + G H`: H tends to X (Chu, Fan, Lin &
    Wang, Int. J. Control 77(8), 2004, 767-788). SciPy orders the eigenvalues of a pencil instead, which fails where
    they crowd the unit circle, as those of a tall building do at a fine sample time.

    Raises
    ------
    SettingError
        Where the iteration does not settle.
    """
    one = np.eye(len(A))
    for _ in range(_MAX_PASSES):
        W = one + G @ H
        try:
            right, left = np.linalg.solve(W, A), np.linalg.solve(W.T, A.T).T
        except np.linalg.LinAlgError:
            break
        added = A.T @ H @ right
        A, G, H = A @ right, _symmetric(G + left @ G @ A.T), _symmetric(H + added)
        # What nothing holds squares itself in every pass.
        if not max(np.linalg.norm(A), np.linalg.norm(H)) < _LARGEST:
            break
        if np.linalg.norm(added) <= 1e-15 * np.linalg.norm(H):
            return H
    raise SettingError(
        "the Riccati equation has no stabilising solution; weigh, or measure, every mode that is not damped"
    )


def solve_continuous(A: Floats, G: Floats, H: Floats, shift: float) -> Floats:
    """The stabilising X of `A'X + X A - X G X + H = 0`, by Cayley's transform to a discrete equation.

    `shift` is about the geometric mean of the sizes of the closed loop's poles (Chu, Fan & Lin, Linear Algebra and its
    Applications 396, 2005, 55-80).
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
