"""What the command line says of workers: where they cannot help, and who is no scheduler."""

import sys
from pathlib import Path

import pytest
from command_line import mrwork, ran
from refusals import command_refusal

from tests.workers.computations import STUDY


@pytest.mark.long
@pytest.mark.parametrize(
    ("scheduler", "reason"),
    [
        ("host", "missing port number"),
        ("http://host:8786", "unknown address scheme 'http'"),
        ("scheduler.json", "expected str, got 'int'"),
        ("tcp://127.0.0.1:9", "Timed out"),
    ],
)
def test_where_no_scheduler_answers_a_sentence_says_why(tmp_path: Path, scheduler: str, reason: str) -> None:
    (tmp_path / "scheduler.json").write_text('{"address": 3}')
    # Dask changes how this process pickles errors.
    program = (
        "import mrwork.workers.cluster as cluster\n"
        "cluster._SECONDS = 0.3\n"
        f"cluster.cluster_workers({scheduler!r}).__enter__()"
    )
    told = ran(sys.executable, "-c", program, cwd=tmp_path).stderr
    assert f"mrwork.errors.WorkerError: no scheduler answers at {scheduler} within 0.3 s ({reason}" in told


def test_where_workers_cannot_help_the_verb_says_so(tmp_path: Path) -> None:
    words = ("identify", "synthetic:spencer1997", "--model", "dahl", "--every", 20, "--workers", 2)
    done = mrwork(*words, "--out", tmp_path / "run")
    assert done.returncode == 0
    assert "--workers has no effect: one model is fitted" in done.stderr
    both = ("--workers", 2, "--cluster", "host:8786", "--out", tmp_path / "tuned")
    command_refusal("tune", STUDY, *both, match="--workers and --cluster both")
