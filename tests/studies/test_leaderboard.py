"""The leaderboard: a row of each table, what entries are given, and what becomes of those that fail."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import measured_data
import numpy as np
import pytest
from command_line import ran

import mrwork as mr
from studies.leaderboard.damper_scores import fit_percent, folds, score_damper
from studies.leaderboard.entries import Entry
from studies.leaderboard.rigs import CURRENTS, MOTIONS, synthetic_rig

STUDY = measured_data.ROOT / "studies" / "leaderboard" / "study.py"


@pytest.fixture(scope="module")
def tests() -> tuple[mr.DamperTest, ...]:
    return synthetic_rig()


def entry(function: Any) -> Entry:
    return Entry(name="mine", title="Mine", function=function, n_params=None)


@pytest.mark.long
def test_the_quick_form_writes_a_row_of_each_table(tmp_path: Path) -> None:
    names = ("linear_regression", "passive_on")
    only = (part for name in names for part in ("--only", name))
    result = ran(
        *(sys.executable, STUDY, "--quick", "--json", "--out", tmp_path / "out", *only),
        env=os.environ | {"MRWORK_DATA": str(tmp_path)},
    )
    assert result.returncode == 0, result.stderr
    written = json.loads((tmp_path / "out/partial/leaderboard.json").read_text(encoding="utf-8"))
    rows = [
        *written["dampers"]["synthetic rig"],
        *written["laws"]["synthetic motions"],
        *written["benchmark"],
    ]
    assert [row["name"] for row in rows] == list(names)
    assert not any(row["failure"] for row in rows)


def test_a_motion_is_left_out_at_every_current_and_nothing_of_its_force_is_handed_over(
    tests: tuple[mr.DamperTest, ...],
) -> None:
    parts = list(folds(tests))
    assert len(parts) == len(MOTIONS)
    for rest, held_out in parts:
        assert len(held_out) == len(CURRENTS)
        assert len({(test.amplitude, test.frequency) for test in held_out}) == 1
        assert not {(t.amplitude, t.frequency) for t in rest} & {(t.amplitude, t.frequency) for t in held_out}
    forces = {test.name: test.force for test in tests}
    drawn: list[float] = []

    def identify(rest: Any, rng: np.random.Generator) -> Any:
        training = {test.name for test in rest}
        drawn.append(rng.random())

        def predict(test: mr.DamperTest) -> Any:
            assert test.name not in training
            assert not test.force.any()
            assert (test.findings, test.smoothing, test.original) == ((), None, None)
            return np.full_like(test.displacement, forces[test.name].mean())

        return predict

    # The mean of a force explains none of its deviation.
    for _ in range(2):
        assert all(abs(fit) < 1.0 for fit in score_damper(entry(identify), tests).fits.values())
    assert drawn[: len(MOTIONS)] == drawn[len(MOTIONS) :]
    assert fit_percent(tests[0], tests[0].force) == 100.0
