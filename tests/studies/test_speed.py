"""The quick form of each benchmark of speed has its rows, and contenders that disagree are not timed."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest

from studies.speed import loop_ours
from studies.speed.command_line import main
from studies.speed.loop_plain import PlainLoop, by_python_control, by_solve_ivp
from studies.speed.loop_workload import loop_workload

# Without Numba and the libraries of searches, whose compilation would take most of the time.
SMALL = {
    "models": "--model bingham --batch 8 --samples 60 --rounds 1",
    "identify": "--quick --seeds 1 --threads 1 --budget 100",
    "refine": "--quick --seeds 2",
    "regulators": "--quick --states 6",
}


@pytest.mark.long
@pytest.mark.parametrize("subject", SMALL)
def test_a_benchmark_has_rows(
    subject: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    # As if the extra were not installed, here and in processes of their own.
    absent = dict.fromkeys(("numba", "cma", "pymoo", "pyswarms"))
    (tmp_path / "sitecustomize.py").write_text(f"import sys; sys.modules.update({absent})")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    for module in absent:
        monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setenv("MRWORK_DATA", str(tmp_path))
    with pytest.raises(SystemExit) as ended:
        main([subject, *SMALL[subject].split(), "--json", "--quiet"])
    assert ended.value.code == 0
    told = json.loads(capsys.readouterr().out)
    assert told["rows"]
    if subject == "identify":
        assert all(abort["identical"] for abort in told["early_abort"])


def test_runs_of_a_loop_are_those_of_plain_steps_of_solve_ivp_and_of_python_control() -> None:
    # Three candidates fill no block; the device yields and the command switches within 1.5 s.
    workload = loop_workload(3, 2, 1.5)
    plain = [[PlainLoop.of(workload, candidate).run(motion) for candidate in range(3)] for motion in range(2)]
    # 1500 steps, sums formed in different orders; bang-bang, but no decision is near enough to a tie to be turned.
    np.testing.assert_allclose(loop_ours.prepare(workload, 1)(), plain, rtol=1e-11)
    one = workload.cut(candidates=1, motions=1, n_steps=1500)
    # RK45 and RK4 at 1 ms: the loop of the damper turns within 0.1 mm of travel.
    np.testing.assert_allclose(by_solve_ivp(one)()[0, 0], plain[0][0], rtol=1e-3)
    pytest.importorskip("control", reason="python-control is not installed")
    np.testing.assert_allclose(by_python_control(one)()[0, 0], plain[0][0], rtol=1e-11)
