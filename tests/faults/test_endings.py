"""A small job of `endings.py`, ended in some of the ways, and that its comparison notices what differs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tools.faults.ended_jobs import JOBS, Job, same_results, written_results
from tools.faults.endings import WAYS, Row, Stage

SMALL = ("identify", "test0.csv", "--model", "bingham", "--every", "4", "--threads", "1", "--out", "run")
JOB = replace(
    JOBS[0],
    words=(*SMALL, "--seed", "1"),
    former=(*SMALL, "--seed", "2"),
    rivals=((*SMALL, "--seed", "1", "--resume"),),
)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    return Stage.of(JOB, tmp_path_factory.mktemp("endings"))


@pytest.mark.parametrize("way", ["SIGINT", "file limit", "two at once"])
def test_an_ended_identification_keeps_what_it_has_and_is_continued_to_the_same_result(
    stage: Stage, way: str
) -> None:
    row = Row(JOB.name, way)
    WAYS[way](stage, row, 1)
    assert row.points + row.late == 1
    assert not row.failures


def test_results_that_differ_are_noticed(tmp_path: Path) -> None:
    job: Job = replace(JOBS[0], results=("*.json",))
    (tmp_path / "run").mkdir()
    file = tmp_path / "run" / "fit.json"
    file.write_text('{"a": [1.0, 2.0], "seconds": 1.0}')
    before = written_results(tmp_path, job)
    file.write_text('{"a": [1.0, 2.0], "seconds": 2.0}')
    assert same_results(written_results(tmp_path, job), before) == []
    file.write_text('{"a": [1.0, 2.5], "seconds": 1.0}')
    assert same_results(written_results(tmp_path, job), before) == ["fit.json.a.1 is 2.5 where 2.0 is right"]
    file.unlink()
    assert same_results(written_results(tmp_path, job), before) == ["fit.json is missing"]
