"""Verbs that add to the run folder of a fit, profile, sample, plan and calibrate: a table, JSON, and files in it."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import mrwork, printed
from refusals import command_refusal

import mrwork as mr
from mrwork import load
from mrwork.identification.covariance import Covariance, Slopes
from mrwork.identification.fit_file import fit_content, reopen
from mrwork.identification.problem import Problem
from mrwork.identification.verdicts import fitted_parameters
from mrwork.store.run_writer import add_to_run


@pytest.fixture(scope="module")
def profiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("profile") / "run"
    fitted = ("synthetic:rd1005_1a", "--every", "4", "--model", "static_hysteretic")
    printed("identify", *fitted, "--quiet", "--out", place)
    return place


@pytest.fixture(scope="module")
def valley(profiled: Path) -> Path:
    """The run with delta and x_s a fifth less, which the force hardly shows."""
    place = profiled.parent / "valley"
    shutil.copytree(profiled, place)
    opened = reopen(place)
    problem = Problem.of_fit(opened.fit, opened.tests)
    nearer = [0.8 if each.name in ("delta", "x_s") else 1.0 for each in opened.fit.estimates]
    theta = problem.inside(np.array(opened.fit.theta) * nearer)
    covariance = Covariance.of(Slopes.at(problem.objective, problem.form, theta))
    estimates, directions = fitted_parameters(problem, theta, covariance)
    fit = replace(opened.fit, estimates=estimates, directions=directions)
    add_to_run(place, {"fit.json": fit_content(fit)})
    return place


def test_a_profile_says_what_the_data_settle(valley: Path) -> None:
    text = printed("intervals", valley, "--quiet")
    (alpha,) = [line for line in text.splitlines() if line.strip().startswith("alpha ")]
    assert alpha.endswith("identifiable")
    (delta,) = [line for line in text.splitlines() if line.strip().startswith("delta ")]
    assert "open" in delta
    assert "weakly identifiable" in delta or "not identifiable" in delta
    assert "delta/x_s is better identifiable" in text
    document = json.loads((valley / "profiles.json").read_text())
    assert [each["name"] for each in document["profiles"]] == [*mr.damper("static_hysteretic").names]


def test_a_better_fit_that_a_profile_finds_replaces_that_of_the_run(profiled: Path, tmp_path: Path) -> None:
    place = tmp_path / "short"
    shutil.copytree(profiled, place)
    fit = reopen(place).fit
    short = [
        replace(each, value=(1.2 if each.name == "alpha" else 1.0) * each.value) for each in fit.estimates
    ]
    add_to_run(place, {"fit.json": fit_content(replace(fit, estimates=tuple(short), nrmse=2.0 * fit.nrmse))})
    assert "replaces the profiled one" in printed("intervals", place, "--parameter", "f0", "--quiet")
    better = reopen(place).fit
    assert better.nrmse == pytest.approx(fit.nrmse, rel=1e-3)
    assert (
        better.status
        == json.loads((place / "manifest.json").read_text())["status"]
        == "lower_minimum_possible"
    )
    assert (
        "a profile of its parameters found it" in printed("report", place, "--quiet") + better.status_in_words
    )
    # What was found is profiled without a further replacement.
    assert "replaces" not in printed("intervals", place, "--parameter", "f0", "--quiet")


def test_json_is_one_object_and_what_is_written(valley: Path) -> None:
    document = json.loads(printed("intervals", valley, "--json", "--level", "0.5", "--parameter", "c"))
    (c,) = document["profiles"]
    assert c["lower"] < c["estimate"] < c["upper"]
    written = json.loads((valley / "profiles.json").read_text())
    assert written["profiles"][0]["interval"]["lower"] == c["lower"]
    assert (document["level"], document["status"]) == (0.5, "finished")
    assert document["directions"]


def test_intervals_take_the_place_of_standard_errors_everywhere(profiled: Path, tmp_path: Path) -> None:
    place = tmp_path / "profiled"
    shutil.copytree(profiled, place)
    (place / "profiles.json").unlink(missing_ok=True)
    # Of one parameter only: the table keeps its standard errors, as it has one kind of uncertainty.
    printed("intervals", place, "--quiet", "--parameter", "c")
    assert load(place).fit.an_interval is None
    document = json.loads(printed("intervals", place, "--json"))
    (c,) = [each for each in document["profiles"] if each["name"] == "c"]
    fit = load(place).fit
    assert "standard error" not in repr(fit)
    assert f"{c['lower']:.4g} to {c['upper']:.4g}" in repr(fit)
    assert fit.an_interval is not None
    assert (fit.an_interval.kind, fit.an_interval.level) == ("profile", 0.95)
    judged = {each["name"]: each["verdict"] for each in document["profiles"]}
    assert {name: fit.parameters[name].verdict.word for name in judged} == judged


@pytest.fixture(scope="module")
def sampled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("run") / "run"
    model = ("--model", "static_hysteretic", "--search", "genetic", "--generations", "3")
    printed("identify", "synthetic:rd1005_1a", "--every", "20", *model, "--quiet", "--out", place)
    return place


def test_a_run_is_sampled_and_the_draws_lie_beside_the_fit(sampled: Path) -> None:
    import xarray

    text = printed("intervals", sampled, "--posterior", "--steps", "300", "--walkers", "20", "--threads", "1")
    assert "Not converged after 300 steps" in text
    with xarray.open_datatree(sampled / "posterior.nc", engine="h5netcdf") as tree:
        assert tree["posterior"]["alpha"].attrs["units"] == "N"
        assert tree.attrs["steps"] == 300
    again = mrwork(
        "intervals", sampled, "--posterior", "--steps", "400", "--walkers", "20", "--resume", "--json"
    )
    document = json.loads(again.stdout)
    assert document["steps"] == 400
    expected = {"median", "lower_5", "upper_95", "ess_bulk", "rhat", "state"}
    assert set(document["parameters"]["alpha"]) >= expected
    command_refusal(
        "intervals", sampled, "--posterior", "--seed", "9", "--resume", "--quiet", match="another sampling"
    )


@pytest.mark.parametrize(
    ("words", "word"),
    [
        (("--prior", "alpha=flat"), "normal:MEAN"),
        (("--noise", "pink"), "choose one of iid, ar1"),
        (("--walkers", "4"), "an even number"),
    ],
)
def test_what_cannot_be_sampled_is_refused(sampled: Path, words: tuple[str, ...], word: str) -> None:
    command_refusal("intervals", sampled, "--posterior", *words, "--quiet", match=word)


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("plan") / "run"
    fitted = ("synthetic:rd1005_1a", "--every", "4", "--model", "static_hysteretic", "--fix", "x_s=1e-4")
    printed("identify", *fitted, "--quiet", "--out", place)
    return place


def test_a_plan_names_the_best_test_first(planned: Path) -> None:
    lists = ("--amplitudes", "0.005,0.01,0.02", "--frequencies", "0.5,1,2")
    text = printed("plan", planned, "--band", "c", *lists)
    assert "Of 9 tests this one narrows the band of c most: 20 mm, 2 Hz" in text
    gains = json.loads((planned / "plan.json").read_text())["gains"]
    assert [each["gain"] for each in gains] == sorted((each["gain"] for each in gains), reverse=True)
    assert gains[0]["candidate"] == {"amplitude": 0.02, "frequency": 2.0, "command": None}


def test_a_plan_is_one_object(planned: Path, tmp_path: Path) -> None:
    table = tmp_path / "tests.csv"
    table.write_text("amplitude,frequency\n0.01,1\n0.02,1\n0.03,1\n")
    arguments = ("plan", planned, "--json", "--candidates", table, "--stroke", "0.05", "--targets", table)
    document = json.loads(printed(*arguments))
    assert len(document["gains"]) == 2
    assert document["band"] == "force"
    assert document["limits"] == {"stroke": 0.05, "peak_velocity": None}


# One free number: the search is over at once.
FIXED = {"k_w": 650.0, "rho": 15000.0, "sigma": 0.5, "n": 2.0, "k": 2500.0, "x0": 0.038}
OTHERS = ["synthetic:spencer1997_slow", "synthetic:spencer1997_fast"]


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("calibrate") / "run"
    held = [f"--fix={name}={value}" for name, value in FIXED.items()]
    tests = ["synthetic:spencer1997", "synthetic:spencer1997_fast"]
    printed("identify", *tests, *held, "--every", "4", "--out", out, "--quiet", "--json")
    return out


def test_bands_are_calibrated_on_tests_that_the_fit_has_not_seen(calibrated: Path) -> None:
    command_refusal("predict", calibrated, OTHERS[0], "--level", "0.9", match="run `mrwork calibrate .*run`")
    made = json.loads(mrwork("calibrate", calibrated, OTHERS[0], "--json").stdout)
    assert made["tests"] == [OTHERS[0]]
    predicted = json.loads(mrwork("predict", calibrated, OTHERS[0], "--level", "0.9", "--json").stdout)
    # Its own quantile: all that calibration can say of a single test.
    row = predicted["files"][0]
    assert row["coverage_percent"] == pytest.approx(90.0, abs=1.0)
    assert row["interval_score"] >= row["mean_width_n"]
    assert (made["level"], made["coverage_percent"]) == (0.9, None)
    # A wider and slower motion than those of the fit, which the calibration has seen.
    assert predicted["files"][0]["outside_tested_range"] == ["stroke", "frequency"]


def test_without_files_the_tests_of_the_run_are_left_out_in_turn_and_kept(calibrated: Path) -> None:
    document = json.loads(printed("calibrate", calibrated, "--json"))
    assert len(document["coverage"]) == 2 * 3
    at_level = [each["samples"]["coverage"] for each in document["coverage"] if each["level"] == 0.9]
    assert (document["level"], document["coverage_percent"]) == (0.9, 100.0 * sum(at_level) / 2)
    folds = sorted((calibrated / "left_out").iterdir())
    assert len(folds) == 2
    written = [path.stat().st_mtime_ns for path in folds]
    again = mrwork("calibrate", calibrated)
    assert "each predicted without itself" in again.stdout
    assert [path.stat().st_mtime_ns for path in folds] == written


def test_a_lone_fold_is_refused(calibrated: Path) -> None:
    command_refusal("calibrate", calibrated, "--leave-out", "command", match="have one command in common")
