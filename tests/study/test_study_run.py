"""A study, run: each run once, resumed to the bit, written whole."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import printed
from sentences import Refused

import mrwork as mr
from mrwork import Journal
from mrwork.dampers.simulation import Outcome
from mrwork.errors import Interrupted
from mrwork.store.codec import plain
from mrwork.store.journal import line_of, read_lines
from mrwork.store.unfinished import begin_journal
from mrwork.study import Study, StudyResults, read_study, run_study
from mrwork.study.comparison import findings
from mrwork.study.course import StudyProgress
from mrwork.study.run_result import Histories, RunHistory

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


@pytest.fixture
def study(path: Path) -> Study:
    return read_study(path, lambda run: pytest.fail(f"{run} is not asked for"))


def ran(study: Study, journal: Path, *, resume: bool = False, interrupt: int = -1) -> StudyResults:
    """Run a study; `interrupt` is how many runs are done when Ctrl-C comes."""

    def on_progress(progress: StudyProgress) -> None:
        if progress.done == interrupt:
            raise KeyboardInterrupt

    opened = Journal(journal, resume=resume)
    try:
        return run_study(study, journal=opened, on_progress=on_progress)
    finally:
        opened.close()


def test_every_arrangement_runs_under_every_motion(study: Study, tmp_path: Path) -> None:
    results = ran(study, tmp_path / "journal")
    assert results.complete
    assert {run.outcome for run in results.runs.values()} == {"finished"}
    assert [row.label for row in results.rows[:3]] == ["uncontrolled", "Passive-off", "isolated"]
    for run in results.runs.values():
        assert run.peak_drift.shape == run.peak_acceleration.shape == (2,)


def test_a_building_without_dampers_is_linear_in_its_motion(study: Study, tmp_path: Path) -> None:
    results = ran(study, tmp_path / "journal")
    weak, strong = results.runs[0, 0], results.runs[0, 1]
    assert strong.peak_drift == pytest.approx(2.0 * weak.peak_drift, rel=1e-9)


def test_the_best_constant_command_is_no_worse_than_none(study: Study, tmp_path: Path) -> None:
    results = ran(study, tmp_path / "journal")
    assert results.rows[3].label.startswith("best, ")
    assert results.score(3) <= results.score(1) == pytest.approx(1.0)


def test_the_best_constant_command_is_chosen_on_training_motions(path: Path, tmp_path: Path) -> None:
    training = """
[[motion]]
synthetic = "kanai_tajimi"
name = "strong noise"
duration = 3
seed = 7
pga = 6.0
"""

    def best(text: str, journal: str) -> tuple[str, StudyResults]:
        path.write_text(text)
        results = run_study(read_study(path).of_use("test"), journal=Journal(tmp_path / journal))
        return results.rows[3].label, results

    alone, _ = best(
        STUDY.replace("pga = [0.5, 1.0]", "pga = 6.0").replace("duration = 3", "duration = 3\nseed = 7"),
        "alone",
    )
    judged, _ = best(STUDY, "judged")
    chosen, results = best(STUDY + training + 'use = "training"', "chosen")
    assert chosen == alone != judged
    assert len(results.motions) == 2


def test_the_ideal_force_does_not_depend_on_how_many_dampers_it_replaces(path: Path, tmp_path: Path) -> None:
    scores = []
    for number, dampers in enumerate(("", "count = 3", "differential = true")):
        text = STUDY.replace("differential = true", dampers)
        text = text.replace(
            'law = "best_passive"', 'law = "active"\nsettings = { control_weight = 1e-4, energy = 1 }'
        )
        path.write_text(text)
        study = read_study(path, lambda run: pytest.fail(f"{run} is not asked for"))
        run = ran(study, tmp_path / f"journal{number}").runs[4, 1]
        scores.append((run.peak_drift.max(), run.peak_force.max()))
        # What it is told is a force, not a current.
        assert run.rms_current.size == run.mean_current.size == 0
    assert scores[1] == pytest.approx(scores[0], rel=1e-9)
    assert scores[2] == pytest.approx(scores[0], rel=1e-9)


def test_an_interrupted_study_has_what_is_done_and_resumes_to_the_bit(study: Study, tmp_path: Path) -> None:
    whole = ran(study, tmp_path / "whole")
    with pytest.raises(Interrupted) as interrupted:
        ran(study, tmp_path / "journal", interrupt=4)
    assert len(interrupted.value.result.runs) == 4
    lines = (tmp_path / "journal").read_text().count("\n")
    resumed = ran(study, tmp_path / "journal", resume=True)
    assert resumed.rows == whole.rows
    for key, run in whole.runs.items():
        for name in ("peak_drift", "rms_acceleration", "device_energy"):
            assert np.array_equal(getattr(run, name), getattr(resumed.runs[key], name)), name
    # What was recorded is not run again: the file has grown by the runs that were missing, and the search.
    assert (tmp_path / "journal").read_text().count("\n") == lines + len(whole.runs) - 4 + 1


def test_a_journal_of_another_study_is_refused(
    study: Study, path: Path, tmp_path: Path, refused: Refused
) -> None:
    ran(study, tmp_path / "journal")
    path.write_text(STUDY.replace("masses = [100, 100]", "masses = [100, 110]"))
    other = read_study(path, lambda run: pytest.fail(f"{run} is not asked for"))
    refused(ran, other, tmp_path / "journal", resume=True)


def test_a_journal_changes_no_result(study: Study, tmp_path: Path) -> None:
    assert plain(run_study(study).runs) == plain(ran(study, tmp_path / "journal").runs)


def test_a_history_that_is_lost_is_simulated_again(study: Study, tmp_path: Path) -> None:
    ran(study, tmp_path / "journal")
    found: dict[tuple[int, int], RunHistory] = {}

    def keep(row: int, motion: int, history: RunHistory) -> None:
        found[row, motion] = history

    journal = Journal(tmp_path / "journal", resume=True)
    results = run_study(study, journal=journal, kept=lambda row, motion: row != 1, keep=keep)
    journal.close()
    # That of the stronger motion, which is drawn.
    assert set(found) == {(1, 1)}
    drift = np.abs(found[1, 1].drift).max(axis=0)
    # A history has the samples, peaks are of every step.
    assert drift == pytest.approx(results.runs[1, 1].peak_drift, rel=1e-2)


def test_a_history_is_the_same_with_its_run_and_by_itself(study: Study, tmp_path: Path) -> None:
    found: list[dict[tuple[int, int], RunHistory]] = []
    for resume in (False, True):
        histories: dict[tuple[int, int], RunHistory] = {}
        journal = Journal(tmp_path / "journal", resume=resume)
        run_study(
            study,
            journal=journal,
            kept=lambda row, motion: False,
            keep=lambda row, motion, history, into=histories: into.update({(row, motion): history}),  # type: ignore[misc] # the default holds the dictionary
        )
        journal.close()
        found.append(histories)
    with_run, alone = found
    assert set(with_run) == set(alone) == {(row, 1) for row in range(4)}
    for key, history in with_run.items():
        for name, signal in history.numbers.items():
            assert np.array_equal(signal, alone[key].numbers[name]), name


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
    assert journal.count('"run with half the step"') == 8
    assert "On/off laws" in (out / "report.html").read_text()
    text = printed("respond", path, "--out", out, "--quiet", "--resume", "--check-step")
    assert "Half the step: the largest change" in text
    # Recalled, not run again.
    assert (out / "journal.jsonl").read_text() == journal


FORGED: dict[str, Callable[[dict[str, np.ndarray]], object]] = {
    "it has no drift": lambda arrays: arrays.pop("drift"),
    "rate has a number that is not finite": lambda arrays: arrays["rate"].__setitem__((3, 0), np.nan),
    "force has other values": lambda arrays: arrays.update(force=arrays["force"].astype(complex)),
    "energy has other values": lambda arrays: arrays.update(energy=np.full(arrays["energy"].shape, "x")),
    "acceleration has another shape": lambda arrays: arrays.update(
        acceleration=arrays["acceleration"][:, :1]
    ),
    "command has the shape": lambda arrays: arrays.update(command=arrays["command"][:-1]),
    "its times are not": lambda arrays: arrays["time"].__setitem__(2, 0.5),
    "it has fewer samples": lambda arrays: arrays.update({name: each[:9] for name, each in arrays.items()}),
}


@pytest.mark.parametrize("forge", FORGED.values(), ids=FORGED)
def test_a_forged_history_is_refused_and_simulated_again(
    study: Study, tmp_path: Path, forge: Callable[[dict[str, np.ndarray]], object], refused: Refused
) -> None:
    histories = Histories(tmp_path / "run", study, resume=False)
    run_study(study, keep=histories.keep, threads=1)
    row, motion = 1, study.histories[0]
    assert study.arrangements[row].devices
    path = next(each for each in histories.paths() if each.name.startswith(f"{row + 1:02d}-{motion + 1:02d}"))
    with np.load(path) as archive:
        arrays = dict(archive)
    forge(arrays)
    np.savez(path, **arrays)  # type: ignore[arg-type] # no array is called allow_pickle
    refused(histories._read, path, row, motion)
    assert not histories.is_stored(row, motion)
    run_study(study, kept=histories.is_stored, keep=histories.keep, threads=1)
    assert histories._read(path, row, motion).time.size


def test_a_best_constant_command_that_was_not_tried_is_refused(
    study: Study, tmp_path: Path, refused: Refused
) -> None:
    for command in (-5.0, 1e9, math.nan, 0.01):
        path = tmp_path / "study.jsonl"
        path.unlink(missing_ok=True)
        ran(study, path)
        entries, _ = read_lines(path.read_bytes(), path)
        number = next(place for place, entry in enumerate(entries) if entry["step"] == "best_constant")
        entries[number]["result"]["command"] = command
        # Its runs, which would be others, are still to come.
        path.write_bytes(b"".join(map(line_of, entries[: number + 1])))
        refused(ran, study, path, resume=True)


def test_a_damaged_history_is_simulated_again_on_resuming(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    printed("respond", path, "--out", out, "--quiet")
    files = sorted((out / "histories").iterdir())
    whole = files[0].read_bytes()
    middle = len(whole) // 2
    damaged = {
        "cut": whole[:middle],
        "empty": b"",
        "one bit": whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :],
        "not an archive": b"\x93NUMPY" + whole[:100],
    }
    for damage, content in damaged.items():
        files[0].unlink()
        files[0].write_bytes(content)
        printed("respond", path, "--out", out, "--quiet", "--resume")
        assert sorted((out / "histories").iterdir()) == files
        with np.load(files[0]) as found, np.load(io.BytesIO(whole)) as expected:
            for name in expected.files:
                assert np.array_equal(found[name], expected[name]), (damage, name)


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
    for text in (
        printed("respond", path, "--out", out, "--quiet", "--resume"),
        (out / "report.html").read_text(),
    ):
        assert (
            "stiff under 2 of 2 motions, as noise, 0.051 g, diverged: the state left the finite numbers; "
            in text
        )
        assert "lower the gains of the control law" in text


def test_a_sensor_that_gives_no_number_ends_in_a_named_outcome(path: Path, tmp_path: Path) -> None:
    broken = STUDY.replace(
        'law = "best_passive"\nlabel = "best"', 'law = "fuzzy"\nsettings = { deformation = 0.01, rate = 0.1 }'
    )
    broken += '[[hardware.fault]]\nsignal = "deformation"\nstart = 1\nend = 1.5\nvalue = nan\n'
    path.write_text(broken)
    document = json.loads(printed("respond", path, "--out", tmp_path / "run", "--json"))
    entry = document["results"][8]
    assert (entry["controller"], entry["outcome"]) == ("Fuzzy", "failed_safe")
    assert entry["criteria"]["peak_drift"] > 0.0
    assert entry["energy_error"] < 1e-6
    assert any(
        f"noise, 0.051 g, failed safe: {Outcome.FAILED_SAFE.remedy}." in warning
        for warning in document["warnings"]
    )


def test_the_verb_writes_tables_histories_and_page(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    document = json.loads(printed("respond", path, "--out", out, "--json"))
    assert document["complete"] is True
    assert len(document["results"]) == 8
    for entry in document["results"]:
        assert {"controller", "motion", "outcome", "criteria", "energy_error"} <= set(entry)
    names = {entry.name for entry in out.iterdir()}
    assert names == {
        "manifest.json",
        "journal.jsonl",
        "results.json",
        "study.toml",
        "report.html",
        "criteria.csv",
        "profiles.csv",
        "histories",
        "data",
    }
    assert len(list((out / "histories").iterdir())) == 4
    assert len((out / "criteria.csv").read_text().splitlines()) == 9
    assert "Two storeys" in (out / "report.html").read_text()
    assert not (tmp_path / "run.part").exists()


def test_the_verb_goes_on_with_a_killed_study(study: Study, path: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    journal, histories = begin_journal(out), Histories(out, study, resume=False)

    def on_progress(progress: StudyProgress) -> None:
        if progress.done == 4:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted):
        run_study(
            study, journal=journal, kept=histories.is_stored, keep=histories.keep, on_progress=on_progress
        )
    journal.close()
    resumed = json.loads(printed("respond", path, "--out", out, "--json", "--resume"))
    fresh = json.loads(printed("respond", path, "--out", tmp_path / "fresh", "--json"))
    assert resumed["results"] == fresh["results"]
    assert len(list((out / "histories").iterdir())) == 4
    assert not (tmp_path / "run.part").exists()


def test_the_verb_shows_a_table_for_each_motion(path: Path, tmp_path: Path) -> None:
    text = printed("respond", path, "--out", tmp_path / "run", "--quiet")
    for word in (
        "noise, 0.051 g",
        "noise, 0.102 g",
        "uncontrolled",
        "Passive-off",
        "isolated",
        "best, ",
        "Score",
        "Report:",
    ):
        assert word in text


def test_the_verb_prints_its_schema_and_its_laws() -> None:
    assert "[[damper]]" in printed("respond", "--schema")
    assert "best_passive" in printed("respond", "--laws")


def test_the_verb_prints_its_building_without_reading_the_rest(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "study.toml"
    path.write_text(
        '[building]\npublished = "uts"\nheight = 3.6\n\n[[controller]]\nlaw = "none"\n', encoding="utf-8"
    )
    text = printed("respond", path, "--building")
    for word in ("337, 4 x 330 kg", "5 x 3.6 m", "0.3334", "87.85"):
        assert word in text
    document = json.loads(printed("respond", path, "--building", "--json"))
    assert document["periods"][0] == pytest.approx(1.0 / 3.0, rel=1e-3)
    assert sum(document["effective_masses"]) == pytest.approx(1657.0)
    path.write_text("[hardware]\n", encoding="utf-8")
    refused.command("respond", path, "--building")


def test_what_cannot_be_run_is_one_sentence(refused: Refused) -> None:
    for arguments in (
        [],
        ["gone.toml"],
        ["gone.toml", "--seed", "-1"],
    ):
        refused.command("respond", *arguments)


def test_drift_ratios_are_peaks_over_the_heights_of_the_storeys_of_the_bare_building(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(STUDY.replace("[building]\n", '[building]\nheights = ["4 m", 2.5]\n'), encoding="utf-8")
    results = run_study(read_study(path), threads=1)
    for row, motion in results.runs:
        found, run = results.criteria(row, motion), results.runs[row, motion]
        assert found is not None
        assert found["peak_drift_ratio"] == max(run.peak_drift / [4.0, 2.5])
        assert found["base_shear_coefficient"] == pytest.approx(run.peak_base_shear / (200.0 * 9.80665))


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
    results = run_study(study, threads=1)
    found = {
        row.label: (results.criteria(at, 0) or {}, results.runs[at, 0]) for at, row in enumerate(results.rows)
    }
    own, run = found["retrofit"]
    assert own["peak_ductility"] == pytest.approx(run.peak_drift.max() / 9e-3)
    assert own["stability_coefficient"] > 0.0
    assert "stability_coefficient" not in found["uncontrolled"][0]
    own, run = found["tall"]
    assert own["peak_drift_ratio"] == max(run.peak_drift / 5.0)
    assert math.isnan(results.ratios_to(1, 0, 0)["stability_coefficient"])


def test_a_frame_of_a_file_yields_under_its_weight_and_says_what_limits_it_keeps(
    tmp_path: Path, refused: Refused
) -> None:
    path = tmp_path / "study.toml"
    keys = 'height = 3\np_delta = true\ndrift_limit = "0.01 %"\n'
    yields = '[building.storeys_that_yield]\nyield_drift = ["0.1 mm", "0.2 mm"]\n\n'
    text = STUDY.replace("[building]\n", f"[building]\n{keys}")
    first, rest = text.split("\n\n", 1)
    path.write_text(f"{first}\n\n{yields}{rest}", encoding="utf-8")
    results = run_study(read_study(path), threads=1)
    for row, motion in results.runs:
        found, run = results.criteria(row, motion), results.runs[row, motion]
        assert found is not None
        assert found["peak_ductility"] == pytest.approx(max(run.peak_drift / [1e-4, 2e-4]))
        assert found["residual_drift_ratio"] == pytest.approx(max(abs(run.residual_drift)) / 3.0)
        # Storeys are no devices.
        assert run.peak_force.size == (results.rows[row].kind not in ("uncontrolled", "baseline"))
        bars = results.plot.energies(motion=motion, data=True).iloc[row]
        assert bars.sum() == pytest.approx(run.input_energy)
        assert bars["dampers"] == run.device_energy.sum()
        assert bars["structure"] > run.storey_energy.sum() > 0.0
    (said,) = [each for each in findings(results) if "drift limit" in each]
    assert said.startswith("The drift limit of 0.01 % is ")
    assert any("still moves at the end of 2 of 2 motions" in each for each in findings(results))
    still = {key: run.with_numbers(kinetic_energy=0.0) for key, run in results.runs.items()}
    assert not any("still moves" in each for each in findings(replace(results, runs=still)))
    # A run that diverges exceeds the limit, as a frame that collapses.
    fallen = replace(results.runs[0, 0], outcome="diverged")
    results = replace(results, runs={**results.runs, (0, 0): fallen})
    (said,) = [each for each in findings(results) if "drift limit" in each]
    assert f"{results.rows[0].label} under 2 of {len(results.motions)}, 1 of which diverged" in said
    assert any(f"{results.motions[0].name} diverged, as a frame does" in each for each in results.warnings())
    pushed = json.loads(printed("respond", path, "--pushover", "--json"))
    assert pushed["roof"][-1] == pytest.approx(0.04 * 6.0)
    path.write_text(
        path.read_text(encoding="utf-8").replace("pga = [0.5, 1.0]", "pga = 80"), encoding="utf-8"
    )
    fallen = findings(run_study(read_study(path), threads=1))
    assert any("above 10 % a real frame has collapsed" in each for each in fallen)
    path.write_text(text.replace("height = 3\n", ""), encoding="utf-8")
    refused.command("respond", path)
