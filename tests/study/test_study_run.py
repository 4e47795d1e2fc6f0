"""A study, run: each run once, resumed to the bit, written whole."""

import json
import math
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import study_samples
import xarray
from command_line import printed
from refusals import refusal
from sentences import Refused

import mrwork as mr
from mrwork.base.remark import warnings_of
from mrwork.plots.of_studies import energy_parts
from mrwork.study.comparison import results_in_words
from mrwork.study.histories import RunHistory
from mrwork.study.reading import read_bare_building
from mrwork.study.storeys import storey_remarks

# Two motions, four arrangements.
STUDY = """\
title = "Two storeys"

[building]
masses = [100, 100]
stiffnesses = [1e5, 1e5]
modal_damping = { ratios = [0.01] }

[[damper]]
storey = 1
preset = "kwok2006"
differential = true

[[controller]]
law = "best_passive"
label = "best"

[[baseline]]
label = "isolated"
building = { isolation = { mass = 100, period = 2.0, ratio = 0.1 } }

[[motion]]
synthetic = "kanai_tajimi"
name = "noise"
duration = 3
pga = [0.5, 1.0]

[hardware]
sample_time = "2 ms"
step = "1 ms"
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    target = tmp_path / "study.toml"
    target.write_text(STUDY)
    return target


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> mr.Study:
    target = tmp_path_factory.mktemp("study") / "study.toml"
    target.write_text(STUDY)
    return mr.read_study(target)


@pytest.fixture(scope="module")
def whole(study: mr.Study) -> mr.StudyResults:
    return mr.run_study(study)


def ran(study: mr.Study, journal: Path, *, resume: bool = False, interrupt: int = -1) -> mr.StudyResults:
    """Run a study; `interrupt` is how many runs are done when Ctrl-C comes."""

    def on_progress(progress: mr.Progress) -> None:
        if progress.numbers["runs"] == interrupt:
            raise KeyboardInterrupt

    with closing(mr.Journal(journal, resume=resume)) as opened:
        return mr.run_study(study, journal=opened, on_progress=on_progress)


def test_the_best_constant_command_is_no_worse_than_none(whole: mr.StudyResults) -> None:
    assert whole.rows[3].label.startswith("best, ")
    assert whole.score(3).mean <= whole.score(1).mean == pytest.approx(1.0)


def test_the_best_constant_command_is_chosen_on_training_motions(path: Path, whole: mr.StudyResults) -> None:
    training = """
[[motion]]
synthetic = "kanai_tajimi"
name = "strong noise"
duration = 3
seed = 7
pga = 6.0
"""

    def best(text: str) -> str:
        path.write_text(text)
        return mr.run_study(mr.read_study(path).of_use("test")).rows[3].label

    strong = STUDY.replace("pga = [0.5, 1.0]", "pga = 6.0").replace("duration = 3", "duration = 3\nseed = 7")
    assert best(STUDY + training + 'use = "training"') == best(strong) != whole.rows[3].label


def test_the_ideal_force_does_not_depend_on_how_many_dampers_it_replaces(path: Path) -> None:
    scores = []
    for dampers in ("", "count = 3", "differential = true"):
        text = STUDY.replace("differential = true", dampers)
        text = text.replace(
            'law = "best_passive"', 'law = "active"\nsettings = { control_weight = 1e-4, energy = 1 }'
        )
        path.write_text(text)
        run = mr.run_study(mr.read_study(path)).quantities.at(4, 1)
        scores.append((run["peak_drift"].max(), np.nanmax(run["peak_force"])))
        # What it is told is a force, not a current.
        assert np.isnan([run["rms_current"], run["mean_current"]]).all()
    assert scores[1] == pytest.approx(scores[0], rel=1e-9)
    assert scores[2] == pytest.approx(scores[0], rel=1e-9)


def test_an_interrupted_study_has_what_is_done_and_resumes_to_the_bit(
    study: mr.Study, whole: mr.StudyResults, tmp_path: Path
) -> None:
    with pytest.raises(mr.errors.Interrupted) as interrupted:
        ran(study, tmp_path / "journal", interrupt=4)
    assert interrupted.value.result.done == 4
    lines = (tmp_path / "journal").read_text().count("\n")
    resumed = ran(study, tmp_path / "journal", resume=True)
    # With a journal and without, resumed or not.
    assert resumed.quantities == whole.quantities
    assert resumed.rows == whole.rows
    # What was recorded is not run again: the file has grown by the rows that were missing, and the search.
    assert (tmp_path / "journal").read_text().count("\n") == lines + len(whole.rows) - 2 + 1


def test_a_journal_of_another_study_is_refused(study: mr.Study, path: Path, tmp_path: Path) -> None:
    ran(study, tmp_path / "journal")
    path.write_text(STUDY.replace("masses = [100, 100]", "masses = [100, 110]"))
    refusal(
        ran, mr.read_study(path), tmp_path / "journal", resume=True, match="arrangement.1.content.*--replace"
    )


def histories_of(
    study: mr.Study, journal: Path, *, resume: bool, lost: bool = True
) -> dict[tuple[int, int], RunHistory]:
    """Histories of a study whose journal is kept: those of its second row alone are lost, or all."""
    found: dict[tuple[int, int], RunHistory] = {}
    with closing(mr.Journal(journal, resume=resume)) as opened:
        mr.run_study(
            study,
            journal=opened,
            kept=lambda row, motion: not lost and row != 1,
            keep=lambda row, motion, history: found.update({(row, motion): history}),
        )
    return found


def test_a_history_is_the_same_with_its_run_and_by_itself(
    study: mr.Study, whole: mr.StudyResults, tmp_path: Path
) -> None:
    with_run = histories_of(study, tmp_path / "journal", resume=False)
    alone = histories_of(study, tmp_path / "journal", resume=True)
    # Those of the stronger motion, which is drawn.
    assert set(with_run) == set(alone) == {(row, 1) for row in range(4)}
    for key, history in with_run.items():
        for name, signal in history.numbers.items():
            assert np.array_equal(signal, alone[key].numbers[name]), name
    # A history that is lost is simulated again; it has the samples, peaks are of every step.
    (again,) = histories_of(study, tmp_path / "journal", resume=True, lost=False).values()
    assert np.abs(again.drift).max(axis=0) == pytest.approx(whole.quantities.peak_drift[1, 1, 0], rel=1e-2)


def test_half_the_step_changes_little_of_a_smooth_run_and_can_be_asked_for_later(
    path: Path, tmp_path: Path
) -> None:
    out = tmp_path / "run"
    plain = json.loads(printed("respond", path, "--out", out, "--json"))
    assert {entry["step_check"] for entry in plain["results"]} == {None}
    document = json.loads(printed("respond", path, "--out", out, "--json", "--resume", "--check-step"))
    for before, after in zip(plain["results"], document["results"], strict=True):
        assert after | {"step_check": None} == before
        check = after["step_check"]
        assert check["steps"] == 2 * after["steps"]
        # A peak is that of a step, and the force has its own between two.
        assert 0.0 <= check["largest"] == max(check["changes"].values()) < 5e-3
    # Without dampers the motion is smooth: a peak of the second mode, 51 rad/s, is missed by (w h)^2 / 8 at most.
    assert 0.0 < document["results"][0]["step_check"]["largest"] < (51.2 * 1e-3) ** 2 / 8
    journal = (out / "journal.jsonl").read_text()
    assert journal.count('"runs with half the step"') == 4
    printed("respond", path, "--out", out, "--quiet", "--resume", "--check-step")
    # Recalled, not run again.
    assert (out / "journal.jsonl").read_text() == journal


def test_a_damaged_history_is_simulated_again_on_resuming(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    printed("respond", path, "--out", out, "--quiet")
    files = sorted((out / "histories").iterdir())
    whole = files[0].read_bytes()
    with h5py.File(files[0]) as file:
        middle = file["drift"].id.get_chunk_info(0).byte_offset + 100
    for content in (whole[:middle], whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]):
        files[0].unlink()
        files[0].write_bytes(content)
        printed("respond", path, "--out", out, "--quiet", "--resume")
        assert sorted((out / "histories").glob("*.nc")) == files
        assert files[0].read_bytes() == whole


def test_xarray_opens_the_runs_and_a_history_with_their_axes_and_units(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    printed("respond", path, "--out", out, "--quiet")
    with xarray.open_datatree(out / "runs.nc", engine="h5netcdf") as tree:
        drift = tree["peak_drift"]
        assert (drift.dims, drift.attrs["units"]) == (("row", "motion", "storey"), "m")
        results = mr.load(out, mr.StudyResults)
        assert drift["row"].values.tolist() == [row.label for row in results.rows]
        np.testing.assert_array_equal(drift.values, results.quantities.peak_drift[:, :, 0])
        assert tree["criteria/peak_acceleration"].attrs["units"] == "m/s^2"
    with xarray.open_dataset(next((out / "histories").iterdir()), engine="h5netcdf") as history:
        assert history["drift"].dims == ("time", "storey")


def test_an_unstable_gain_has_a_named_end_with_its_remedy_and_valid_json(path: Path, tmp_path: Path) -> None:
    path.write_text(
        STUDY.replace(
            'law = "best_passive"\nlabel = "best"',
            'law = "active"\nlabel = "stiff"\nsettings = { control_weight = 1e-24, energy = 1 }',
        )
    )
    out = tmp_path / "run"
    document = json.loads(
        printed("respond", path, "--out", out, "--json", "--check-step"), parse_constant=pytest.fail
    )
    failed = [entry for entry in document["results"] if entry["controller"] == "stiff"]
    assert [entry["outcome"] for entry in failed] == ["diverged", "diverged"]
    for entry in failed:
        assert entry["energy_error"] is None
        assert set(entry["criteria"].values()) == {None}
        assert entry["step_check"]["largest"] is None
    assert document["scores"]["stiff"] is None
    assert len(list((out / "histories").iterdir())) == 4
    (said,) = [each["message"] for each in document["remarks"] if each["code"] == "run_unfinished"]
    assert "stiff under 2 of 2 motions, as noise, 0.051 g diverged" in said
    assert "lower the gains of the control law" in said


def test_the_verb_prints_its_building_without_reading_the_rest(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text('[building]\npublished = "uts"\nheight = 3.6\n\n[[controller]]\nlaw = "none"\n')
    text = printed("check", path)
    for word in ("337, 4 x 330 kg", "5 x 3.6 m", "0.3334", "87.85"):
        assert word in text
    document = json.loads(printed("check", path, "--json"))
    assert document["periods"][0] == pytest.approx(1.0 / 3.0, rel=1e-3)
    assert sum(document["effective_masses"]) == pytest.approx(1657.0)


def test_the_verb_prints_no_building_of_a_study_with_an_unknown_table(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text('[building]\npublished = "uts"\n[[wind]]\nspeed = 30\n[[motions]]\nfile = "a.csv"\n')
    refusal(read_bare_building, path, match="line 3: the study has no key 'wind'")
    refusal(read_bare_building, path, match="line 5: .* 'motions', did you mean motion")


def test_what_cannot_be_run_is_one_sentence(refused: Refused) -> None:
    refused.command("respond")
    refused.command("respond", "gone.toml")
    refused.command("check", "gone.toml", "rig.csv")
    refused.command("check", "gone.toml", "--every", "2")
    refused.command("tune", "gone.toml", "--figure", "a.svg")
    refused.command("tune", "gone.toml", "--size", "count", "--quick")


def test_drift_ratios_are_peaks_over_the_heights_of_the_storeys_of_the_bare_building(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(STUDY.replace("[building]\n", '[building]\nheights = ["4 m", 2.5]\n'), encoding="utf-8")
    results = mr.run_study(mr.read_study(path), threads=1)
    for row, motion in np.argwhere(results.quantities.finished[:, :, 0]).tolist():
        found, run = results.criteria(row, motion), results.quantities.at(row, motion)
        assert found is not None
        assert found["peak_drift_ratio"] == max(run["peak_drift"] / [4.0, 2.5])
        # On isolators the slab is weighed, too, whose inertia is in their shear.
        weight = (300.0 if results.rows[row].label == "isolated" else 200.0) * 9.80665
        assert found["base_shear_coefficient"] == pytest.approx(run["peak_base_shear"] / weight)


def test_criteria_of_a_baseline_stand_on_its_own_storeys() -> None:
    frame = {"n_storeys": 2, "masses": ["20 t"], "stiffnesses": ["12 kN/mm"], "height": 3.0}
    study = mr.study_of(
        building={**frame, "storeys_that_yield": {"yield_drift": "5 mm"}},
        motions=[{"synthetic": "kanai_tajimi", "duration": 3.0, "pga": "0.3 g"}],
        baselines=[
            {
                "label": "retrofit",
                "building": {"storeys_that_yield": {"yield_drift": "9 mm"}, "p_delta": True},
            },
            {"label": "tall", "building": {"height": 5.0}},
        ],
    )
    results = mr.run_study(study, threads=1)
    found = {
        row.label: (results.criteria(at, 0) or {}, results.quantities.at(at, 0))
        for at, row in enumerate(results.rows)
    }
    own, run = found["retrofit"]
    assert own["peak_ductility"] == pytest.approx(run["peak_drift"].max() / 9e-3)
    assert own["stability_coefficient"] > 0.0
    assert "stability_coefficient" not in found["uncontrolled"][0]
    own, run = found["tall"]
    assert own["peak_drift_ratio"] == max(run["peak_drift"] / 5.0)
    assert math.isnan(results.ratios(1, 0, 0)["stability_coefficient"])


def test_a_frame_of_a_file_yields_under_its_weight_and_says_what_limits_it_keeps(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    keys = 'height = 3\np_delta = true\ndrift_limit = "0.01 %"\n'
    yields = '[building.storeys_that_yield]\nyield_drift = ["0.1 mm", "0.2 mm"]\n\n'
    text = STUDY.replace("[building]\n", f"[building]\n{keys}")
    first, rest = text.split("\n\n", 1)
    path.write_text(f"{first}\n\n{yields}{rest}", encoding="utf-8")
    results = mr.run_study(mr.read_study(path), threads=1)
    for row, motion in np.argwhere(results.quantities.finished[:, :, 0]).tolist():
        found, run = results.criteria(row, motion), results.quantities.at(row, motion)
        assert found is not None
        assert found["peak_ductility"] == pytest.approx(max(run["peak_drift"] / [1e-4, 2e-4]))
        assert found["residual_drift_ratio"] == pytest.approx(max(abs(run["residual_drift"])) / 3.0)
        # Storeys are no devices.
        controlled = results.rows[row].kind not in ("uncontrolled", "baseline")
        assert np.isfinite(run["peak_force"]).sum() == controlled
        dampers, structure, moving = energy_parts(run)
        assert dampers + structure + moving == pytest.approx(run["input_energy"])
        assert dampers == np.nansum(run["device_energy"])
        assert structure > run["storey_energy"].sum() > 0.0
    (said,) = [each for each in results_in_words(results) if "drift limit" in each]
    assert said.startswith("The drift limit of 0.01 % is ")
    assert "rest_short" in [each.code for each in results.remarks]
    runs = results.quantities
    still = replace(runs, numbers={**runs.numbers, "kinetic_energy": np.zeros(runs.shape)})
    assert "rest_short" not in [each.code for each in storey_remarks(replace(results, quantities=still))]
    # A run that diverges exceeds the limit, as a frame that collapses.
    results = study_samples.diverged(results, 0, 0)
    (said,) = [each for each in results_in_words(results) if "drift limit" in each]
    assert f"{results.rows[0].label} under 2 of {len(results.motions)}, 1 of which diverged" in said
    assert "as a frame does that collapses" in " ".join(warnings_of(results.remarks))
    pushed = json.loads(printed("check", path, "--pushover", "--json"))
    assert pushed["roof"][-1] == pytest.approx(0.04 * 6.0)
    path.write_text(
        path.read_text(encoding="utf-8").replace("pga = [0.5, 1.0]", "pga = 80"), encoding="utf-8"
    )
    fallen = mr.run_study(mr.read_study(path), threads=1).remarks
    assert "drift_beyond_collapse" in [each.code for each in fallen]
    path.write_text(text.replace("height = 3\n", ""), encoding="utf-8")
    refusal(mr.read_study, path, match="drift_limit stands on heights")
