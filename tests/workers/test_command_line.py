"""What the command line says of workers: where they cannot help, and who is no scheduler."""

import sys
from pathlib import Path

import pytest
from command_line import mrwork, ran
from sentences import Refused

from mrwork.workers.cluster import cluster_workers
from tests.workers.computations import STUDY


def test_who_is_no_scheduler_is_refused(
    tmp_path: Path, refused: Refused, monkeypatch: pytest.MonkeyPatch
) -> None:
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
    ):
        refused(cluster_workers(scheduler).__enter__)


def test_where_nobody_answers_a_sentence_says_so() -> None:
    # Dask changes how this process pickles errors.
    program = (
        "import mrwork.workers.cluster as cluster\n"
        "cluster._SECONDS = 0.3\n"
        "cluster.cluster_workers('tcp://127.0.0.1:9').__enter__()"
    )
    told = ran(sys.executable, "-c", program).stderr.splitlines()[-1]
    assert told.startswith(
        "mrwork.errors.WorkerError: no scheduler answers at tcp://127.0.0.1:9 within 0.3 s ("
    )
    assert told.endswith("; start one by `dask scheduler`, or give its address")


def test_where_workers_cannot_help_the_verb_says_so(tmp_path: Path) -> None:
    done = mrwork(
        "identify", "synthetic:spencer1997", "--model", "dahl", "--workers", 2, "--out", tmp_path / "run"
    )
    assert done.returncode == 0
    assert "--workers has no effect: one model is fitted, on the threads of this process" in done.stderr
    both = mrwork("tune", STUDY, "--workers", 2, "--cluster", "host:8786", "--out", tmp_path / "tuned")
    assert both.returncode == 2
    assert "--workers and --cluster both say who works; give one of them" in both.stderr
