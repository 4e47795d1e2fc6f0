"""Batches of regulators, filters and costs: exact, the same in every batch, and failures are values."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Literal

import mpmath
import numpy as np
import pytest
import scipy.linalg
from control_samples import frame, plant, shear_frame
from sentences import Refused

import mrwork as mr
from mrwork.control import (
    SETTINGS,
    Design,
    DesignProblem,
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
    regulators_of_weights,
)
from mrwork.control.laws.law_problem import LawSettings
from mrwork.control.linear import riccati
from mrwork.control.linear.lqr import Regulator, Weighed, regulator_of_weights, weighed_outputs
from mrwork.control.linear.riccati import RiccatiSolutions, RiccatiStatus
from mrwork.errors import MrworkWarning, SettingError

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]


@pytest.fixture(scope="module")
def design_problem() -> DesignProblem:
    building, rd1005 = mr.building("uts"), mr.damper("static_hysteretic").preset("kwok2006")
    device = mr.Device(
        name="storey 1", spec=rd1005.spec, theta=rd1005.theta, row=building.storeys[0], largest_command=1.88
    )
    return DesignProblem(building=building, devices=[device], sample_time=1e-3)


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


def test_rows_without_a_solution_leave_their_neighbours_alone(refused: Refused) -> None:
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
    refused(found.check, 3)
    refused(found.check, 8)
    found.check(0)
    assert "no stabilising solution" in repr(found)


def test_what_does_not_fit_is_refused(refused: Refused) -> None:
    for change in (
        {"A": np.eye(3)},
        {"A": np.ones(2)},
        {"A": np.ones((2, 3))},
        {"state_weight": np.eye(3)},
        {"control_weight": np.eye(2)},
        {"cross_weight": np.ones((1, 2))},
        {"scaling": np.eye(3)},
        {"state_weight": np.diag([1.0, np.nan])},
        {"control_weight": np.full((3, 1, 1), np.inf)},
        {"A": np.zeros((3, 2, 2)), "control_weight": np.ones((4, 1, 1))},
        {"time": "sampled"},
        {"threads": -1},
        {"threads": 1.5},
        {"scaling": np.zeros((2, 2))},
        {"state_weight": "x"},
        {"state_weight": 1j * np.eye(2)},
    ):
        given: dict[str, object] = {
            "A": -np.eye(2),
            "B": np.ones((2, 1)),
            "state_weight": np.eye(2),
            "control_weight": np.eye(1),
        }
        refused(regulator_gains, **(given | change))


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


def test_many_regulators_are_those_that_are_designed_alone() -> None:
    system = plant(1)
    outputs = accelerations(system)
    weighed = [weighed_outputs(outputs, np.diag(row)) for row in np.eye(3)]
    weights = [1e-7, [1e-7, 1e-7], 1e-6]
    found = regulators_of_weights(system, weighed, weights)
    assert isinstance(found[1], SettingError)
    assert "control_weight has 2 weights" in str(found[1])
    for row in (0, 2):
        alone = regulator_of_weights(system, weighed[row], weights[row])
        together = found[row]
        assert isinstance(together, Regulator)
        assert together.gain.tobytes() == alone.gain.tobytes()
        assert together.riccati.tobytes() == alone.riccati.tobytes()
    none = Weighed(Q=np.zeros((6, 6)), N=np.zeros((6, 1)), S=np.zeros((1, 1)))
    assert isinstance(regulators_of_weights(system, [none], [0.0])[0], SettingError)


def test_one_state_weight_goes_with_many_control_weights() -> None:
    system = plant(1)
    weights = [1e-7, 1e-6, -1.0, 1e-5]
    found = regulators_of_weights(system, [system.energy], weights)
    assert isinstance(found[2], SettingError)
    for row in (0, 1, 3):
        alone = regulator_of_state(system, system.energy, weights[row])
        together = found[row]
        assert isinstance(together, Regulator)
        assert together.gain.tobytes() == alone.gain.tobytes()


@pytest.mark.parametrize("law", ["clipped_optimal", "modified_clipped_optimal"])
def test_many_laws_are_those_that_are_designed_alone(law: str, design_problem: DesignProblem) -> None:
    """A weight of the wrong shape and one beyond double precision among them."""
    more = {"full_force": 100.0} if law == "modified_clipped_optimal" else {}
    weights = (1e-9, (1e-9, 1e-9), 1e-7, 1e-90, 1e-8)
    many = [SETTINGS[law](control_weight=weight, **more) for weight in weights]
    found = SETTINGS[law].designs(design_problem, many)
    assert [isinstance(each, SettingError) for each in found] == [False, True, False, True, False]
    assert_each_alone(many, found, design_problem)


def assert_each_alone(
    many: Sequence[LawSettings], found: Sequence[Design | SettingError], problem: DesignProblem
) -> None:
    """Each design of a family has the bits, or the refusal, of the settings alone."""
    for settings, together in zip(many, found, strict=True):
        if isinstance(together, SettingError):
            with pytest.raises(SettingError, match=re.escape(str(together))):
                settings.design(problem)
        else:
            assert_same_bits(together, settings.design(problem))


def assert_same_bits(together: Design, alone: Design) -> None:
    assert together.gains.keys() == alone.gains.keys()
    for name, gain in alone.gains.items():
        assert together.gains[name].tobytes() == gain.tobytes()


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
def test_a_family_of_designs_is_that_of_each_alone(law: str, design_problem: DesignProblem) -> None:
    """Laws of Lyapunov functions, with a weight of the wrong shape among them, and of sliding surfaces."""
    many = [SETTINGS[law](**each) for each in FAMILIES[law]]
    refused = [each.get("drifts") == (1.0, 2.0) for each in FAMILIES[law]]
    found = SETTINGS[law].designs(design_problem, many)
    assert [isinstance(each, SettingError) for each in found] == refused
    assert_each_alone(many, found, design_problem)


@pytest.mark.parametrize("law", ["lyapunov", "proportional_direct"])
def test_a_building_without_damping_refuses_the_whole_family(law: str, design_problem: DesignProblem) -> None:
    building = design_problem.building
    undamped = replace(design_problem, building=replace(building, damping=np.zeros_like(building.damping)))
    many = [SETTINGS[law](**each) for each in FAMILIES[law] if "control_weight" not in each]
    for each in SETTINGS[law].designs(undamped, many):
        assert isinstance(each, SettingError)
        assert "drifts has 2 weights" in str(each) or "needs damping in every mode" in str(each)


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


def test_a_regulator_beyond_double_precision_is_refused(refused: Refused) -> None:
    """The roof of forty storeys, from a device at the ground, for next to nothing."""
    system = plant(1, shear_frame(40))
    weights = np.append(np.zeros(39), 1.0)
    refused(regulator_of_outputs, system, accelerations(system), weights, 1e-24)


def test_an_equation_of_many_states_says_its_time_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(riccati, "_MANY_STATES", 4)
    monkeypatch.setattr(riccati, "_LONG", 0.0)
    A, B = -np.eye(4), np.ones((4, 1))
    with pytest.warns(MrworkWarning, match="of 4 states takes about 0 s, and grows with their cube"):
        regulator_gains(A, B, np.eye(4), np.eye(1))
    monkeypatch.setattr(riccati, "_MANY_STATES", 5)
    assert regulator_gains(A, B, np.eye(4), np.eye(1)).solved.all()


def equal_storeys(damping_ratio: float) -> Plant:
    """Four equal storeys with a damper in the first; mode 2 has no drift in the second."""
    frame = mr.buildings.shear_building(name="four", masses=[300.0] * 4, stiffnesses=[4e5] * 4)
    frame = mr.buildings.with_modal_damping(frame, ratios=[damping_ratio])
    return mr.control.plant_of(frame, frame.storeys[:1])


@pytest.mark.parametrize("control_weight", [1e-4, 1e-9, 1e-14])
def test_a_damped_mode_that_no_weight_sees_leaves_a_solution(control_weight: float) -> None:
    """P is singular, and the residual is judged by the terms of the equation."""
    system = equal_storeys(0.02)
    outputs = drifts(system).select(["drift storey 2"])
    found = regulator_of_outputs(system, outputs, 1.0, control_weight)
    T, C = system.scaling, outputs.C @ system.scaling
    A, B = np.linalg.solve(T, system.A @ T), np.linalg.solve(T, system.B)
    P, R = T.T @ found.riccati @ T, np.array([[control_weight]])
    residual = A.T @ P + P @ A - P @ B @ B.T @ P / R + C.T @ C
    assert np.linalg.norm(residual) < 1e-9 * np.linalg.norm(C.T @ C)
    # Mode 2, which the weights do not see, stays as it is.
    w = system.building.frequencies[1] * 2.0 * np.pi
    assert np.abs(found.poles - w * (-0.02 + 1j * np.sqrt(1.0 - 0.02**2))).min() < 1e-6 * w
    assert found.poles.real.max() < -0.2
    of_scipy = scipy.linalg.solve_continuous_are(A, B, C.T @ C, R)
    # Without refinement, SciPy has some five digits.
    expected = np.linalg.solve(R, B.T @ of_scipy)
    assert np.linalg.norm(found.gain @ T - expected) < 1e-4 * np.linalg.norm(expected)


def test_an_undamped_mode_that_no_weight_sees_leaves_none() -> None:
    """Rounding alone would weigh it."""
    system = equal_storeys(0.0)
    with pytest.raises(SettingError, match="weigh, or measure, every mode that is not damped"):
        regulator_of_outputs(system, drifts(system).select(["drift storey 2"]), 1.0, 1e-9)


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


def test_a_frame_with_floors_that_turn_has_a_regulator() -> None:
    """Matrices of finite elements: rotations without mass to speak of give modes of some 30 kHz."""
    frame = mr.Building(
        name="beams",
        mass=np.diag([1e5, 0.02, 1e5, 0.02]),
        damping=np.zeros((4, 4)),
        stiffness=1e8
        * np.array(
            [[2.4, 0.0, -1.2, 1.8], [0.0, 7.2, -1.8, 1.8], [-1.2, -1.8, 1.2, -1.8], [1.8, 1.8, -1.8, 3.6]]
        ),
        influence=np.array([1.0, 0.0, 1.0, 0.0]),
        floors=np.eye(4)[[0, 2]],
        storeys=np.array([[1.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 1.0, 0.0]]),
        floor_names=("1", "2"),
        storey_names=("1", "2"),
    )
    frame = mr.buildings.with_modal_damping(frame, ratios=[0.02])
    system = mr.control.plant_of(frame, frame.storeys[:1])
    for control_weight in (1e-12, 1e-10, 1e-8):
        found = regulator_of_outputs(system, drifts(system), 1.0, control_weight)
        assert found.residual < 1e-7
        assert found.poles.real.max() < -0.02 * 2.0 * np.pi * frame.frequencies[0]
