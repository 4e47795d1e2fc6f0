"""Weights of outputs and states: matrices, cross terms, refusals; against formulas written out from M, C and K."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from refusals import refusal
from study_texts import study_text

import mrwork as mr
from mrwork.control import DesignProblem, design_law
from mrwork.control.laws.lyapunov import LyapunovSettings, ProportionalSettings
from mrwork.control.laws.regulator_settings import RegulatorSettings
from mrwork.study import read_study

M, C, K = np.diag([2.0, 1.0, 1.5]), np.zeros((3, 3)), np.zeros((3, 3))
for _below, (_stiffness, _damping) in enumerate(((300.0, 1.0), (200.0, 0.7), (100.0, 0.4))):
    _row = np.eye(3)[_below] - (np.eye(3)[_below - 1] if _below else 0.0)
    K += _stiffness * np.outer(_row, _row)
    C += _damping * np.outer(_row, _row)
ROWS = np.eye(3) - np.eye(3, k=-1)
FULL = np.array([[2.0, -1.0, 0.3], [-1.0, 1.5, -0.2], [0.3, -0.2, 0.8]])
STATE = np.eye(6) + 0.2 * np.ones((6, 6))


def problem(**changes: Any) -> DesignProblem:
    rd1005 = mr.damper("static_hysteretic").preset("kwok2006")
    frame = mr.buildings.shear_building(
        name="small", masses=np.diag(M), stiffnesses=[300.0, 200.0, 100.0], storey_damping=[1.0, 0.7, 0.4]
    )
    devices = [
        mr.Device(
            name=f"device {storey + 1}",
            spec=rd1005.spec,
            theta=rd1005.theta,
            row=frame.storeys[storey],
            largest_command=1.88,
            **changes,
        )
        for storey in (0, 1)
    ]
    return DesignProblem(building=frame, devices=devices, sample_time=1e-3)


def system() -> tuple[np.ndarray, np.ndarray]:
    """A and B of s = [q; q'] from the matrices; a positive force pulls the ends of its storey together."""
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    B = np.vstack([np.zeros((3, 2)), -np.linalg.solve(M, ROWS[:2].T)])
    return A, B


def outputs(name: str) -> tuple[np.ndarray, np.ndarray]:
    """C and D of y = C s + D f."""
    A, B = system()
    none = np.zeros((3, 3))
    rows = {
        "displacements": np.hstack([np.eye(3), none]),
        "drifts": np.hstack([ROWS, none]),
        "velocities": np.hstack([none, np.eye(3)]),
        "relative_velocities": np.hstack([none, ROWS]),
        "accelerations": A[3:],
        "rates": np.hstack([np.zeros((2, 3)), ROWS[:2]]),
        "state_weight": np.eye(6),
    }[name]
    return rows, B[3:] if name == "accelerations" else np.zeros((len(rows), 2))


NAMES = (
    "displacements",
    "drifts",
    "velocities",
    "relative_velocities",
    "accelerations",
    "rates",
    "state_weight",
)
R = np.array([[0.02, 0.005], [0.005, 0.03]])


def weight(name: str) -> np.ndarray:
    return {"state_weight": STATE, "rates": FULL[:2, :2]}.get(name, FULL)


def terms(names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Q, N and R of the sum of the weights."""
    Q, N, S = np.zeros((6, 6)), np.zeros((6, 2)), R.copy()
    for name in names:
        (rows, direct), W = outputs(name), weight(name)
        Q, N, S = Q + rows.T @ W @ rows, N + rows.T @ W @ direct, S + direct.T @ W @ direct
    return Q, N, S


@pytest.mark.parametrize(
    "names", [*((name,) for name in NAMES), NAMES], ids=lambda names: "+".join(names)[:24]
)
def test_a_regulator_solves_the_riccati_equation_of_its_weights(names: tuple[str, ...]) -> None:
    A, B = system()
    Q, N, S = terms(names)
    P = scipy.linalg.solve_continuous_are(A, B, Q, S, s=N)
    settings = RegulatorSettings(control_weight=R, **{name: weight(name) for name in names})
    law = design_law("clipped_optimal", problem(), settings)
    expected = np.linalg.solve(S, B.T @ P + N.T)
    np.testing.assert_allclose(law.gains["gain"], expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())
    # With N left out the gain of an acceleration weight is another one.
    if "accelerations" in names:
        without = scipy.linalg.solve_continuous_are(A, B, Q, S)
        assert np.abs(np.linalg.solve(S, B.T @ without) - expected).max() > 1e-2 * np.abs(expected).max()


def test_weights_of_rates_alone_ask_for_dashpots_where_the_frame_hardly_damps() -> None:
    """Exactly so without damping: P of the mechanical energy then solves the Riccati equation."""
    law = design_law("clipped_optimal", problem(), RegulatorSettings(rates=9.0, control_weight=1e-2))
    dashpot = np.hstack([np.zeros((2, 3)), -ROWS[:2]]) * 30.0
    # A displacement counts as the velocity that it has at the first frequency.
    first = np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True)[0])
    gain = np.asarray(law.gains["gain"]) / np.repeat([first, 1.0], 3)
    assert np.abs(gain - dashpot).max() < 0.08 * np.abs(dashpot).max()


@pytest.mark.parametrize(
    "names", [*((name,) for name in NAMES), NAMES], ids=lambda names: "+".join(names)[:24]
)
def test_a_lyapunov_function_is_the_cost_of_free_vibration(names: tuple[str, ...]) -> None:
    """`s'P s = int y'W y dt` without device forces; the linear equations of P written out by Kronecker products."""
    A, B = system()
    Q = terms(names)[0]
    equations = np.kron(np.eye(6), A.T) + np.kron(A.T, np.eye(6))
    P = np.linalg.solve(equations, -Q.ravel()).reshape(6, 6)
    settings = LyapunovSettings(**{name: weight(name) for name in names})
    law = design_law("lyapunov", problem(), settings)
    expected = B.T @ P
    np.testing.assert_allclose(law.gains["weight"], expected, rtol=1e-7, atol=1e-8 * np.abs(expected).max())


def test_the_proportional_law_has_the_cross_term_of_its_regulator() -> None:
    weights = {"accelerations": FULL, "control_weight": R}
    regulator = RegulatorSettings(**weights).regulator(problem())
    law = design_law("proportional_direct", problem(), ProportionalSettings(slope=1.0, **weights))
    np.testing.assert_allclose(law.gains["weight"], regulator.control_weight @ regulator.gain, rtol=1e-6)


def test_a_diagonal_is_the_matrix_with_that_diagonal() -> None:
    diagonal = [1.0, 2.0, 3.0]
    found = [
        design_law("clipped_optimal", problem(), {"control_weight": 1e-2, "drifts": drifts}).gains["gain"]
        for drifts in (diagonal, np.diag(diagonal), tuple(map(tuple, np.diag(diagonal).tolist())))
    ]
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])
    assert hash(RegulatorSettings(control_weight=1e-2, drifts=np.eye(3))) == hash(
        RegulatorSettings(control_weight=1e-2, drifts=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    )


REFUSED = [
    ("drifts", np.eye(4), r"\(4, 4\), and there are 3 storeys"),
    ("drifts", [[1.0, 0.0], [0.0]], "different lengths"),
    ("accelerations", np.triu(np.ones((3, 3))), "row 1, column 2"),
    ("velocities", np.eye(3) - 0.5, "smallest eigenvalue"),
    ("control_weight", np.eye(3), "2 devices"),
    ("control_weight", [[1.0, 2.0], [2.0, 1.0]], "smallest eigenvalue"),
]


@pytest.mark.parametrize(("name", "given", "words"), REFUSED)
def test_a_weight_that_cannot_be_is_told(name: str, given: Any, words: str) -> None:
    refusal(design_law, "clipped_optimal", problem(), {"control_weight": 0.01, name: given}, match=words)


def test_a_study_file_gives_matrices_inline_or_by_file(tmp_path: Path) -> None:
    matrix = np.eye(5) + 0.1
    (tmp_path / "weights.csv").write_text("\n".join(",".join(map(str, row)) for row in matrix))
    (tmp_path / "diagonal.txt").write_text("1 1 1 1 2\n")

    def gain(weights: str) -> np.ndarray:
        path = tmp_path / "study.toml"
        path.write_text(study_text(f"control_weight = 1e-9\n{weights}"))
        return np.asarray(read_study(path).arrangements[-1].law.gains["gain"])

    inline = gain(f"drifts = {matrix.tolist()}")
    np.testing.assert_array_equal(gain("drifts = 'weights.csv'"), inline)
    np.testing.assert_array_equal(gain("drifts = 'diagonal.txt'"), gain("drifts = [1, 1, 1, 1, 2]"))
    negative = np.eye(5)
    negative[0, 1] = negative[1, 0] = -0.5
    assert np.abs(gain(f"drifts = {negative.tolist()}") - inline).max() > 0.0
    refusal(gain, "drifts = 'none.csv'", match="line 17: .*none.csv: there is no such file")
    refusal(gain, f"drifts = {np.triu(matrix).tolist()}", match="line 17: drifts is not symmetric")
