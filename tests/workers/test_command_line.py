"""What the command line says of workers: where they cannot help, and who is no scheduler."""

import sys
from pathlib import Path

import pytest
from command_line import mrwork, ran
from refusals import command_refusal, refusal

from mrwork.workers.cluster import cluster_workers
from tests.workers.computations import STUDY


@pytest.mark.parametrize("scheduler", ["host", "a:b:c", "http://host", "scheduler.json"])
def test_who_is_no_scheduler_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scheduler: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scheduler.json").write_text('{"address": 3}')
    refusal(cluster_workers(scheduler).__enter__, match=f"'{scheduler}', which is no address")


def test_where_nobody_answers_a_sentence_says_so() -> None:
    # Dask changes how this process pickles errors.
    program = (
        "import mrwork.workers.cluster as cluster\n"
        "cluster._SECONDS = 0.3\n"
        "cluster.cluster_workers('tcp://127.0.0.1:9').__enter__()"
    )
    told = ran(sys.executable, "-c", program).stderr.splitlines()[-1]
    assert told.startswith("mrwork.errors.WorkerError: no scheduler answers at tcp://127.0.0.1:9")


def test_where_workers_cannot_help_the_verb_says_so(tmp_path: Path) -> None:
    words = ("identify", "synthetic:spencer1997", "--model", "dahl", "--every", 20, "--workers", 2)
    done = mrwork(*words, "--out", tmp_path / "run")
    assert done.returncode == 0
    assert "--workers has no effect: one model is fitted" in done.stderr
    both = ("--workers", 2, "--cluster", "host:8786", "--out", tmp_path / "tuned")
    command_refusal("tune", STUDY, *both, match="--workers and --cluster both")
