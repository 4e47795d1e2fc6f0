"""`mrwork sample`: from a run folder to its posterior, in one table and two files."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import COMMAND, PATIENCE, mrwork, started, wait_until

from mrwork.cli import main
from mrwork.cli.progress import sampling_described
from mrwork.uncertainty.posterior.sample import SamplingProgress


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("run") / "run"
    model = ("--model", "static_hysteretic", "--search", "genetic", "--generations", "3")
    result = mrwork("identify", "synthetic:rd1005_1a", "--every", "20", *model, "--quiet", "--out", place)
    assert result.returncode == 0, result.stderr
    return place


def test_a_run_is_sampled_and_the_draws_lie_beside_the_fit(run: Path) -> None:
    import xarray

    result = mrwork("sample", run, "--steps", "300", "--walkers", "20", "--threads", "1")
    assert result.returncode == 0, result.stderr
    assert "posterior of static_hysteretic with iid noise, not converged" in result.stdout
    assert "noise.sigma" in result.stdout
    assert "Not converged after 300 steps" in result.stdout
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


def steps_in(chain: Path) -> int | None:
    """Steps of a chain on disk; none while it is being written."""
    try:
        with h5py.File(chain, locking=False) as file:
            return int(file[f"place{file.attrs['current']}"].attrs["n_steps"])
    except (OSError, KeyError):
        return None


def test_ctrl_c_keeps_the_chain(run: Path) -> None:
    command = (*COMMAND, "sample", run, "--noise", "arma11", "--walkers", "64", "--steps", "1000000")
    with started(*command) as process:
        # The chain's file is begun anew with the first walkers, and then grows every two seconds.
        wait_until(lambda: steps_in(run / "posterior.h5") not in (None, 0, 400), process, pause=0.1)
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, stderr
    assert "steps are kept in" in stderr
    assert "Traceback" not in stderr


def test_what_cannot_be_is_one_sentence(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
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
        with pytest.raises(SystemExit) as ended:
            main(["sample", *map(str, arguments), "--quiet"])
        assert ended.value.code == 2
        printed = capsys.readouterr()
        assert printed.out == ""
        assert len(printed.err.strip().splitlines()) == 1
        assert word in printed.err


def test_the_line_tells_rate_agreement_and_time_left() -> None:
    from mrwork.uncertainty.posterior.diagnostics import Diagnosis

    told = np.array([1.0])
    diagnosis = Diagnosis(
        names=("c",), n_steps=150, tau=10.0 * told, rhat=1.02 * told, ess_bulk=told, ess_tail=told
    )
    progress = SamplingProgress(
        steps=200, most_steps=1000, seconds=4.0, steps_per_second=50.0, diagnosis=diagnosis
    )
    assert (
        sampling_described(progress)
        == "step 200, 50 steps/s, R-hat 1.020, 15 autocorrelation times, 4 s, at most 16 s left"
    )
