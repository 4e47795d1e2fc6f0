"""`mrwork plan`: from a run folder to a ranking, a document and a map in it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray
from command_line import printed
from sentences import Refused

from mrwork.identification.fit_file import reopen
from mrwork.uncertainty.posterior.draws import read_draws


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("plan") / "run"
    fitted = ("synthetic:rd1005_1a", "--every", "4", "--model", "static_hysteretic", "--fix", "x_s=1e-4")
    printed("identify", *fitted, "--quiet", "--out", place)
    return place


@pytest.mark.usefixtures("drawn_pictures")
def test_a_plan_names_the_best_test_first(run: Path) -> None:
    lists = ("--amplitudes", "0.005,0.01,0.02", "--frequencies", "0.5,1,2")
    text = printed("plan", run, "--band", "c", *lists)
    assert "Of 9 tests this one narrows the band of c most: 20 mm, 2 Hz" in text
    assert "rank correlation" in text
    document = json.loads((run / "plan.json").read_text())
    gains = [each["gain"] for each in document["plan"]["gains"]]
    assert gains == sorted(gains, reverse=True)
    assert document["plan"]["gains"][0]["candidate"] == {
        "amplitude": 0.02, "frequency": 2.0, "command": None,
    }  # fmt: skip
    printed("report", run, "--figures", "--quiet")
    for suffix in ("svg", "png"):
        assert (run / "figures" / f"plan.{suffix}").stat().st_size > 1000


def test_json_is_one_object(run: Path, tmp_path: Path) -> None:
    table = tmp_path / "tests.csv"
    table.write_text("amplitude,frequency\n0.01,1\n0.02,1\n0.03,1\n")
    arguments = ("plan", run, "--json", "--candidates", table, "--stroke", "0.05", "--targets", table)
    document = json.loads(printed(*arguments))
    assert len(document["plan"]["gains"]) == 2
    assert document["plan"]["band"] == "force"
    assert document["limits"] == {"stroke": 0.05, "peak_velocity": None}


def test_bad_input_is_one_sentence(run: Path, refused: Refused) -> None:
    for arguments in (
        ["--band", "stiffness"],
        ["--band", "x_s"],
        ["--amplitudes", "5,10"],
        ["--candidates", "a.csv", "--frequencies", "1"],
    ):
        refused.command("plan", run, *arguments)


def test_draws_of_the_posterior_are_used_where_there_are_some(run: Path, tmp_path: Path) -> None:
    sampled = tmp_path / "sampled"
    shutil.copytree(run, sampled)
    opened = reopen(sampled)
    rng = np.random.default_rng(3)
    spread = np.array([each.standard_error or 0.0 for each in opened.fit.estimates])
    chains = np.array(opened.fit.theta) + spread * rng.standard_normal((4, 150, spread.size))
    columns = dict(zip(opened.fit.spec.names, np.moveaxis(chains, -1, 0), strict=True))
    columns["noise.sigma"] = rng.random((4, 150))
    dataset = xarray.Dataset(
        {
            name: (("chain", "draw"), values, {"units": "1", "median": 0.0, "lower": -1.0, "upper": 1.0})
            for name, values in columns.items()
        }
    )
    tree = xarray.DataTree.from_dict(
        {
            "posterior": dataset,
            "sample_stats": xarray.Dataset({"lp": (("chain", "draw"), np.zeros((4, 150)))}),
            "observed_data": xarray.Dataset(),
        }
    )
    tree.attrs = {
        "of_fit": opened.fit.fingerprint,
        "noise": "iid",
        "status": "converged",
        "verdict": "Converged after 150 steps.",
        "temper": 1.0,
        "steps": 150,
        "thinning": 1,
        "seconds": 1.0,
    }
    tree.to_netcdf(sampled / "posterior.nc", engine="h5netcdf")
    found = read_draws(sampled, opened.fit)
    assert found is not None
    np.testing.assert_array_equal(found.theta, chains.reshape(-1, spread.size))
    lists = ("--amplitudes", "0.005,0.02", "--frequencies", "0.5,2")
    text = printed("plan", sampled, *lists)
    assert "Draws of the posterior" in text
    (sampled / "posterior.nc").write_text("no")
    assert f"run `mrwork sample {sampled}` again" in printed("plan", sampled, *lists, status=2)
    assert read_draws(run, opened.fit) is None
