"""`mrwork sample`: from a run folder to its posterior, in one table and two files."""

from __future__ import annotations

import json
import resource
import shutil
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from command_line import COMMAND, PATIENCE, mrwork, printed, started, wait_until

from mrwork.identification.fit_file import read_fit
from mrwork.uncertainty.posterior.draws import read_draws
from mrwork.uncertainty.posterior.sample import SamplingProgress


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("run") / "run"
    model = ("--model", "static_hysteretic", "--search", "genetic", "--generations", "3")
    printed("identify", "synthetic:rd1005_1a", "--every", "20", *model, "--quiet", "--out", place)
    return place


def test_a_run_is_sampled_and_the_draws_lie_beside_the_fit(run: Path) -> None:
    import xarray

    text = printed("sample", run, "--steps", "300", "--walkers", "20", "--threads", "1")
    assert "posterior of static_hysteretic with iid noise, not converged" in text
    assert "noise.sigma" in text
    assert "Not converged after 300 steps" in text
    with xarray.open_datatree(run / "posterior.nc", engine="h5netcdf") as tree:
        assert tree["posterior"]["alpha"].attrs["units"] == "N"
        assert tree.attrs["steps"] == 300
    again = mrwork("sample", run, "--steps", "400", "--walkers", "20", "--resume", "--json")
    document = json.loads(again.stdout)
    assert document["steps"] == 400
    assert set(document["parameters"]["alpha"]) >= {
        "median",
        "lower_5",
        "upper_95",
        "ess_bulk",
        "rhat",
        "remark",
    }


def test_one_sampling_at_a_time_and_ctrl_c_keeps_its_chain(run: Path, tmp_path: Path) -> None:
    place = tmp_path / "run"
    shutil.copytree(run, place)
    chain = place / "posterior.jsonl.part"
    (place / "posterior.jsonl").write_text("an earlier chain")
    command = (*COMMAND, "sample", place, "--noise", "arma11", "--walkers", "64", "--steps", "1000000")
    with started(*command) as process:
        # The time is told with the first reports, which are 0.2 s apart.
        wait_until(lambda: chain.is_file() and chain.read_bytes().count(b"\n") > 300, process, pause=0.1)
        for options in ((), ("--resume",)):
            second = mrwork("sample", place, "--steps", "10", "--walkers", "20", *options)
            assert second.returncode == 2
            assert f"process {process.pid} on" in second.stderr
            assert len(second.stderr.splitlines()) == 1
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, stderr
    assert "1,000,000 steps take about" in stderr
    assert "steps are kept in" in stderr
    assert "Traceback" not in stderr
    assert (place / "posterior.jsonl").read_text() == "an earlier chain"
    assert {json.loads(line)["step"] for line in chain.read_text().splitlines()} == {"sampling", "step"}


@contextmanager
def disk_of(size: int) -> Iterator[None]:
    """No file can grow beyond `size` [bytes]: to a process the same as a full disk, but for the number of the error."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def drawn(run: Path) -> np.ndarray:
    draws = read_draws(run, read_fit(run))
    assert draws is not None
    return np.concatenate([draws.theta, draws.noise, draws.log_posterior[:, None]], axis=1)


def test_a_full_disk_loses_nothing(run: Path, tmp_path: Path) -> None:
    place = tmp_path / "run"
    shutil.copytree(run, place)
    sampling = ("sample", place, "--steps", "60", "--walkers", "20", "--threads", "1", "--json")
    printed(*sampling)
    whole, size = drawn(place), (place / "posterior.jsonl").stat().st_size
    before = {name: (place / name).read_bytes() for name in ("posterior.jsonl", "posterior.nc", "fit.json")}
    # In the journal, at its end, and after it in the draws.
    resume: tuple[str, ...] = ()
    for full in (size // 3, size - 1000, size + 1000):
        with disk_of(full):
            ended = mrwork(*sampling, *resume)
        assert ended.returncode == 2
        # A resumed journal says how much of its end is torn.
        sentence = next(line for line in ended.stderr.splitlines() if "torn" not in line)
        assert sentence.startswith("mrwork: cannot write")
        assert (place / "posterior.nc").read_bytes() == before["posterior.nc"]
        assert (place / "fit.json").read_bytes() == before["fit.json"]
        assert full > size or (place / "posterior.jsonl").read_bytes() == before["posterior.jsonl"]
        resume = ("--resume",)
    printed(*sampling, "--resume")
    assert (place / "posterior.nc").read_bytes() != before["posterior.nc"]
    np.testing.assert_array_equal(drawn(place), whole)
    assert not [entry.name for entry in place.iterdir() if "part" in entry.name or "lock" in entry.name]


def test_what_cannot_be_is_one_sentence(run: Path, tmp_path: Path) -> None:
    for arguments, word in (
        ([tmp_path / "none"], "does not exist"),
        ([run, "--prior", "alpha=flat"], "NAME=normal"),
        ([run, "--prior", "k_w=normal:1:1"], "'k_w'"),
        ([run, "--noise", "pink"], "iid, student_t"),
        ([run, "--tempering", "some"], "--tempering"),
        ([run, "--walkers", "4"], "an even number"),
        ([run, "--seed", "-1"], "from 0 to"),
        ([run, "--seed", "9", "--resume"], "another sampling"),
    ):
        ended = mrwork("sample", *arguments, "--quiet")
        assert (ended.returncode, ended.stdout) == (2, "")
        assert len(ended.stderr.strip().splitlines()) == 1
        assert word in ended.stderr


def test_the_line_tells_rate_agreement_and_time_left() -> None:
    from mrwork.uncertainty.posterior.draws import Diagnosis

    told = np.array([1.0])
    diagnosis = Diagnosis(
        names=("c",), n_steps=150, tau=10.0 * told, rhat=1.02 * told, ess_bulk=told, ess_tail=told
    )
    progress = SamplingProgress(
        steps=200, most_steps=1000, seconds=4.0, steps_per_second=50.0, diagnosis=diagnosis
    )
    assert (
        progress.in_words
        == "step 200, 50 steps/s, R-hat 1.020, 15 autocorrelation times, 4 s, at least 9 s, at most 16 s left"
    )
    assert progress.most_seconds == 16.0
