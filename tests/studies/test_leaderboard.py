"""The leaderboard: a row of each table, what entries are given, and what becomes of those that fail."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import measured_data
import numpy as np
import pytest
from command_line import ran

import mrwork as mr
from studies.common.frame import FRAME, HARDWARE, pair
from studies.leaderboard.best_constant import best_constant, constant_commands, training_scores
from studies.leaderboard.damper_scores import damper_rows, fit_percent, folds, score_damper
from studies.leaderboard.entries import DAMPERS, LAWS, Entry, attempt, files_of, load
from studies.leaderboard.law_scores import synthetic_motions, training_motions
from studies.leaderboard.rigs import CURRENTS, MOTIONS, synthetic_rig
from studies.leaderboard.tables import damper_table

STUDY = measured_data.ROOT / "studies" / "leaderboard" / "study.py"


@pytest.fixture(scope="module")
def tests() -> tuple[mr.DamperTest, ...]:
    return synthetic_rig()


def entry(function: Any) -> Entry:
    return Entry(name="mine", title="Mine", function=function, n_params=None)


def test_every_entry_has_its_own_name_a_title_and_a_reference() -> None:
    assert not files_of(DAMPERS).keys() & files_of(LAWS).keys()
    for kind in (DAMPERS, LAWS):
        for file in files_of(kind).values():
            assert load(file, kind).title
            documentation = file.read_text(encoding="utf-8").split('"""')[1]
            assert "Authors: " in documentation
            assert "Reference: " in documentation


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


def test_rows_are_ranked_failures_are_last_and_workers_find_the_same(
    tests: tuple[mr.DamperTest, ...], tmp_path: Path
) -> None:
    fails = tmp_path / "mine.py"
    fails.write_text('"""A method."""\ndef identify(tests, rng): return 1 / 0', encoding="utf-8")
    files = [fails, files_of(DAMPERS)["linear_regression"]]
    here = [replace(row, seconds=0.0) for row in damper_rows(files, tests, lambda name: None)]
    with mr.local_workers(1) as pool, mr.working_on(pool):
        assert [replace(row, seconds=0.0) for row in damper_rows(files, tests, lambda name: None)] == here
    assert here[0].failure == "ZeroDivisionError: division by zero"
    assert here[1].score is not None
    shown = damper_table("rig", [replace(row, n_params=3) for row in here]).rows
    assert [row[0] for row in shown] == ["linear_regression", "mine"]

    def endless() -> None:
        while True:
            pass

    assert attempt("endless", endless, limit=0.2).failure.startswith("TimeoutError")


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


def test_passive_off_scores_one_and_the_best_constant_command_least() -> None:
    unseen, training = synthetic_motions(), training_motions()
    assert not {each.acceleration.tobytes() for each in unseen} & {
        each.acceleration.tobytes() for each in training
    }
    few = training[:2]
    off = constant_commands([0.0])
    assert training_scores(off, FRAME, pair(), few, HARDWARE) == pytest.approx(1.0)
    chosen = best_constant(FRAME, pair(), few, HARDWARE)
    levels = constant_commands(np.linspace(0.0, pair().largest_command, 5))
    (least,) = training_scores(chosen, FRAME, pair(), few, HARDWARE)
    assert (least <= training_scores(levels, FRAME, pair(), few, HARDWARE)).all()
