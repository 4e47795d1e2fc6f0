"""Placements of equal dampers are enumerated, ranked by their best constant command, and judged on unseen motions."""

from contextlib import closing
from itertools import combinations_with_replacement
from pathlib import Path

import numpy as np
import pytest
from refusals import refusal
from tuning_samples import motion, without_times

import mrwork as mr
from mrwork.errors import Interrupted
from mrwork.report.study.page import study_page
from mrwork.tuning import TuningResults, judge, tune
from mrwork.tuning.placing import placements_of
from mrwork.tuning.tuned_laws import places_table
from mrwork.tuning.tuning_folder import chosen_study

# Storey 3 is the soft one, where dampers help most.
SOFT = "masses = [1000, 1000, 1000, 1000]\nstiffnesses = [4e6, 4e6, 3e5, 4e6]\nmodal_damping = { ratios = [0.02] }"
DAMPER = '[[damper]]\nstorey = "storey 1"\npreset = "kwok2006"\ndifferential = true\n'
MOTIONS = motion("A", 1, "training") + motion("B", 2) + motion("C", 3)


def study_with(
    folder: Path, places: str, *, dampers: str = DAMPER, more: str = "", motions: str = MOTIONS
) -> mr.Study:
    path = folder / "study.toml"
    path.write_text(f'title = "Soft"\n[building]\n{SOFT}\n{dampers}\n{places}\n{more}{motions}')
    return mr.read_study(path)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> mr.Study:
    return study_with(tmp_path_factory.mktemp("study"), "[places]\ndampers = 2")


@pytest.fixture(scope="module")
def results(study: mr.Study) -> TuningResults:
    return tune(study, threads=1)


def test_every_placement_is_compared_and_the_soft_storey_is_the_best_for_one_damper(
    study: mr.Study, results: TuningResults, tmp_path: Path
) -> None:
    names = study.building.storey_names
    expected = set(combinations_with_replacement(names, 2))
    given = [
        tuple(name for name, count in each.storeys.items() for _ in range(count)) for each in results.places
    ]
    assert set(given) == expected
    assert len(given) == len(expected) == 10
    scores = [each.train for each in results.places]
    assert scores == sorted(scores)
    alone = tune(study_with(tmp_path, "[places]"), threads=1)
    assert alone.places[0].storeys == {"storey 3": 1}
    # That of the study stands in storey 1.
    assert [each.storeys for each in alone.places if each.given] == [{"storey 1": 1}]


def test_scores_are_those_of_a_study_with_the_dampers_there(results: TuningResults, tmp_path: Path) -> None:
    best = results.places[0]
    dampers = "".join(
        f"{DAMPER}count = {count}\n".replace("storey 1", name) for name, count in best.storeys.items()
    )
    law = f'[[controller]]\nlaw = "passive"\nsettings = {{ command = {best.command!r} }}\n'
    runs = mr.run_study(study_with(tmp_path, "", dampers=dampers, more=law))
    (row,) = (number for number, each in enumerate(runs.rows) if each.description == "passive")

    def score(motions: list[int]) -> float:
        ratios = [
            np.max(runs.quantities.numbers[name][row, each]) / np.max(runs.quantities.numbers[name][0, each])
            for each in motions
            for name in ("peak_drift", "peak_acceleration", "rms_drift", "rms_acceleration")
        ]
        return float(np.mean(ratios))

    assert score([0]) == pytest.approx(best.train, rel=1e-9)
    assert score([1, 2]) == pytest.approx(best.test, rel=1e-9)


def test_placements_are_compared_by_the_score_of_the_study(tmp_path: Path) -> None:
    places = "[places]\nstoreys = [1, 3]\neach = 1"
    score = '[report]\nscore = ["rms_drift@storey 2"]\n'
    best = tune(study_with(tmp_path, places, more=score), threads=1).places[0]
    dampers = DAMPER.replace("storey 1", *best.storeys)
    law = f'[[controller]]\nlaw = "passive"\nsettings = {{ command = {best.command!r} }}\n'
    runs = mr.run_study(study_with(tmp_path, "", dampers=dampers, more=law))
    (row,) = (number for number, each in enumerate(runs.rows) if each.description == "passive")
    drift = runs.quantities.numbers["rms_drift"][:, 0, 0, 1]
    assert drift[row] / drift[0] == pytest.approx(best.train, rel=1e-9)


@pytest.mark.long
def test_laws_are_tuned_at_the_best_placement_and_its_study_is_written(tmp_path: Path) -> None:
    study = study_with(
        tmp_path, '[places]\nstoreys = [2, "storey 3"]\ndampers = 1', dampers=f"# Here.\n{DAMPER}"
    )
    results = tune(study, laws=["clipped_optimal"], budget=24, threads=1)
    # That of the study stands in none of the storeys, and is compared, but not chosen.
    assert [each.given for each in results.places] == [False, False, True]
    assert study.origin.file is not None
    chosen = tmp_path / "chosen.toml"
    chosen.write_text(chosen_study(results, study.origin.file))
    again = mr.read_study(chosen)
    assert again.device_names == ("damper in storey 3",)
    assert again.table.places is None
    runs = mr.run_study(again)
    (row,) = (number for number, each in enumerate(runs.rows) if each.label == results.laws[0].label)
    judged = judge(study, results, threads=1).judgement(results.laws[0], "test")
    assert judged is not None
    assert runs.score(row).mean == pytest.approx(judged.score.mean, rel=1e-6)
    best = next(each for each in results.references if each.label == "Optimal passive")
    assert best.settings["command"] == pytest.approx(results.places[0].command)


def test_an_interrupted_comparison_resumes_to_the_same_bits(
    study: mr.Study, results: TuningResults, tmp_path: Path
) -> None:
    said: list[str] = []

    def stop(progress: mr.Progress) -> None:
        said.append(progress.in_words)
        if progress.numbers["candidates"] == 4:
            raise KeyboardInterrupt

    with closing(mr.Journal(tmp_path / "journal")) as journal, pytest.raises(Interrupted) as ended:
        tune(study, threads=1, journal=journal, on_progress=stop)
    assert ended.value.result.status == "interrupted"
    assert said[0].startswith("placements: 1 of 10")
    kept = (tmp_path / "journal").read_text()
    assert kept.count('"placement"') == 4
    with closing(mr.Journal(tmp_path / "journal", resume=True)) as journal:
        assert without_times(tune(study, threads=1, journal=journal)) == without_times(results)
    whole = (tmp_path / "journal").read_text()
    assert whole.startswith(kept)
    assert whole.count('"placement"') == 10


def test_equal_dampers_that_stand_already_are_the_placement_of_the_study(tmp_path: Path) -> None:
    dampers = DAMPER + DAMPER.replace("storey 1", "storey 3").replace("preset", 'name = "upper"\npreset')
    study = study_with(tmp_path, "[places]\nstoreys = [1, 2, 3, 4]\neach = 1", dampers=dampers)
    given, placements = placements_of(study)
    assert given == {"storey 1": 1, "storey 3": 1}
    assert given in placements
    assert len(placements) == 6
    table = places_table(tune(study, threads=1))
    assert sum("(the study)" in row[1] for row in table.rows) == 1


@pytest.mark.parametrize(
    ("places", "dampers", "word"),
    [
        ("[places]\ndampers = 9", DAMPER, "line 11: .* more than 60 placements"),
        ("[places]", DAMPER + DAMPER.replace("differential = true", "count = 2"), "differs from the first"),
        ("[places]\ndampers = 3", 2 * DAMPER, "study has 2"),
        ("[places]", f"{DAMPER}row = [1.0, 0.0, 0.0, 0.0]\n", "give an angle"),
    ],
)
def test_places_that_cannot_be_compared_are_refused(
    tmp_path: Path, places: str, dampers: str, word: str
) -> None:
    refusal(lambda: tune(study_with(tmp_path, places, dampers=dampers)), match=word)


def test_places_are_told_with_the_number_of_dampers(tmp_path: Path) -> None:
    study = study_with(tmp_path, "[places]\ndampers = 2", dampers=f"{DAMPER}count = 3")
    results = tune(study, threads=1)
    assert {sum(each.storeys.values()) for each in results.places} == {2}
    # Two [[damper]] of three dampers each.
    (given,) = (each for each in results.places if each.given)
    assert given.in_words == "6 in storey 1"
    best = results.places[0]
    judged = judge(study, results, threads=1)
    front = " ".join(study_page(judged, lambda row, motion: None, summary=True).split())
    assert f"Best of 10 placements of the dampers: {best.in_words}." in front
