"""A choice of models, a tuning and a study have the same results on every executor."""

import json
import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from command_line import COMMAND, mrwork, ran

from tests.workers.computations import STUDY, digests

BIN = Path(sys.executable).parent
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def here() -> list[str]:
    return digests(None)


@pytest.fixture(scope="module")
def scheduler_file(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The file of a Dask scheduler with one worker."""
    folder = tmp_path_factory.mktemp("dask")
    file = folder / "scheduler.json"
    common = ("--no-dashboard", "--scheduler-file", str(file))
    commands = (("scheduler", "--port", "0", *common), ("worker", "--nthreads", "1", "--no-nanny", *common))
    with (folder / "log").open("w") as log:
        running = [
            subprocess.Popen([sys.executable, "-m", "dask", *each], cwd=folder, stdout=log, stderr=log)
            for each in commands
        ]
    yield file
    for process in running:
        process.kill()
        process.wait()


def _timeless(value: Any) -> Any:
    """A JSON value without times."""
    if isinstance(value, dict):
        return {key: _timeless(each) for key, each in value.items() if "second" not in key}
    return [_timeless(each) for each in value] if isinstance(value, list) else value


def printed(run: Callable[..., Any], *words: object) -> Any:
    """What a command prints as JSON that is run in some way."""
    ended = run(*words, "--quiet", "--json")
    assert ended.returncode == 0, ended.stderr
    return _timeless(json.loads(ended.stdout))


@pytest.mark.long
def test_processes(here: list[str]) -> None:
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert digests(pool) == here


@pytest.mark.long
def test_loky(here: list[str]) -> None:
    from loky import ProcessPoolExecutor as LokyExecutor

    pool = LokyExecutor(1)
    try:
        assert digests(pool) == here
    finally:
        pool.shutdown(kill_workers=True)


@pytest.mark.long
def test_mpi(here: list[str], tmp_path: Path) -> None:
    """Three ranks are one client and two workers."""
    program = (sys.executable, "-m", "mpi4py.futures", ROOT / "tests" / "workers" / "computations.py")
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | {"PYTHONPATH": paths}
    ran(BIN / "mpiexec", "-n", 3, *program, tmp_path / "found", check=True, env=environment)
    assert (tmp_path / "found").read_text().splitlines() == here


@pytest.mark.long
@pytest.mark.parametrize("workers", ["cluster", "own"])
def test_workers_of_the_command_line(workers: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    if workers == "cluster":
        words = ("tune", STUDY, "--quick", "--seed", "1")
        options = ("--cluster", request.getfixturevalue("scheduler_file"))
    else:
        words = ("identify", "synthetic:spencer1997", "--model", "dahl,bingham", "--every", "8")
        options = ("--workers", "1")
    here = printed(mrwork, *words, "--out", tmp_path / "here")
    # In a process of its own: Dask changes how a process pickles errors.
    there = printed(partial(ran, *COMMAND), *words, *options, "--out", tmp_path / "there")
    assert json.dumps(there).replace(str(tmp_path / "there"), str(tmp_path / "here")) == json.dumps(here)
