"""`mrwork sample`: from a run folder to its posterior, in one table and two files."""

from __future__ import annotations

import json
import shutil
import signal
from pathlib import Path

import pytest
from command_line import COMMAND, PATIENCE, mrwork, printed, started, wait_until
from refusals import command_refusal


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("run") / "run"
    model = ("--model", "static_hysteretic", "--search", "genetic", "--generations", "3")
    printed("identify", "synthetic:rd1005_1a", "--every", "20", *model, "--quiet", "--out", place)
    return place


def test_a_run_is_sampled_and_the_draws_lie_beside_the_fit(run: Path) -> None:
    import xarray

    text = printed("sample", run, "--steps", "300", "--walkers", "20", "--threads", "1")
    assert "Not converged after 300 steps" in text
    with xarray.open_datatree(run / "posterior.nc", engine="h5netcdf") as tree:
        assert tree["posterior"]["alpha"].attrs["units"] == "N"
        assert tree.attrs["steps"] == 300
    again = mrwork("sample", run, "--steps", "400", "--walkers", "20", "--resume", "--json")
    document = json.loads(again.stdout)
    assert document["steps"] == 400
    expected = {"median", "lower_5", "upper_95", "ess_bulk", "rhat", "remark"}
    assert set(document["parameters"]["alpha"]) >= expected


@pytest.mark.machine
def test_one_sampling_at_a_time_and_ctrl_c_keeps_its_chain(run: Path, tmp_path: Path) -> None:
    place = tmp_path / "run"
    shutil.copytree(run, place)
    chain = place / "posterior.jsonl.part"
    (place / "posterior.jsonl").write_text("an earlier chain")
    command = (*COMMAND, "sample", place, "--noise", "arma11", "--walkers", "64", "--steps", "1000000")
    with started(*command) as process:
        # The time is told with the first reports, which are 0.2 s apart.
        wait_until(lambda: chain.is_file() and chain.read_bytes().count(b"\n") > 300, process, pause=0.1)
        second = ("sample", place, "--steps", "10", "--walkers", "20", "--resume")
        command_refusal(*second, match=f"process {process.pid} on")
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, stderr
    assert "steps are kept in" in stderr
    assert (place / "posterior.jsonl").read_text() == "an earlier chain"
    assert {json.loads(line)["step"] for line in chain.read_text().splitlines()} == {"sampling", "step"}


@pytest.mark.parametrize(
    ("words", "word"),
    [
        (("--prior", "alpha=flat"), "NAME=normal"),
        (("--noise", "pink"), "iid, student_t"),
        (("--walkers", "4"), "an even number"),
        (("--seed", "9", "--resume"), "another sampling"),
    ],
)
def test_what_cannot_be_sampled_is_refused(run: Path, words: tuple[str, ...], word: str) -> None:
    command_refusal("sample", run, *words, "--quiet", match=word)
