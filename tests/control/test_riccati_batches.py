"""Batches of regulators, filters and costs: exact, the same in every batch, and failures are values."""

import re
from itertools import product
from typing import Literal

import mpmath
import numpy as np
import pytest
import scipy.linalg
from control_samples import frame, plant, shear_frame
from loop_samples import design_problem
from refusals import refusal

import mrwork as mr
from mrwork.control import (
    Plant,
    accelerations,
    drifts,
    kalman_gains,
    lyapunov_function,
    lyapunov_solutions,
    observer_of,
    optimal_surface,
    regulator_gains,
    regulator_of_outputs,
    regulator_of_state,
)
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.control.linear.riccati import RiccatiSolutions, RiccatiStatus
from mrwork.errors import SettingError

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]


def costs(rng: np.random.Generator, rows: int, n: int, m: int) -> tuple[Floats, Floats, Floats]:
    """Q, R and N of weighed outputs y = C s + D f."""
    C, D = rng.standard_normal((rows, n, n)), rng.standard_normal((rows, n, m))
    back = np.swapaxes(C, 1, 2)
    return back @ C, np.swapaxes(D, 1, 2) @ D + np.eye(m), back @ D


def sampled(system: Plant, step: float) -> tuple[Floats, Floats]:
    """Transition over a step with held forces, in coordinates of the energy."""
    inverse = np.linalg.inv(system.scaling)
    n, m = system.B.shape
    whole = np.zeros((n + m, n + m))
    whole[:n] = np.hstack([inverse @ system.A @ system.scaling, inverse @ system.B]) * step
    exponential = scipy.linalg.expm(whole)
    return exponential[:n, :n], exponential[:n, n:]


def same_rows(one: RiccatiSolutions, other: RiccatiSolutions, row: int) -> None:
    """Row `row` of one is the only row of the other, bit for bit."""
    assert one.gain[row].tobytes() == other.gain[0].tobytes()
    assert one.P[row].tobytes() == other.P[0].tobytes()
    assert (one.residual[row], one.status[row]) == (other.residual[0], other.status[0])


@pytest.mark.parametrize("n_storeys", [3, 5, 10, 20])
@pytest.mark.parametrize("damping", [1.0, 1e-3])
def test_frames_have_the_gains_of_scipy(n_storeys: int, damping: float) -> None:
    """Also with a thousandth of the usual damping; SciPy is given the coordinates of the energy, where it does well."""
    building = shear_frame(n_storeys)
    building = frame("frame", building.mass, damping * building.damping, building.stiffness)
    system = plant(1, building)
    T = system.scaling
    inverse = np.linalg.inv(T)
    A, B = inverse @ system.A @ T, inverse @ system.B
    R = np.geomspace(1e-10, 1e-5, 5).reshape(-1, 1, 1)
    found = regulator_gains(system.A, system.B, system.energy, R, scaling=T)
    assert found.solved.all()
    assert found.residual.max() < 1e-14 * n_storeys
    for row, weight in enumerate(R):
        P = scipy.linalg.solve_continuous_are(A, B, np.eye(len(A)), weight)
        expected = B.T @ P / weight
        assert np.linalg.norm(found.gain[row] @ T - expected) <= 1e-7 * np.linalg.norm(expected)
    Ad, Bd = sampled(system, 0.01)
    found = regulator_gains(Ad, Bd, np.eye(len(A)), R, time="discrete")
    assert found.solved.all()
    for row, weight in enumerate(R):
        P = scipy.linalg.solve_discrete_are(Ad, Bd, np.eye(len(A)), weight)
        assert np.linalg.norm(found.P[row] - P) <= 1e-7 * np.linalg.norm(P)


@pytest.mark.parametrize("time", ["continuous", "discrete"])
def test_random_equations_are_met_in_sixty_digits(time: Literal["continuous", "discrete"]) -> None:
    """The residual is formed without rounding, so it is that of P, and P is stabilising."""
    rng = np.random.default_rng(11)
    for n, m in ((2, 1), (5, 2), (8, 3)):
        rows = 4
        A, B = rng.standard_normal((rows, n, n)), rng.standard_normal((rows, n, m))
        Q, R, N = costs(rng, rows, n, m)
        found = regulator_gains(A, B, Q, R, N, time=time)
        assert found.solved.all()
        for row in range(rows):
            poles = np.linalg.eigvals(A[row] - B[row] @ found.gain[row])
            assert (poles.real.max() if time == "continuous" else np.abs(poles).max() - 1.0) < 0.0
            with mpmath.workdps(60):
                a, b, q, r, c, p = (mpmath.matrix(each[row].tolist()) for each in (A, B, Q, R, N, found.P))
                if time == "continuous":
                    terms = [a.T * p, p * a, -(p * b + c) * r**-1 * (b.T * p + c.T), q]
                else:
                    half = a.T * p * b + c
                    terms = [a.T * p * a, -p, -half * (r + b.T * p * b) ** -1 * half.T, q]
                left = sum(terms[1:], terms[0])
                size = sum(mpmath.mnorm(term, "f") for term in terms)
                assert mpmath.mnorm(left, "f") <= 1e-13 * size


@pytest.mark.parametrize("time", ["continuous", "discrete"])
def test_batch_and_threads_do_not_change_a_bit(time: Literal["continuous", "discrete"]) -> None:
    rng = np.random.default_rng(12)
    rows, n, m = 45, 6, 2
    A, B = rng.standard_normal((rows, n, n)), rng.standard_normal((rows, n, m))
    Q, R, N = costs(rng, rows, n, m)
    whole = regulator_gains(A, B, Q, R, N, time=time, threads=1)
    other = regulator_gains(A, B, Q, R, N, time=time, threads=2)
    for row in range(rows):
        one = slice(row, row + 1)
        same_rows(whole, regulator_gains(A[one], B[one], Q[one], R[one], N[one], time=time), row)
    for name in ("gain", "P", "residual", "status"):
        assert getattr(whole, name).tobytes() == getattr(other, name).tobytes()


def test_matrices_that_all_rows_share_are_given_once() -> None:
    system = plant(2)
    R = np.geomspace(1e-9, 1e-6, 11)[:, None, None] * np.eye(2)
    shared = regulator_gains(system.A, system.B, system.energy, R, scaling=system.scaling)
    wide = [np.broadcast_to(matrix, (11, *matrix.shape)) for matrix in (system.A, system.B, system.energy)]
    scaling = np.broadcast_to(system.scaling, (11, 6, 6))
    same = regulator_gains(*wide, R, np.zeros((11, 6, 2)), scaling=scaling)
    assert shared.gain.tobytes() == same.gain.tobytes()


def test_rows_without_a_solution_leave_their_neighbours_alone() -> None:
    rng = np.random.default_rng(13)
    A, B = rng.standard_normal((20, 4, 4)), rng.standard_normal((20, 4, 1))
    clean = regulator_gains(A, B, np.eye(4), np.eye(1))
    R = np.ones((20, 1, 1))
    A[3], B[3] = (
        np.diag([-1.0, 2.0, -1.0, -1.0]),
        [[1.0], [0.0], [1.0], [1.0]],
    )  # it grows, and is not reached
    R[8] = -1.0
    A[15], B[15] = np.diag([0.0, -1.0, -2.0, -3.0]), 0.0  # it neither grows nor decays
    found = regulator_gains(A, B, np.eye(4), R)
    assert found.status[3] == found.status[15] == RiccatiStatus.NO_STABILISING_SOLUTION
    assert found.status[8] == RiccatiStatus.WEIGHT_NOT_POSITIVE
    failed = [3, 8, 15]
    assert np.isinf(found.gain[failed]).all()
    assert np.isinf(found.P[failed]).all()
    kept = [row for row in range(20) if row not in failed]
    assert found.solved.tolist() == [row not in failed for row in range(20)]
    assert found.gain[kept].tobytes() == clean.gain[kept].tobytes()
    assert found.residual[kept].tobytes() == clean.residual[kept].tobytes()
    refusal(found.check, 3, match="no stabilising solution")
    refusal(found.check, 8, match="not positive definite")
    found.check(0)


@pytest.mark.parametrize("time", ["continuous", "discrete"])
def test_kalman_gains_are_those_of_the_transposed_regulator(time: Literal["continuous", "discrete"]) -> None:
    """And the covariance is that of the error, by the Lyapunov equation of the estimate."""
    rng = np.random.default_rng(14)
    rows, n, m = 3, 5, 2
    A, C = rng.standard_normal((rows, n, n)), rng.standard_normal((rows, m, n))
    noise = rng.standard_normal((rows, n + m, n + m))
    noise = noise @ np.swapaxes(noise, 1, 2)
    W, V, S = noise[:, :n, :n], noise[:, n:, n:], noise[:, :n, n:]
    found = kalman_gains(A, C, W, V, S, time=time)
    assert found.solved.all()
    assert found.gain.shape == (rows, n, m)
    L = found.gain
    turned = np.swapaxes(L, 1, 2)
    error = A - L @ C
    driven = W - L @ np.swapaxes(S, 1, 2) - S @ turned + L @ V @ turned
    covariance = lyapunov_solutions(np.swapaxes(error, 1, 2), driven, time=time)
    assert covariance.solved.all()
    np.testing.assert_allclose(covariance.P, found.P, rtol=1e-8, atol=1e-9 * np.abs(found.P).max())
    scaled = kalman_gains(A, C, W, V, S, time=time, scaling=np.diag([1.0, 1e2, 1.0, 1e-2, 3.0]))
    np.testing.assert_allclose(scaled.gain, found.gain, rtol=1e-8, atol=1e-9 * np.abs(L).max())


def test_lyapunov_solutions_are_those_of_scipy() -> None:
    rng = np.random.default_rng(15)
    A = rng.standard_normal((6, 7, 7)) - 4.0 * np.eye(7)
    Q = rng.standard_normal((6, 7, 7))
    Q = Q @ np.swapaxes(Q, 1, 2)
    found = lyapunov_solutions(A, Q)
    assert found.gain.shape == (6, 0, 7)
    for row in range(6):
        expected = scipy.linalg.solve_continuous_lyapunov(A[row].T, -Q[row])
        np.testing.assert_allclose(found.P[row], expected, rtol=1e-9, atol=1e-11)
    A[2] += 9.0 * np.eye(7)
    assert lyapunov_solutions(A, Q).solved.tolist() == [True, True, False, True, True, True]


# A weight of the wrong shape and one beyond double precision among them.
REGULATORS: list[dict[str, object]] = [
    {"control_weight": weight} for weight in (1e-9, (1e-9, 1e-9), 1e-7, 1e-90, 1e-8)
]
SURFACES: list[dict[str, object]] = [
    {"peak_acceleration": peak, "largest_force": 2000.0, "bandwidth": width}
    for peak, width in ((1.0, 50.0), (3.0, 150.0))
]
LYAPUNOV: list[dict[str, object]] = [
    {},
    {"drifts": 1.0, "velocities": 2.0},
    {"drifts": (1.0, 2.0)},
    {"energy": 3.0},
]
FAMILIES: dict[str, list[dict[str, object]]] = {
    "clipped_optimal": REGULATORS,
    "modified_clipped_optimal": [{**each, "full_force": 100.0} for each in REGULATORS],
    **dict.fromkeys(
        ("lyapunov", "lyapunov_direct", "lyapunov_parabola", "lyapunov_direct_bang_bang"), LYAPUNOV
    ),
    "proportional_direct": [
        {"slope": 1e-3 * (number + 1), **weights, **R}
        for number, (weights, R) in enumerate(product(LYAPUNOV, ({}, {"control_weight": 1e-9})))
    ],
    **dict.fromkeys(("sliding_mode", "adaptive_sliding_mode", "super_twisting"), SURFACES),
}


@pytest.mark.parametrize("law", FAMILIES)
def test_a_family_of_designs_is_that_of_each_alone(law: str) -> None:
    many = [SETTINGS[law](**each) for each in FAMILIES[law]]
    wrong = ((1.0, 2.0), (1e-9, 1e-9), 1e-90)
    refused = [any(value in wrong for value in each.values()) for each in FAMILIES[law]]
    found = SETTINGS[law].designs(design_problem(), many)
    assert [isinstance(each, SettingError) for each in found] == refused
    for settings, together in zip(many, found, strict=True):
        if isinstance(together, SettingError):
            refusal(settings.design, design_problem(), match=re.escape(str(together)))
            continue
        alone = settings.design(design_problem())
        assert together.gains.keys() == alone.gains.keys()
        for name, gain in alone.gains.items():
            assert together.gains[name].tobytes() == gain.tobytes()


@pytest.mark.parametrize("n_storeys", [1, 2, 8, 40])
def test_every_design_is_found_for_low_and_tall_buildings(n_storeys: int) -> None:
    """Sensors of a hundred-millionth of the ground's intensity among them, on which the pencil of SciPy fails at 8."""
    for n_devices in {1, min(n_storeys, 4)}:
        system = plant(n_devices, shear_frame(n_storeys))
        undamped = np.linalg.eigvals(system.A).real.max()
        for regulator in (
            regulator_of_state(system, system.energy, 1e-9),
            regulator_of_outputs(system, drifts(system), np.full(n_storeys, 1e6), 1e-13),
            regulator_of_outputs(system, accelerations(system), np.ones(n_storeys), 1e-17),
        ):
            assert regulator.residual < 1e-9
            assert regulator.poles.real.max() < 0.0
        assert undamped < 0.0
        lyapunov_function(system)
        assert optimal_surface(system).poles.real.max() < 0.0
        for noise in (0.02, 1e-8):
            observer = observer_of(system, accelerations(system), 1e-3, noise_intensity=noise)
            decay = np.linalg.solve(
                system.scaling, (observer.Ad - observer.gain @ observer.C) @ system.scaling
            )
            assert np.abs(np.linalg.eigvals(decay)).max() < 1.0


def test_a_regulator_beyond_double_precision_is_refused() -> None:
    """The roof of forty storeys, from a device at the ground, for next to nothing."""
    system = plant(1, shear_frame(40))
    weights = np.append(np.zeros(39), 1.0)
    refusal(regulator_of_outputs, system, accelerations(system), weights, 1e-24, match="extreme ratio")


def equal_storeys(damping_ratio: float) -> Plant:
    """Four equal storeys with a damper in the first; mode 2 has no drift in the second."""
    frame = mr.buildings.shear_building(name="four", masses=[300.0] * 4, stiffnesses=[4e5] * 4)
    frame = mr.buildings.with_modal_damping(frame, ratios=[damping_ratio])
    return mr.control.plant_of(frame, frame.storeys[:1])


def test_an_undamped_mode_that_no_weight_sees_leaves_none() -> None:
    """Rounding alone would weigh it."""
    system = equal_storeys(0.0)
    second = drifts(system).select(["drift storey 2"])
    refusal(regulator_of_outputs, system, second, 1.0, 1e-9, match="every mode that is not damped")


@pytest.mark.parametrize("time", ["continuous", "discrete"])
def test_nothing_that_is_weighed_costs_no_force_but_for_stability(
    time: Literal["continuous", "discrete"],
) -> None:
    """Without weights the regulator of a stable plant rests; that of an unstable one mirrors its unstable poles."""
    rng = np.random.default_rng(11)
    one, nothing = np.eye(2), np.zeros((6, 6))
    for _ in range(20):
        A, B = rng.standard_normal((6, 6)), rng.standard_normal((6, 2))
        A -= (np.linalg.eigvals(A).real.max() + 0.05) * np.eye(6)
        unstable = A + 0.5 * np.eye(6)
        if time == "discrete":
            A, unstable = scipy.linalg.expm(0.2 * A), scipy.linalg.expm(0.2 * unstable)
        assert not regulator_gains(A, B, nothing, one, time=time).gain.any()
        assert not kalman_gains(A, B.T, nothing, one, time=time).gain.any()
        assert not lyapunov_solutions(A, nothing, time=time).P.any()
        found = regulator_gains(unstable, B, nothing, one, time=time)
        found.check()
        poles = np.linalg.eigvals(unstable)
        mirrored = (
            np.where(poles.real < 0.0, poles, -poles.conj())
            if time == "continuous"
            else np.where(np.abs(poles) < 1.0, poles, 1.0 / poles.conj())
        )
        closed = np.linalg.eigvals(unstable - B @ found.gain[0])
        assert np.abs(closed[:, None] - mirrored).min(axis=0).max() < 1e-6


@pytest.mark.parametrize("time", ["continuous", "discrete"])
@pytest.mark.parametrize("decay", [0.3, -0.3])
def test_parts_that_no_weight_sees_have_the_gain_of_scipy(
    time: Literal["continuous", "discrete"], decay: float
) -> None:
    """Stable and unstable, of units of any size; a stable part without weight gets no force."""
    rng = np.random.default_rng(12)
    for _ in range(40):
        n_seen, n_hidden = rng.integers(1, 6, 2)
        n = n_seen + n_hidden
        A = np.tril(rng.standard_normal((n, n)))
        A[:n_seen, :n_seen] = rng.standard_normal((n_seen, n_seen))
        A[n_seen:, n_seen:] -= (A[n_seen:, n_seen:].diagonal().max() + decay) * np.eye(n_hidden)
        A[:n_seen, n_seen:] = 0.0
        B, C = rng.standard_normal((n, 2)), np.zeros((2, n))
        C[:, :n_seen] = rng.standard_normal((2, n_seen))
        turn = np.linalg.qr(rng.standard_normal((n, n)))[0]
        A, B, C = turn @ A @ turn.T, turn @ B, C @ turn.T
        if time == "discrete":
            A, B = scipy.linalg.expm(0.1 * A), 0.1 * B
        R = np.diag(10.0 ** rng.uniform(-4, 2, 2))
        solve = scipy.linalg.solve_discrete_are if time == "discrete" else scipy.linalg.solve_continuous_are
        P = solve(A, B, C.T @ C, R)
        gain = (
            np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
            if time == "discrete"
            else np.linalg.solve(R, B.T @ P)
        )
        units = 10.0 ** rng.uniform(-4, 4, n)
        found = regulator_gains(
            A * units[:, None] / units, B * units[:, None], (C / units).T @ (C / units), R, time=time
        )
        found.check()
        root = np.sqrt(R)
        assert np.linalg.norm(root @ (found.gain[0] * units - gain)) < 1e-6 * np.linalg.norm(root @ gain)
