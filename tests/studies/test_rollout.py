"""The study of the predictive rollout on a small study of its own; its levels and chosen settings belong together."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tuning_samples
from result_tables import assert_alone, assert_filled

import mrwork as mr
from mrwork.control import settings_of
from studies.common.records import absent, ground_motions
from studies.rollout import study as rollout_study
from studies.rollout.cases import CHANGES, LOOPS, PARTS, reference_peaks, sensor_peaks
from studies.rollout.findings import cost_found, kept_in, level_found
from studies.rollout.loop import SIXTEEN, TRAINING, Bench, Plant, bench_of
from studies.rollout.page import write_page
from studies.rollout.tables import tables
from studies.rollout.yields import STRONG, rollout, secants, settings_on, yields_found
from studies.rollout.yields import tables as tables_of_yields

FOLDER = Path(rollout_study.__file__).parent
LAWS = """
[[controller]]
law = "predictive_rollout"
settings = { base = 0.47, drift = 0.002, acceleration = 2.8 }

[[controller]]
law = "best_passive"
"""


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    file = tuning_samples.study_file(tmp_path_factory.mktemp("rollout"), tune="", more=LAWS)
    return bench_of(mr.read_study(file), threads=1)


@pytest.fixture(scope="module")
def found(bench: Bench, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    kept = kept_in(tmp_path_factory.mktemp("kept") / "runs.json", resume=False)
    level = level_found("0.1 g", bench, kept, quick=True, clairvoyants=(), say=lambda what: None)
    return {"levels": {"0.1 g": level}, "cost": cost_found(bench)}


def test_every_table_names_its_rows_and_fills_them(found: dict[str, Any]) -> None:
    best = {"B": {"best constant": 0.7, "rollout": 0.6, "clairvoyant": 0.5}}
    levels = {"0.1 g": {**found["levels"]["0.1 g"], "clairvoyant": best}}
    assert_filled(tables({**found, "levels": levels}))


def test_rows_of_workers_are_those_of_this_process(
    bench: Bench, found: dict[str, Any], tmp_path: Path
) -> None:
    kept = kept_in(tmp_path / "runs.json", resume=False)
    with mr.local_workers(1) as pool, mr.working_on(pool):
        level = level_found("0.1 g", bench, kept, quick=True, clairvoyants=(), say=lambda what: None)
    assert level == found["levels"]["0.1 g"]


@pytest.mark.usefixtures("drawn_pictures")
def test_the_page_stands_alone(found: dict[str, Any], tmp_path: Path) -> None:
    write_page(found, tmp_path / "report.html")
    assert_alone(tmp_path / "report.html", pictures=0)


def test_the_best_constant_command_is_measured_by_itself(bench: Bench) -> None:
    figures = bench.constant(SIXTEEN)
    assert figures["larger"] == 1.0
    assert figures["both"] == figures["clearly"] == 0
    assert figures["score"] <= 1.0


def test_the_constant_command_of_a_row_is_chosen_on_training_motions(
    bench: Bench, found: dict[str, Any]
) -> None:
    row = found["levels"]["0.1 g"]["laws"]["Optimal passive"]
    assert row[TRAINING]["larger"] == 1.0
    assert row[SIXTEEN]["score"] >= bench.constant(SIXTEEN)["score"]


def test_a_wrong_stiffness_is_that_of_the_loop_alone(bench: Bench) -> None:
    soft = CHANGES["stiffness - 10 %"]
    problem = bench.study.problem
    assert problem is not None
    assert problem.building is bench.study.building
    softer = bench.constants(SIXTEEN, soft.plant({}))
    assert not np.allclose(softer, bench.constants(SIXTEEN, Plant()), rtol=1e-3)


def test_sensors_have_noise_in_proportion_to_what_they_measure(bench: Bench) -> None:
    peaks = sensor_peaks(bench)
    hardware = LOOPS["observer, noise, 2 ms"].plant(peaks).hardware
    assert hardware.known_ground
    assert hardware.force_noise == pytest.approx(0.02 * peaks["force"])
    assert hardware.ground_acceleration_noise == pytest.approx(0.02 * 0.1 * 9.80665, rel=1e-4)
    assert CHANGES["delay of 2 ms"].plant(peaks).hardware == mr.Hardware(delay=2e-3)


@pytest.mark.parametrize("name", [name for name in PARTS if name.endswith("trials")])
def test_a_law_with_fewer_trials_has_as_many_as_it_says(bench: Bench, name: str) -> None:
    assert bench.study.problem is not None
    law = PARTS[name].law(bench.study.problem, reference_peaks(bench))
    gains = {key: np.ravel(gain) for key, gain in law.gains.items()}
    tails = {*gains["base"], *gains["tails"]}
    pairs = {(level, tail) for level in gains["levels"] for tail in tails}
    stated = re.search(r"(\d+) trials", name)
    assert stated is not None
    assert 1 + len(pairs) == int(stated[1])


def test_what_is_known_is_not_found_again(tmp_path: Path) -> None:
    file = tmp_path / "kept" / "runs.json"
    kept_in(file, resume=False).once("law", lambda: {"score": 0.6})
    assert kept_in(file, resume=True).once("law", lambda: {"score": 0.7}) == {"score": 0.6}
    assert kept_in(file, resume=False).once("law", lambda: {"score": 0.7}) == {"score": 0.7}


def documents(kind: str) -> list[str]:
    return [(FOLDER / f"{kind}_{level}.toml").read_text(encoding="utf-8") for level in ("01", "03")]


def test_the_levels_differ_in_the_peaks_of_the_motions_alone() -> None:
    weak, strong = documents("level")
    assert weak.replace("0.17 g", "0.5 g").replace("0.1 g", "0.3 g") == strong


@pytest.mark.parametrize("number", [0, 1])
def test_the_chosen_settings_are_those_of_laws_on_the_motions_of_the_level(number: int) -> None:
    level, chosen = (tomllib.loads(documents(kind)[number]) for kind in ("level", "chosen"))
    rows = chosen.pop("controller")
    level.pop("controller")
    assert chosen == level
    for each in rows:
        if "settings" in each:
            settings_of(each["law"], each["settings"])


@pytest.mark.parametrize("level", ["01", "03"])
def test_the_chosen_rollout_has_what_the_training_motions_give(level: str) -> None:
    if missing := absent("the study names measured motions", ground_motions() / "real"):
        pytest.skip(missing)
    if not (FOLDER / "../../../shared/data/records/real").is_dir():
        pytest.skip("the study names motions in ../shared/data, which are not there")
    found, given = (
        {each.row.label: each.law for each in mr.read_study(FOLDER / f"{kind}_{level}.toml").arrangements}
        for kind in ("level", "chosen")
    )
    for name, gain in found["Predictive rollout"].gains.items():
        np.testing.assert_array_equal(given["Predictive rollout"].gains[name], gain)


@pytest.fixture(scope="module")
def yields(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    file = tuning_samples.study_file(
        tmp_path_factory.mktemp("yields"),
        tune="",
        more=LAWS,
        building=f'{tuning_samples.FIVE_STOREYS}\n\n[building.storeys_that_yield]\nyield_drift = "0.2 mm"',
        motions="".join(
            tuning_samples.motion(name, seed, use)
            for seed, (name, use) in enumerate({"A": "training", "B": "test", "Unseen": "test"}.items())
        ),
    )
    return bench_of(mr.read_study(file), threads=1)


def test_rows_of_the_frame_that_yields_are_those_of_its_laws(yields: Bench, tmp_path: Path) -> None:
    kept = kept_in(tmp_path / "yields.json", resume=False)
    found = yields_found(yields, yields, kept, lambda what: None)
    assert_filled(tables_of_yields(found))
    for figures in found["levels"].values():
        assert figures["laws"]["Passive-off"][SIXTEEN]["score"] == 1.0
    assert found["levels"][STRONG]["laws"]["Passive-off"][SIXTEEN]["ductility"] > 1.0


def test_secants_are_of_storeys_that_yield_alone(yields: Bench) -> None:
    shares = secants(yields)
    assert shares[1] < 0.9
    assert shares[-1] == 1.0


def test_a_model_of_the_whole_stiffness_is_that_of_the_elastic_frame(yields: Bench) -> None:
    assert yields.study.problem is not None
    settings = settings_on(yields)
    given, designed = (
        rollout(yields, settings),
        mr.control.design_law("predictive_rollout", yields.study.problem, settings),
    )
    for name, gain in designed.gains.items():
        np.testing.assert_allclose(given.gains[name], gain, rtol=1e-12)
    assert given.model is not None
    softer = rollout(yields, settings, 0.8).model
    assert softer is not None
    np.testing.assert_allclose(softer.building.stiffness, 0.8 * given.model.building.stiffness, rtol=1e-12)


def test_the_frame_that_yields_has_stronger_motions_of_the_levels() -> None:
    own = (FOLDER / "yields.toml").read_text(encoding="utf-8").replace("rest = 10\n", "")
    level = documents("level")[1].replace("0.5 g", "0.83 g").replace("0.3 g", "0.5 g")
    for motion in level.split("\n\n"):
        assert motion in own or not motion.startswith("[[motion]]")
