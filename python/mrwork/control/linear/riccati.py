"""Algebraic Riccati and Lyapunov equations of many plants and weights: regulators, filters, costs."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import IntEnum
from typing import Literal, TypeVar

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from mrwork import _rust
from mrwork.base.arguments import Threads, checked
from mrwork.base.numbers import duration_in_words
from mrwork.base.summary import Summarised, Summary
from mrwork.base.values import Floats, array_dataclass
from mrwork.control.linear.plant import symmetric_part
from mrwork.errors import MrworkWarning, SettingError

T = TypeVar("T")
U = TypeVar("U")

Time = Literal["continuous", "discrete"]
"""Whether a plant is a differential equation or goes from sample to sample."""


class RiccatiStatus(IntEnum):
    """How the solution of one equation ended."""

    SOLVED = 0
    NO_STABILISING_SOLUTION = 1
    NOT_CONVERGED = 2
    WEIGHT_NOT_POSITIVE = 3

    @property
    def remedy(self) -> str:
        """What has failed and what to change, as the end of an error message; "nothing" of a solution."""
        return {
            RiccatiStatus.SOLVED: "nothing",
            RiccatiStatus.NO_STABILISING_SOLUTION: "no stabilising solution was found; weigh, or measure, every mode "
            "that is not damped, see that a device can move it, and make weights of extreme ratio less so",
            RiccatiStatus.NOT_CONVERGED: "double precision does not resolve the equation; make the weights less "
            "extreme: a larger control weight or a smaller output weight",
            RiccatiStatus.WEIGHT_NOT_POSITIVE: "the control weight, or the intensity of the sensor noise, is not "
            "positive definite; give a positive one",
        }[self]


@array_dataclass(repr=False)
class RiccatiSolutions(Summarised):
    """Solutions of a batch of equations, one row for each; infinite in a row that is not solved.

    `gain` is K of the forces f = -K s of a regulator, shape (n_batch, n_controls, n_states), or L of an observer, shape
    (n_batch, n_states, n_measurements). P is the cost to go s'P s of a regulator, or the covariance of the error of an
    observer, shape (n_batch, n_states, n_states). `residual` is relative to the terms, in coordinates in which P is the
    identity, or where P is singular in the coordinates of `scaling`; `status` is the `RiccatiStatus` of each row.
    """

    gain: Floats
    P: Floats
    residual: Floats
    status: NDArray[np.uint8]

    @property
    def solved(self) -> NDArray[np.bool_]:
        """Whether each row is solved, shape (n_batch,)."""
        return np.asarray(self.status == RiccatiStatus.SOLVED, dtype=np.bool_)

    def check(self, row: int = 0) -> None:
        """Raise where a row is not solved."""
        if not 0 <= row < len(self.status):
            raise SettingError(
                f"there are {len(self.status)} rows, counted from 0, and row {row} is none of them"
            )
        status = RiccatiStatus(int(self.status[row]))
        if status is not RiccatiStatus.SOLVED:
            reached = self.residual[row]
            met = f"; it is met only to {reached:.1e} of its terms" if np.isfinite(reached) else ""
            raise SettingError(f"a Riccati equation has no solution: {status.remedy}{met}")

    def _summary(self) -> Summary:
        counts = sorted(Counter(self.status.tolist()).items())
        worst = np.max(self.residual[self.solved], initial=0.0)
        return Summary(
            title=f"Riccati equations, {len(self.status)} rows",
            facts=(
                *((RiccatiStatus(status).name.lower().replace("_", " "), str(n)) for status, n in counts),
                ("largest residual", f"{worst:.1e}"),
                ("gain", str(self.gain.shape[1:])),
            ),
        )


@checked
def regulator_gains(
    A: ArrayLike,
    B: ArrayLike,
    state_weight: ArrayLike,
    control_weight: ArrayLike,
    cross_weight: ArrayLike | None = None,
    *,
    time: Time = "continuous",
    scaling: ArrayLike | None = None,
    threads: Threads = 0,
) -> RiccatiSolutions:
    """Gains K of f = -K s that minimise `int s'Q s + 2 s'N f + f'R f dt`, or its sum over the samples, in batches.

    Solves `A'P + P A - (P B + N) R^-1 (B'P + N') + Q = 0`, or in discrete time
    `A'P A - P - (A'P B + N)(R + B'P B)^-1 (B'P A + N') + Q = 0`, by structure-preserving doubling (Chu, Fan & Lin,
    Linear Algebra and its Applications 396, 2005, 55-80; Chu, Fan, Lin & Wang, Int. J. Control 77(8), 2004, 767-788).
    Newton's iteration (Kleinman, IEEE Trans. Automatic Control 13(1), 1968, 114-115) then refines P to rounding and
    shows that A - B K is stable. A row that it does not solve, such as one whose P is singular since a damped mode is
    not weighed, is solved once more by the Schur form and Newton's iteration. A row has the same bits in every batch
    and with every number of threads.

    Each matrix has a leading axis of n_batch, or none if all rows share it; so one plant may have many weights.

    Parameters
    ----------
    A, B
        Shapes (..., n_states, n_states) and (..., n_states, n_controls). Up to some forty states are fast.
    state_weight, control_weight, cross_weight
        Q, R and N, shapes (..., n_states, n_states), (..., n_controls, n_controls) and (..., n_states, n_controls); the
        symmetric parts of Q and R count, N is zero by default. Units are the caller's, and need not be scaled.
    time
        "continuous" for s' = A s + B f, "discrete" for s_{k+1} = A s_k + B f_k.
    scaling
        T of s = T z, shape (..., n_states, n_states): coordinates in which the terms are of one magnitude, such as
        `plant.scaling`; by default a diagonal one that balances A.

    Raises
    ------
    SettingError
        If shapes do not fit, or a matrix holds a value that is not finite. A row without a solution raises nothing: see
        `RiccatiSolutions.status`.

    Examples
    --------
    >>> import numpy as np
    >>> import mrwork as mr
    >>> frame = mr.building("uts")
    >>> plant = mr.control.plant_of(frame, frame.storeys[0])
    >>> R = np.geomspace(1e-9, 1e-5, 200).reshape(-1, 1, 1)
    >>> found = mr.control.regulator_gains(plant.A, plant.B, plant.energy, R, scaling=plant.scaling)
    >>> found.gain.shape
    (200, 1, 10)
    """
    n = _columns("A", A)
    m = _columns("B", B)
    stacks = {
        "state": _stack("A", A, n, n),
        "control": _stack("B", B, n, m),
        "state_weight": _stack("state_weight", state_weight, n, n),
        "control_weight": _stack("control_weight", control_weight, m, m),
    }
    if cross_weight is not None:
        stacks["cross_weight"] = _stack("cross_weight", cross_weight, n, m)
    return _solve(stacks | _scaling(scaling, n), time, threads)


def solve_riccati(
    A: Floats, B: Floats, Q: Floats, R: Floats, N: Floats, *, scaling: Floats
) -> tuple[Floats, Floats]:
    """Gain K of f = -K s and P of one equation; see `regulator_gains`."""
    solutions = regulator_gains(A, B, Q, R, N, scaling=scaling, threads=1)
    solutions.check()
    return solutions.gain[0], solutions.P[0]


@checked
def kalman_gains(
    A: ArrayLike,
    C: ArrayLike,
    process_noise: ArrayLike,
    sensor_noise: ArrayLike,
    cross_noise: ArrayLike | None = None,
    *,
    time: Time = "continuous",
    scaling: ArrayLike | None = None,
    threads: Threads = 0,
) -> RiccatiSolutions:
    """Gains L of steady Kalman filters, in batches, and the covariances of their errors.

    Of x' = A x + B f + L (y - C x - D f), or of the predictor x_{k+1} = A x_k + B f_k + L (y_k - C x_k - D f_k). The
    equation is the Riccati equation of the regulator of A' and C' (see `regulator_gains`).

    Parameters
    ----------
    A, C
        Shapes (..., n_states, n_states) and (..., n_measurements, n_states).
    process_noise, sensor_noise, cross_noise
        Intensities of the white noises w and v of s' = A s + ... + w and y = C s + ... + v, or their covariances in
        discrete time: E[w w'], E[v v'] and E[w v'], shapes (..., n_states, n_states),
        (..., n_measurements, n_measurements) and (..., n_states, n_measurements).
    time, scaling, threads
        See `regulator_gains`; T of s = T z belongs to the state.

    Raises
    ------
    SettingError
        If shapes do not fit, or a matrix holds a value that is not finite.
    """
    n = _columns("A", A)
    states = _stack("A", A, n, n)
    rows = np.asarray(C, dtype=np.float64)
    if rows.ndim < 2 or not rows.shape[-2]:
        raise SettingError(
            f"`C` has shape {rows.shape}; give (n_measurements, {n}), or a stack of such matrices"
        )
    m = rows.shape[-2]
    stacks = {
        "state": _transpose(states),
        "control": _transpose(_stack("C", C, m, n)),
        "state_weight": _stack("process_noise", process_noise, n, n),
        "control_weight": _stack("sensor_noise", sensor_noise, m, m),
    }
    if cross_noise is not None:
        stacks["cross_weight"] = _stack("cross_noise", cross_noise, n, m)
    # The scaling of A' that corresponds to the scaling of A.
    of_dual = {
        name: _transpose(np.linalg.inv(T).astype(np.float64)) for name, T in _scaling(scaling, n).items()
    }
    dual = _solve(stacks | of_dual, time, threads)
    return RiccatiSolutions(gain=_transpose(dual.gain), P=dual.P, residual=dual.residual, status=dual.status)


@checked
def lyapunov_solutions(
    A: ArrayLike,
    weight: ArrayLike,
    *,
    time: Time = "continuous",
    scaling: ArrayLike | None = None,
    threads: Threads = 0,
) -> RiccatiSolutions:
    """P of `A'P + P A + Q = 0`, or of `A'P A - P + Q = 0` in discrete time, in batches.

    s'P s is the cost of free vibration from s under the weight Q. With A' for A, and the intensity of a white noise for
    Q, P is the covariance of the state. By Smith's doubling (SIAM J. Appl. Math. 16, 1968, 198-201), refined.

    Parameters
    ----------
    A, weight
        A and Q, shapes (..., n_states, n_states).
    time, scaling, threads
        See `regulator_gains`.

    Returns
    -------
    RiccatiSolutions
        With gains of shape (n_batch, 0, n_states). A row whose A is not stable has no stabilising solution.

    Raises
    ------
    SettingError
        If shapes do not fit, or a matrix holds a value that is not finite.
    """
    n = _columns("A", A)
    stacks = {
        "state": _stack("A", A, n, n),
        "control": np.zeros((1, n, 0)),
        "state_weight": _stack("weight", weight, n, n),
        "control_weight": np.zeros((1, 0, 0)),
    }
    return _solve(stacks | _scaling(scaling, n), time, threads)


def _solve(stacks: dict[str, Floats], time: Time, threads: int) -> RiccatiSolutions:
    counts = {len(matrices) for matrices in stacks.values()} - {1}
    if len(counts) > 1:
        raise SettingError(
            f"the matrices have {', '.join(str(count) for count in sorted(counts))} rows; give the same number of "
            "each, or one that all rows share"
        )
    n_states = stacks["state"].shape[-1]
    seconds = _SECONDS * n_states**3
    if n_states >= _MANY_STATES and seconds >= _LONG:
        warnings.warn(
            f"a Riccati equation of {n_states:,} states takes about {duration_in_words(seconds)}, and grows with their "
            "cube; a building of fewer coordinates, as by `mr.buildings.modal_truncation`, takes less",
            MrworkWarning,
            stacklevel=2,
        )
    gain, P, residual, status = _rust.riccati_equations(time, **stacks, threads=threads)
    unsolved = (RiccatiStatus.NO_STABILISING_SOLUTION, RiccatiStatus.NOT_CONVERGED)
    for row in np.flatnonzero(np.isin(status, unsolved)):
        equation = {name: matrices[row if len(matrices) > 1 else 0] for name, matrices in stacks.items()}
        if (again := _judge_again(equation, time)) is not None:
            gain[row], P[row], residual[row] = again
            status[row] = RiccatiStatus.SOLVED
    return RiccatiSolutions(gain=gain, P=P, residual=residual, status=status)


_MOST_NEWTON_STEPS = 40
# Largest residual over its terms, and largest share of a gain by which Newton's step still moves it.
_OF_TERMS = 1e-7
# A gain of this share of its terms is rounding.
_NO_GAIN = 1e-13
# Slowest decay of a loop over its rates below which rounding decides whether it is stable.
_LEAST_DECAY = 3e-8


@np.errstate(all="ignore")
def _judge_again(equation: Mapping[str, Floats], time: Time) -> tuple[Floats, Floats, float] | None:
    """Gain, P and residual of an equation that the compiled solver has refused; `None` if it has no solution.

    That solver works in coordinates in which P is the identity, and no such coordinates exist where P is singular, as
    for a mode that is damped and not weighed. Here the given coordinates z of s = T z are kept, and a solution has a
    small residual over its terms, a stable loop, and a gain that Newton's step no longer moves.
    """
    n, m = equation["control"].shape
    norm = np.linalg.norm
    T = equation.get("scaling")
    if T is None:
        T = np.diag(scipy.linalg.matrix_balance(equation["state"], permute=False, separate=True)[1][0])
    try:
        upper = np.linalg.cholesky(symmetric_part(equation["control_weight"])).T
    except np.linalg.LinAlgError:
        return None
    Q, one = T.T @ symmetric_part(equation["state_weight"]) @ T, np.eye(m)
    A = np.linalg.solve(T, equation["state"] @ T)
    B = np.linalg.solve(T, equation["control"]) @ np.linalg.inv(upper)
    N = T.T @ equation.get("cross_weight", np.zeros((n, m))) @ np.linalg.inv(upper)
    step = float(time == "discrete")
    rate = A - step * np.eye(n)

    def gain_of(P: Floats) -> tuple[Floats, Floats]:
        """K, and the part of the cost that it saves."""
        cross = B.T @ P @ (A if step else np.eye(n)) + N.T
        K: Floats = np.linalg.solve(one + step * B.T @ P @ B, cross).astype(np.float64)
        return K, cross.T @ K

    def by_schur() -> Floats:
        solve = scipy.linalg.solve_discrete_are if step else scipy.linalg.solve_continuous_are
        return gain_of(np.asarray(solve(A, B, Q, one, s=N) if m else Q, dtype=np.float64))[0]

    # A stable plant has a second start, which is the solution where nothing is weighed.
    starts: list[Callable[[], Floats]] = [by_schur, lambda: np.zeros((m, n))]
    for start in starts if np.any(Q) or np.any(N) else reversed(starts):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", scipy.linalg.LinAlgWarning)
                K = start()
            for _ in range(_MOST_NEWTON_STEPS):
                loop = LyapunovEquations(rate - B @ K, step)
                P = loop.cost(symmetric_part(Q - 2.0 * N @ K + K.T @ K))
                before, (K, saved) = K, gain_of(P)
                size, of_terms = norm(K), norm(B) * norm(P) + norm(N)
                if settled := bool(norm(K - before) <= _OF_TERMS * size or size <= _NO_GAIN * of_terms):
                    break
        except (np.linalg.LinAlgError, scipy.linalg.LinAlgWarning, SettingError, ValueError):
            continue
        moved = P @ rate
        terms = (moved + moved.T + step * rate.T @ moved, -saved, Q)
        residual = norm(sum(terms)) / max(sum(map(norm, terms)), np.finfo(float).tiny)
        stable = loop.slowest < -_LEAST_DECAY * norm(rate, 2)
        if settled and stable and residual <= _OF_TERMS:
            back = np.linalg.inv(T)
            return np.linalg.solve(upper, K @ back), symmetric_part(back.T @ P @ back), float(residual)
    return None


class LyapunovEquations:
    """`A X + X A' + step A X A' + Q = 0` and its adjoint for many Q, by the real Schur form of A.

    A sampled loop is first transformed to a continuous one (Cayley): Bartels and Stewart, Comm. ACM 15(9), 1972.
    """

    def __init__(self, A: Floats, step: float = 0.0) -> None:
        # (2 + step A)^-1, by which a sampled equation becomes a continuous one of A (1 + step A / 2)^-1.
        self._half = np.linalg.inv(np.eye(len(A)) + 0.5 * step * A)
        self._schur, self._basis = scipy.linalg.schur(A @ self._half)
        self.slowest = float(np.linalg.eigvals(self._schur).real.max())
        if not self.slowest < 0.0:
            raise SettingError(
                f"a loop with a pole at {self.slowest:.3g} 1/s is not stable, so its rms values do not exist"
            )

    def covariance(self, Q: Floats) -> Floats:
        """X of `A X + X A' + step A X A' + Q = 0`."""
        return self._solve(self._half @ Q @ self._half.T, "N", "T")

    def cost(self, Q: Floats) -> Floats:
        """P of `A'P + P A + step A'P A + Q = 0`."""
        return self._solve(self._half.T @ Q @ self._half, "T", "N")

    def _solve(self, Q: Floats, *forms: str) -> Floats:
        right = -self._basis.T @ Q @ self._basis
        solution, scale, _ = scipy.linalg.lapack.dtrsyl(self._schur, self._schur, right, *forms)
        return symmetric_part(self._basis @ solution @ self._basis.T / scale)


def mean_squares(rows: Floats, covariance: Floats) -> Floats:
    """Mean squares of rows @ x of a covariance of x, shape (n_rows,); of tiny ones rounding leaves none negative."""
    return np.asarray(np.maximum(np.einsum("ij,jk,ik->i", rows, covariance, rows), 0.0))


# A solution takes about this time [s] times the cube of the number of states; from so many states on, and above this
# time [s], it is announced.
_SECONDS = 2e-7
_MANY_STATES, _LONG = 250, 5.0


def _columns(name: str, matrix: ArrayLike) -> int:
    shape = np.shape(matrix)
    if len(shape) not in (2, 3):
        raise SettingError(
            f"`{name}` has shape {shape}; give a matrix, or a stack of matrices, one for each row of the batch"
        )
    return int(shape[-1])


def _stack(name: str, value: ArrayLike, rows: int, columns: int) -> Floats:
    """Array with a leading batch axis for the core; the axis has length one if all rows share the matrix."""
    matrices = np.asarray(value, dtype=np.float64)
    if matrices.ndim not in (2, 3) or matrices.shape[-2:] != (rows, columns):
        raise SettingError(
            f"`{name}` has shape {matrices.shape}; give ({rows}, {columns}), or a stack of such matrices, one for each "
            "row of the batch"
        )
    return np.ascontiguousarray(matrices.reshape(-1, rows, columns))


def _transpose(matrices: Floats) -> Floats:
    return np.ascontiguousarray(np.swapaxes(matrices, 1, 2))


def _scaling(matrix: ArrayLike | None, n: int) -> dict[str, Floats]:
    stacks = {} if matrix is None else {"scaling": _stack("scaling", matrix, n, n)}
    if any(np.any(np.linalg.slogdet(T)[0] == 0.0) for T in stacks.values()):
        raise SettingError("`scaling` is singular; give coordinates of the whole state")
    return stacks


def attempt_each(make: Callable[[T], U], many: Iterable[T]) -> list[U | SettingError]:
    """Result of a function for each item, or the error that it raised."""
    outcomes: list[U | SettingError] = []
    for item in many:
        try:
            outcomes.append(make(item))
        except SettingError as reason:
            outcomes.append(reason)
    return outcomes


def only(outcomes: Sequence[U | SettingError]) -> U:
    """The one result of a batch of one, whose error is raised."""
    (outcome,) = outcomes
    if isinstance(outcome, SettingError):
        raise outcome
    return outcome


def solve_together(
    solve: Callable[[list[T]], Iterable[U | SettingError]], many: Sequence[T | SettingError]
) -> list[U | SettingError]:
    """Results of one call for all items that are not errors; errors keep their places."""
    sound = [item for item in many if not isinstance(item, SettingError)]
    solved = iter(solve(sound) if sound else ())
    return [item if isinstance(item, SettingError) else next(solved) for item in many]
