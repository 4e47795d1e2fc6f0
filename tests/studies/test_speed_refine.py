"""The benchmark of refinements gives all engines the same starts and residuals; ours meet in one minimum."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mrwork.errors import SettingError
from mrwork.identification import find_minima, find_minimum
from studies.speed.command_line import main
from studies.speed.refine import bench_refine
from studies.speed.refine_job import RefineJob, joint_job, reference_job

EXTRA = "is not installed; pip install 'mrwork[bench]'"


@pytest.fixture
def job(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> RefineJob:
    monkeypatch.setenv("MRWORK_DATA", str(tmp_path))
    return reference_job(3, 1)


def test_without_data_an_embedded_test_stands_in_and_there_is_no_joint_job(job: RefineJob) -> None:
    assert job.synthetic
    assert joint_job(1, 1) is None


def test_starts_lie_in_the_box_and_repeat(job: RefineJob) -> None:
    assert np.all((job.starts >= job.box.lower) & (job.starts <= job.box.upper))
    np.testing.assert_array_equal(job.starts, reference_job(3, 1).starts)


# The second layout is that of a quick run, so it is compiled once for both.
@pytest.mark.parametrize(("block", "fastmath", "form"), [(4, False, "exp_log"), (8, True, "power")])
def test_numba_has_our_residuals(job: RefineJob, block: int, fastmath: bool, form: str) -> None:
    pytest.importorskip("numba", reason=f"numba {EXTRA}")
    from studies.speed.numba_objective import NumbaObjective
    from studies.speed.numba_peer import NumbaVariant

    variant = NumbaVariant(block=block, threads=1, fastmath=fastmath, form=form)
    peer = NumbaObjective(job.objective, variant).residuals
    # A library's power may differ by some ulp, which a stiff loop carries along.
    np.testing.assert_allclose(peer(job.starts), job.objective.residuals(job.starts), rtol=0.0, atol=1e-9)


def test_our_engines_meet_in_one_minimum(job: RefineJob) -> None:
    from mrwork.identification import find_minimum_by_optimistix

    start = job.starts[0]
    scipy = find_minimum(job.objective, job.box, start, max_evaluations=100)
    lanes = find_minima(job.objective, job.box, start[None], max_iterations=100)
    optimistix = find_minimum_by_optimistix(job.objective, job.box, start)
    assert scipy.converged
    # They stop where the squared misfit falls by less than 1e-7 and 1e-8 of itself.
    assert scipy.misfit == pytest.approx(optimistix.misfit, rel=1e-6)
    assert lanes.misfit[0] == pytest.approx(scipy.misfit, rel=1e-6)


def test_every_engine_has_a_row_with_what_it_took(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("MRWORK_DATA", str(tmp_path))
    with pytest.raises(SystemExit) as exit:
        main(["refine", "--quick", "--seeds", "2", "--json", "--quiet"])
    assert exit.value.code == 0
    told = json.loads(capsys.readouterr().out)
    assert {row["job"] for row in told["rows"]} == {"reference"}
    assert len({row["engine"] for row in told["rows"]}) == len(told["rows"]) >= 3
    for row in told["rows"]:
        assert row["seconds"] > 0.0
        assert row["simulations"] >= 1.0
        assert 0.0 <= row["success"] <= 1.0
    assert told["synthetic"]["reference"]


def test_the_table_says_what_is_synthetic(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MRWORK_DATA", str(tmp_path))
    assert "SYNTHETIC" in "\n".join(bench_refine(seeds=1, quick=True).text())


def test_no_starts_are_refused() -> None:
    with pytest.raises(SettingError, match="give 1 or more"):
        bench_refine(seeds=0)
