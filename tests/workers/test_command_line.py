"""What the command line says of workers: where they cannot help, and who is no scheduler."""

from pathlib import Path

import pytest
from command_line import mrwork
from sentences import Refused

from mrwork.workers.cluster import cluster_workers
from tests.workers.computations import STUDY


def test_who_is_no_scheduler_is_refused(
    tmp_path: Path, refused: Refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mrwork.workers.cluster._SECONDS", 0.3)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scheduler.json").write_text('{"address": 3}')
    (tmp_path / "text.json").write_text("no JSON")
    for scheduler in (
        "host",
        "none.json",
        "a:b:c",
        "http://host",
        "scheduler.json",
        "text.json",
        "tcp://127.0.0.1:9",
    ):
        refused(cluster_workers(scheduler).__enter__)


def test_where_workers_cannot_help_the_verb_says_so(tmp_path: Path) -> None:
    done = mrwork(
        "identify", "synthetic:spencer1997", "--model", "dahl", "--workers", 2, "--out", tmp_path / "run"
    )
    assert done.returncode == 0
    assert "--workers has no effect: one model is fitted, on the threads of this process" in done.stderr
    both = mrwork("tune", STUDY, "--workers", 2, "--cluster", "host:8786", "--out", tmp_path / "tuned")
    assert both.returncode == 2
    assert "--workers and --cluster both say who works; give one of them" in both.stderr
