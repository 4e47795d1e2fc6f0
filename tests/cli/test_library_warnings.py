"""Records at the edge of what can be read: no warning of a library, no traceback, and reasons in the sentence."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from command_line import mrwork
from numpy.typing import NDArray
from odd_files import MM, NEWTON, TIME, write_table

import mrwork as mr
from mrwork.identification import polish

EDGES: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]] = {
    "the force is one spike": (MM, np.where(np.arange(TIME.size) == 200, 1.0, 0.0)),
    "the damper rests while it is compared": (np.where(TIME < 1.0, 0.0, 10.0), NEWTON),
    "the damper rests first": (np.where(TIME < 1.9, 0.0, MM), np.where(TIME < 1.9, 0.0, NEWTON)),
    "a spring": (MM, 50.0 * MM),
}


@pytest.mark.parametrize("edge", EDGES)
def test_an_edge_of_what_can_be_read_raises_no_warning_of_a_library(tmp_path: Path, edge: str) -> None:
    displacement, force = EDGES[edge]
    record = write_table(tmp_path / "rig.txt", {"t_s": TIME, "x_mm": displacement, "F_N": force})
    # Any warning of a library is an error in tests.
    for arguments in (
        ("check", record),
        ("identify", record, "--model", "bingham", "--out", tmp_path / "run"),
    ):
        ended = mrwork(*arguments)
        assert ended.returncode == 0, ended.stderr
        assert "a library" not in ended.stderr


def test_a_fit_that_has_not_converged_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(polish, "_FINAL_EVALUATIONS", 2)
    record = write_table(tmp_path / "rig.txt", {"t_s": TIME, "x_mm": MM, "F_N": NEWTON})
    search = ("--search", "particle_swarm", "--generations", 2, "--population", 10)
    ended = mrwork("identify", record, "--model", "bouc_wen", *search, "--out", tmp_path / "run")
    assert ended.returncode == 0, ended.stderr
    assert "not converged (the final fit ended at its most steps, " in ended.stdout
    assert "the final fit ended at its most steps" in mr.load(tmp_path / "run").fit.status_in_words
