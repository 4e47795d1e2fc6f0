"""The peers of the loop benchmark compute the same runs, and its summary says what was measured."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mrwork.errors import MrworkError, SettingError
from studies.speed import loop_ours
from studies.speed.loop import Measured, bench_loop, summarise
from studies.speed.loop_numba import LIBRARY, SERIES, series_tanh
from studies.speed.loop_plain import PlainLoop, by_python_control, by_solve_ivp
from studies.speed.loop_workload import LARGEST_COMMAND, N_REDUCTIONS, N_STOREYS, LoopWorkload, loop_workload

# 1500 steps, sums formed in different orders; bang-bang, but no decision is near enough to a tie to be turned.
AGREEMENT = 1e-11
Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]


@pytest.fixture(scope="module")
def workload() -> LoopWorkload:
    # Three candidates fill no block; the device yields and the command switches within 1.5 s.
    return loop_workload(3, 2, 1.5)


@pytest.fixture(scope="module")
def reference(workload: LoopWorkload) -> Floats:
    runs = [[PlainLoop.of(workload, candidate).run(motion) for candidate in range(3)] for motion in range(2)]
    return np.array(runs)


def test_ours_finds_what_plain_steps_find(workload: LoopWorkload, reference: Floats) -> None:
    np.testing.assert_allclose(loop_ours.prepare(workload, 1)(), reference, rtol=AGREEMENT)


def test_numba_finds_what_plain_steps_find(workload: LoopWorkload, reference: Floats) -> None:
    pytest.importorskip("numba", reason="numba is not installed; pip install 'mrwork[bench]'")
    from studies.speed import loop_numba

    np.testing.assert_allclose(loop_numba.prepare(workload, SERIES[1])(), reference, rtol=AGREEMENT)


def test_the_scalar_loop_for_numba_finds_what_plain_steps_find(
    workload: LoopWorkload, monkeypatch: pytest.MonkeyPatch
) -> None:
    numba = pytest.importorskip("numba", reason="numba is not installed; pip install 'mrwork[bench]'")
    from studies.speed import loop_numba

    # Uncompiled, a few steps of one run: the blocks above show what the compiler makes of the same equations.
    monkeypatch.setattr(numba.config, "DISABLE_JIT", True)
    few = workload.cut(candidates=1, motions=1, n_steps=200)
    found = loop_numba.prepare(few, LIBRARY[0])()
    np.testing.assert_allclose(found[0, 0], PlainLoop.of(few, 0).run(0), rtol=AGREEMENT)


@pytest.mark.parametrize("side_by_side", [0, 1])
def test_jax_finds_what_plain_steps_find(
    side_by_side: int, workload: LoopWorkload, reference: Floats
) -> None:
    from studies.speed import loop_jax

    variant = loop_jax.LoopJaxVariant(side_by_side=side_by_side)
    np.testing.assert_allclose(loop_jax.prepare(workload, variant)(), reference, rtol=AGREEMENT)


def test_solve_ivp_comes_near_what_our_steps_find(workload: LoopWorkload, reference: Floats) -> None:
    one = workload.cut(candidates=1, motions=1, n_steps=1500)
    # RK45 and RK4 at 1 ms: the loop of the damper turns within 0.1 mm of travel.
    np.testing.assert_allclose(by_solve_ivp(one)()[0, 0], reference[0, 0], rtol=1e-3)


def test_python_control_finds_what_plain_steps_find(workload: LoopWorkload, reference: Floats) -> None:
    pytest.importorskip("control", reason="python-control is not installed")
    one = workload.cut(candidates=1, motions=1, n_steps=1500)
    np.testing.assert_allclose(by_python_control(one)()[0, 0], reference[0, 0], rtol=AGREEMENT)


def test_what_enters_is_stored_or_dissipated(reference: Floats) -> None:
    taken, entered, *rest = np.moveaxis(reference[..., -5:], -1, 0)
    # Integrated with the steps' own weights: what is left is the error of the steps, at 1 ms with a sharp loop.
    np.testing.assert_allclose(entered, taken + sum(rest), rtol=1e-4)


def test_the_workload_switches_and_yields(reference: Floats) -> None:
    mean_command = reference[..., 6 * N_STOREYS + 7]
    assert (mean_command > 0.01 * LARGEST_COMMAND).all()
    assert (mean_command < 0.99 * LARGEST_COMMAND).all()
    # Beyond twice the friction of both dampers without current, the hysteresis is saturated.
    assert (reference[..., 6 * N_STOREYS + 2] > 4 * 32.0).all()


def test_more_candidates_leave_the_first_ones_and_the_motions_alone() -> None:
    few, many = loop_workload(1, 1, 0.5), loop_workload(3, 2, 0.5)
    np.testing.assert_array_equal(few.gains, many.gains[:1])
    np.testing.assert_array_equal(few.ground, many.ground[:1])


def test_the_tanh_by_series_keeps_its_digits() -> None:
    points = np.concatenate([[0.0], np.geomspace(1e-12, 30.0, 200)])
    for x in (*points, *-points):
        assert series_tanh(x) == pytest.approx(math.tanh(x), rel=1e-13, abs=0.0)


def measured(kept: Floats, seconds: float) -> Measured:
    return Measured(kept=kept.tolist(), seconds=seconds, compile_seconds=1.0, variant="as written")


def test_one_run_is_extrapolated_to_all_and_shared_among_threads() -> None:
    whole, one = np.ones((2, 4, N_REDUCTIONS)), np.full((1, 1, N_REDUCTIONS), 1.001)
    contenders = {"mrwork": measured(whole, 0.5), "solve_ivp": measured(one, 3.0)}
    ours, theirs = summarise(contenders, runs=8, threads=2)
    assert (ours.ratio, ours.extrapolated) == (1.0, False)
    assert (theirs.seconds, theirs.extrapolated) == (12.0, True)
    assert theirs.ratio == pytest.approx(24.0)


def test_a_run_that_differs_stops_the_benchmark() -> None:
    right, wrong = np.ones((2, 4, N_REDUCTIONS)), np.ones((2, 4, N_REDUCTIONS))
    wrong[1, 2, 7] += 1e-8
    with pytest.raises(MrworkError, match="agree on every run"):
        summarise({"numba": measured(right, 1.0), "jax": measured(wrong, 1.0)}, runs=8, threads=2)


def test_nothing_to_run_is_refused() -> None:
    with pytest.raises(SettingError, match="1 or more"):
        bench_loop(candidates=0)


def test_without_us_the_table_has_no_ratio() -> None:
    (row,) = summarise({"numba": measured(np.ones((2, 4, N_REDUCTIONS)), 2.0)}, runs=8, threads=1)
    assert row.ratio is None
