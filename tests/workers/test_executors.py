"""A choice of models, a tuning and a study have the same results on every executor."""

import json
import multiprocessing
import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

import mrwork as mr
from mrwork.store.codec import finite
from tests.workers.computations import STUDY, digests

BIN = Path(sys.executable).parent


@pytest.fixture(scope="module")
def here() -> list[str]:
    return digests(None)


@pytest.fixture(scope="module")
def scheduler_file(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The file of a Dask scheduler with one worker."""
    folder = tmp_path_factory.mktemp("dask")
    file = folder / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    commands = (
        [*dask, "scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)],
        [*dask, "worker", "--nthreads", "1", "--no-nanny", "--no-dashboard", "--scheduler-file", str(file)],
    )
    with (folder / "log").open("w") as log:
        running = [subprocess.Popen(each, cwd=folder, stdout=log, stderr=log) for each in commands]
    yield file
    for process in running:
        process.kill()
        process.wait()


def _mrwork(*arguments: object) -> None:
    command = [sys.executable, "-m", "mrwork", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr


def _timeless(value: Any) -> Any:
    """A JSON value without times."""
    if isinstance(value, dict):
        return {key: _timeless(each) for key, each in value.items() if "second" not in key}
    return [_timeless(each) for each in value] if isinstance(value, list) else value


def test_processes(here: list[str]) -> None:
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert digests(pool) == here


def test_loky(here: list[str]) -> None:
    from loky import ProcessPoolExecutor as LokyExecutor

    pool = LokyExecutor(1)
    try:
        assert digests(pool) == here
    finally:
        pool.shutdown(kill_workers=True)


def test_mpi(here: list[str], tmp_path: Path) -> None:
    """Three ranks are one client and two workers."""
    program = Path(__file__).parent / "computations.py"
    command = [
        BIN / "mpiexec",
        "-n",
        "3",
        sys.executable,
        "-m",
        "mpi4py.futures",
        program,
        tmp_path / "found",
    ]
    root = Path(__file__).parents[2]
    paths = os.pathsep.join([str(root), os.environ.get("PYTHONPATH", "")])
    subprocess.run(command, check=True, timeout=120, env=os.environ | {"PYTHONPATH": paths})
    assert (tmp_path / "found").read_text().splitlines() == here


def test_dask_by_the_command_line(scheduler_file: Path, tmp_path: Path) -> None:
    tuned = []
    for name, workers in (("here", ()), ("cluster", ("--cluster", scheduler_file))):
        _mrwork("tune", STUDY, "--quick", "--seed", "1", *workers, "--quiet", "--out", tmp_path / name)
        tuned.append(_timeless(json.loads((tmp_path / name / "results.json").read_text())))
    assert tuned[0] == tuned[1]


def test_own_processes_by_the_command_line(tmp_path: Path) -> None:
    models = ("identify", "synthetic:spencer1997", "--model", "dahl,bingham", "--workers", "1", "--quiet")
    _mrwork(*models, "--out", tmp_path / "run")
    ranking = json.loads((tmp_path / "run" / "ranking.json").read_text())
    here = mr.choose_model(mr.synthetic_test("spencer1997"), ["dahl", "bingham"]).ranking
    assert _timeless(ranking) == _timeless(json.loads(json.dumps(finite(asdict(here)))))
