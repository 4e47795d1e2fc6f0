"""The study of robust control on a small study of its own; its two levels differ in the peaks of the motions alone."""

from __future__ import annotations

import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import tuning_samples

import mrwork as mr
from mrwork.closed_loop import ClairvoyantSettings
from mrwork.control import settings_of
from studies.robust_control import findings as robust_findings
from studies.robust_control import runs as robust_runs
from studies.robust_control.findings import level_found
from studies.robust_control.page import score_figure
from studies.robust_control.runs import CURRENTS, MOTIONS, write_tests
from studies.robust_control.tables import ANY, tables

UNCERTAIN = """
[uncertainty]
realisations = 3
stiffness = 0.1
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    file = tuning_samples.study_file(tmp_path_factory.mktemp("robust"), tune="", more=UNCERTAIN)
    study = mr.read_study(file)
    results = mr.tune(study, laws=["clipped_optimal"], budget=24, threads=1)
    return level_found(study, results, clairvoyants=0, threads=1, say=lambda what: None)


def test_laws_and_references_stand_beside_each_other(found: dict[str, Any]) -> None:
    laws = found["laws"]
    assert laws["Passive-off"]["test"] == 1.0
    assert set(laws["Passive-off"]["motions"]) == {"B", "C"}
    band = laws["Clipped-optimal, tuned"]["bands"]["peak_drift"]
    assert 0.0 < band["lower"] < band["median"] < band["upper"]


def test_clairvoyants_of_workers_are_those_of_this_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robust_findings, "_SEARCH", ClairvoyantSettings(explore=1, finish=0))
    study = mr.read_study(tuning_samples.study_file(tmp_path, tune="", building=tuning_samples.TWO_STOREYS))

    def under() -> dict[str, Any]:
        return robust_findings._clairvoyants(study, 2, 1, lambda what: None)

    here = under()
    with ThreadPoolExecutor(1) as pool, mr.working_on(pool):
        assert under() == here


def test_every_table_names_its_rows_and_fills_them(found: dict[str, Any]) -> None:
    left = {"motions": {"B": 0.4, "C": 0.5}, "ratios": {}}
    made = list(tables({"0.1 g": {**found, "clairvoyant": left}}))
    assert len(made) == 4
    for table in made:
        assert {len(row) for row in table.rows} == {len(table.columns)}
        assert all(row[0] for row in table.rows), table.title
    assert made[3].rows[-1] == ("clairvoyant", "0.400", "0.500", "0.450")


def test_the_best_law_of_each_motion_is_no_worse_than_any(found: dict[str, Any]) -> None:
    table = next(each for each in tables({"0.1 g": found}) if each.title.startswith("Peaks below"))
    larger = [float(row[-1]) for row in table.rows]
    assert table.rows[-1][0] == ANY
    assert larger[-1] == min(larger)
    both = [int(row[3].split()[0]) for row in table.rows]
    assert both[-1] == max(both)


def test_the_figure_has_a_row_for_each_law(found: dict[str, Any]) -> None:
    (axes,) = score_figure(found["laws"]).axes
    assert len(axes.get_yticks()) == len(found["laws"])


def test_the_levels_differ_in_the_peaks_of_the_motions_alone() -> None:
    folder = Path(robust_runs.__file__).parent
    weak, strong = ((folder / f"level_{level}.toml").read_text(encoding="utf-8") for level in ("01", "03"))
    assert weak.replace("0.17 g", "0.5 g").replace("0.1 g", "0.3 g") == strong


def test_the_damper_is_tested_at_each_current_and_motion(tmp_path: Path) -> None:
    files = write_tests(tmp_path)
    assert len(files) == len(CURRENTS) * len(MOTIONS)
    test = mr.read_damper_test(files[-1])
    assert test.current == CURRENTS[-1]
    assert 1e3 * test.force.std() > 100.0


def test_a_damper_of_other_tests_is_identified_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    verbs: list[str] = []
    monkeypatch.setattr(robust_runs, "_mrwork", lambda *arguments: verbs.append(arguments[0]))
    for _ in range(2):
        robust_runs.identified(tmp_path, lambda what: None)
    assert verbs == ["identify", "sample"]
    monkeypatch.setattr(robust_runs, "MOTIONS", robust_runs.MOTIONS[1:])
    robust_runs.identified(tmp_path, lambda what: None)
    assert verbs == ["identify", "sample"] * 2


def test_a_tuning_is_made_by_the_command_line_and_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tuning_samples.study_file(tmp_path)
    first = robust_runs.tuned(file, tmp_path / "run", computation=("--workers", "1"), quick=True, resume=True)
    assert (tmp_path / "run" / "chosen.toml").is_file()
    asked: list[tuple[str, ...]] = []
    monkeypatch.setattr(robust_runs, "_mrwork", lambda *arguments: asked.append(arguments))
    again = robust_runs.tuned(file, tmp_path / "run", computation=(), quick=True, resume=True)
    assert "--resume" in asked[0]
    assert again.laws[0].settings == first.laws[0].settings


@pytest.mark.parametrize("level", ["01", "03"])
def test_the_chosen_settings_are_those_of_laws(level: str) -> None:
    file = Path(robust_runs.__file__).parent / f"chosen_{level}.toml"
    tables = tomllib.loads(file.read_text(encoding="utf-8"))["controller"]
    chosen = [each for each in tables if "settings" in each]
    assert {each["law"] for each in chosen} >= {"clipped_optimal", "signal_network"}
    for each in chosen:
        settings_of(each["law"], each["settings"])
