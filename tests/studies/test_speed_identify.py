"""The benchmark of searches gives all of them the same job, and says what each of them made of it."""

from __future__ import annotations

import json
import os
import signal
import sys
from dataclasses import replace
from pathlib import Path

import measured_data
import numpy as np
import pytest
from command_line import started
from numpy.typing import NDArray

from mrwork.errors import SettingError
from studies.speed.attempt import (
    NEAR,
    Attempt,
    AttemptEnded,
    AttemptResult,
    Contender,
    attempted,
)
from studies.speed.command_line import main
from studies.speed.contenders import OURS, PEERS, contenders
from studies.speed.identify import bench_identify
from studies.speed.own_searches import EarlyAbort, attempted_at_once, contenders_at_once, early_aborts
from studies.speed.search_job import N_TIME, REFERENCE, SearchJob, record
from studies.speed.search_peers import SOLVERS, Solver, UsualWay, misfit_by
from studies.speed.search_rows import SearchRow, bars_of, extrapolated, row_of

EXTRA = "is not installed; pip install 'mrwork[bench]'"


@pytest.fixture
def job(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> SearchJob:
    monkeypatch.setenv("MRWORK_DATA", str(tmp_path))
    return SearchJob.of(record(REFERENCE), 1)


def scattered(job: SearchJob, count: int) -> NDArray[np.float64]:
    return job.theta(np.random.default_rng(5).random((count, job.n_params)))


def test_without_data_the_job_is_synthetic_and_of_the_same_length(job: SearchJob) -> None:
    assert job.test.synthetic
    assert (job.test.n_time, job.n_params) == (N_TIME, 8)


# The variant from which the benchmark starts, of blocks of 8, is compared by its quick run below.
@pytest.mark.parametrize(("block", "fastmath", "form"), [(1, False, "power"), (32, True, "exp_log")])
def test_numba_and_rust_objectives_are_the_same_job(
    job: SearchJob, block: int, fastmath: bool, form: str
) -> None:
    pytest.importorskip("numba", reason=f"numba {EXTRA}")
    from studies.speed.numba_objective import NumbaObjective
    from studies.speed.numba_peer import NumbaVariant

    theta = scattered(job, 100)
    # Of the stiffest there is, which no sub-steps resolve.
    theta[7, 4], theta[7, 5] = 1e7, 1e4
    variant = NumbaVariant(block=block, fastmath=fastmath, form=form)
    objective = NumbaObjective(job.objective, variant)
    (simulated,) = job.objective.misfits(theta)
    (substeps,) = objective.substeps(theta)
    finite = np.isfinite(simulated.squared_error)
    np.testing.assert_array_equal(substeps[finite], simulated.substeps[finite])
    assert finite.sum() == 99
    # Two thousand samples of some ten roundings each, of either sign; a contracting state forgets its own.
    # With and without residuals is compiled apart, so each variant is asked for one of the two.
    if fastmath:
        few = theta[5:9]
        np.testing.assert_allclose(objective.residuals(few), job.objective.residuals(few), rtol=0, atol=1e-11)
    else:
        np.testing.assert_allclose(objective(theta), job.objective(theta), rtol=1e-11)


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_usual_way_solves_the_same_equations(job: SearchJob, solver: Solver) -> None:
    unit = np.full((1, job.n_params), 0.4)
    theta = job.theta(unit)
    ours = float(job.objective(theta)[0])
    # The solvers' own tolerance is 1e-3 of the state, and their velocity is linear between samples.
    assert misfit_by(solver, job)(theta[0]) == pytest.approx(ours, rel=0.01)


def test_an_attempt_ends_at_the_target_and_at_the_budget(job: SearchJob) -> None:
    objective = job.objective
    unit = np.random.default_rng(0).random((4, job.n_params))
    least = float(job.objective(job.theta(unit)).min())
    reached = Attempt(job=job, objective=objective, target=least, budget=100)
    with pytest.raises(AttemptEnded):
        reached.misfits(unit)
    assert reached.success
    spent = Attempt(job=job, objective=objective, target=0.5 * least, budget=8)
    spent.misfits(unit)
    with pytest.raises(AttemptEnded):
        spent.residuals(unit)
    assert (spent.success, spent.evaluations) == (False, 8)


def everyone() -> list[Contender]:
    return [
        each
        for each in contenders()[0]
        if each.name not in ("identify", "multistart") and each.objective != "numba"
    ]


@pytest.mark.parametrize("contender", everyone(), ids=lambda each: f"{each.name} on {each.objective}")
def test_every_search_repeats_itself_and_stays_in_the_cube(
    contender: Contender, job: SearchJob, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    visited: list[list[NDArray[np.float64]]] = []
    for _ in range(2):
        objective = job.objective
        attempt = Attempt(job=job, objective=objective, target=0.0, budget=300, visited=[])
        with pytest.raises(AttemptEnded):
            contender.method(attempt, 3)
        assert attempt.visited is not None
        visited.append(attempt.visited)
    first, second = (np.concatenate(each) for each in visited)
    np.testing.assert_array_equal(first, second)
    assert first.min() >= 0.0
    assert first.max() <= 1.0
    # pyswarms would leave a log.
    assert list(tmp_path.iterdir()) == []


def test_a_method_that_gives_up_has_failed(job: SearchJob) -> None:
    def one_look(attempt: Attempt, seed: int) -> None:
        attempt.misfits(np.full((1, attempt.job.n_params), 0.5))

    contender = Contender(name="one look", objective="rust", method=one_look, settings="")
    objective = job.objective
    outcome = attempted(contender, job, objective, best_known=0.0, budget=100, seed=0)
    assert (outcome.success, outcome.evaluations) == (False, 1)
    assert outcome.gap_points > 100.0 * NEAR


def test_an_early_abort_changes_nothing_and_spares_steps(job: SearchJob) -> None:
    aborts = list(early_aborts(job, generations=6, seeds=1, threads=1))
    assert {each.method for each in aborts} <= OURS.keys()
    assert all(each.identical and 0.0 < each.steps_share_done < 1.0 for each in aborts)


def test_seeds_at_once_end_at_the_target_or_at_the_budget(job: SearchJob) -> None:
    methods = [name for name, _, _ in contenders_at_once()]
    for best_known, success in ((10.0, True), (0.0, False)):
        results = list(attempted_at_once(job, best_known=best_known, budget=64, first_seed=3, seeds=2))
        assert [result.method for result in results] == [name for name in methods for _ in range(2)]
        for first, second in zip(results[::2], results[1::2], strict=True):
            assert first.success is second.success is success
            assert first.seconds == second.seconds
            assert 20 <= first.evaluations <= 64
            assert first.gap_points != second.gap_points


def an_outcome(evaluations: int, *, success: bool = True) -> AttemptResult:
    return AttemptResult(
        method="",
        objective="",
        evaluations=evaluations,
        seconds=evaluations / 1e3,
        success=success,
        gap_points=0.1,
    )


def a_row(method: str, objective: str, outcomes: list[AttemptResult]) -> SearchRow:
    return replace(row_of(outcomes, threads=1, settings=""), method=method, objective=objective)


def test_a_failure_counts_in_the_share_and_in_what_a_success_costs() -> None:
    row = a_row("cma", "rust", [an_outcome(100), an_outcome(300), an_outcome(1000, success=False)])
    assert row.success == pytest.approx(2 / 3)
    assert (row.evaluations, row.seconds) == (200, pytest.approx(0.2))
    assert row.expected_seconds == pytest.approx(1.4 / 2)
    never = a_row("cma", "rust", [an_outcome(1000, success=False)])
    assert (never.success, never.evaluations, never.seconds, never.expected_seconds) == (
        0.0,
        None,
        None,
        None,
    )


def test_the_usual_way_is_marked_and_multiplied() -> None:
    usual = UsualWay(seconds_by_solver={"RK45": 0.3, "LSODA": 0.1}, candidates=5)
    slow, fast = extrapolated(a_row("pyswarms", "numba", [an_outcome(2000)]), usual)
    assert slow.extrapolated
    assert fast.extrapolated
    assert (slow.objective, slow.evaluations, slow.seconds) == ("solve_ivp, RK45", 2000, pytest.approx(600.0))
    assert (fast.objective, fast.evaluations, fast.seconds) == (
        "solve_ivp, LSODA",
        2000,
        pytest.approx(200.0),
    )


def test_a_bar_takes_the_same_class_of_peer_and_is_not_met_where_ours_never_came_near() -> None:
    rows = (
        a_row("differential_evolution", "rust", [an_outcome(100)]),
        a_row("differential_evolution", "rust, early abort", [an_outcome(50)]),
        a_row("differential_evolution", "rust, seeds at once", [an_outcome(20)]),
        a_row("scipy_differential_evolution", "numba", [an_outcome(500)]),
        a_row("scipy_differential_evolution", "rust", [an_outcome(60)]),
        a_row("efficient_ga", "rust", [an_outcome(100, success=False)]),
        a_row("pymoo_ga", "numba", [an_outcome(500)]),
    )
    abort = EarlyAbort(
        method="differential_evolution",
        threads=1,
        steps_share_done=0.4,
        seconds_ratio=0.5,
        identical=True,
        generations=10,
        n_seeds=1,
    )
    bars = {bar.claim: bar for bar in bars_of(rows, (), [abort, replace(abort, method="x", identical=False)])}
    faster = bars[
        "differential_evolution, one seed after another: times faster than scipy_differential_evolution on numba"
    ]
    assert (faster.measured, faster.met) == (pytest.approx(10.0), True)
    at_once = bars[
        "differential_evolution, seeds at once: times faster than scipy_differential_evolution on numba"
    ]
    assert at_once.measured == pytest.approx(25.0)
    never = bars["efficient_ga, one seed after another: times faster than pymoo_ga on numba"]
    assert (never.measured, never.met) == (None, False)
    spared = "{}: share of steps that an early abort spares"
    assert bars[spared.format("differential_evolution")].met
    assert not bars[spared.format("x")].met


def test_a_quick_run_has_all_rows(job: SearchJob, capsys: pytest.CaptureFixture[str]) -> None:
    for module in ("numba", "cma", "pymoo", "pyswarms"):
        pytest.importorskip(module, reason=f"{module} {EXTRA}")
    quick = ["identify", "--quick", "--seeds", "1", "--threads", "1", "--budget", "300"]
    with pytest.raises(SystemExit) as ended:
        main([*quick, "--json", "--quiet"])
    assert ended.value.code == 0
    told = json.loads(capsys.readouterr().out)
    rows = told["rows"]
    assert {"method", "objective", "evaluations", "seconds", "success", "extrapolated"} <= rows[0].keys()
    assert all(0.0 <= row["success"] <= 1.0 and row["n_seeds"] == 1 for row in rows)
    expected = {("identify", "rust"), ("multistart", "rust")} | {(name, "rust") for name in OURS}
    expected |= {(name, objective) for name in PEERS for objective in ("rust", "numba")}
    expected |= {(each["method"], "rust, early abort") for each in told["early_abort"]}
    expected |= {(name, objective) for name, objective, _ in contenders_at_once()}
    assert {(row["method"], row["objective"]) for row in rows if not row["extrapolated"]} == expected
    assert [row["objective"] for row in rows if row["extrapolated"]] == [
        "solve_ivp, RK45",
        "solve_ivp, LSODA",
    ]
    assert len(told["early_abort"]) == 3
    assert all(abort["identical"] for abort in told["early_abort"])
    (setup,) = told["setups"]
    assert (setup["synthetic"], setup["n_time"], setup["missing"]) == (True, N_TIME, [])


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent in another way there")
def test_an_interrupted_run_keeps_what_it_measured(
    job: SearchJob, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    # As if the extra were not installed: Numba would be compiled first, and all methods of the others be warmed up.
    (tmp_path / "sitecustomize.py").write_text(
        "import sys; sys.modules.update(dict.fromkeys(('numba', 'cma', 'pymoo', 'pyswarms')))"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    command = [
        sys.executable,
        str(measured_data.ROOT / "studies" / "speed" / "study.py"),
        "identify",
        "--quick",
        "--seeds",
        "1000",
        "--json",
    ]
    with started(*command) as run:
        assert run.stderr is not None
        # The line of the third attempt: two have been told.
        attempts = 0
        for line in run.stderr:
            attempts += "seed 1 of" in line
            if attempts == 3:
                run.send_signal(signal.SIGINT)
                break
        out, _ = run.communicate()
    told = json.loads(out)
    assert run.returncode == 130
    assert told["interrupted"]
    assert 1 <= len(told["rows"]) < 18
    assert told["usual_way"] is None


def test_impossible_numbers_are_refused() -> None:
    with pytest.raises(SettingError, match="give positive numbers"):
        bench_identify(seeds=0)
    with pytest.raises(SettingError, match="give fewer threads"):
        bench_identify(threads=(100_000,))
