"""Dampers outside their tested ranges: said in Python, in the results, on the page and on the command line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import study_samples
from command_line import printed
from study_samples import ranges

import mrwork as mr
from mrwork.dampers.tested_range import FittedDamper
from mrwork.records import OperatingRange
from mrwork.report.study.page import study_page
from mrwork.store.codec import plain
from mrwork.study import StudyResults, read_study, run_study
from mrwork.study.folder import study_document
from mrwork.study.results import judged_by_demand
from mrwork.study.run_result import demands_of

PRESET = mr.damper("static_hysteretic").preset("kwok2006")
STUDY = """\
references = "none"

[building]
published = "uts"

[[damper]]
storey = 1
run = "run"
count = 2

[[controller]]
law = "passive_on"

[[controller]]
law = "active"
settings = { control_weight = 1e-5 }

[[motion]]
synthetic = "kanai_tajimi"
duration = 3
pga = "0.2 g"

[report]
histories = "all"
"""


def studied(folder: Path, tested: OperatingRange | None, text: str = STUDY) -> StudyResults:
    (folder / "study.toml").write_text(text)

    def identified(run: Path) -> FittedDamper:
        return FittedDamper(spec=PRESET.spec, theta=PRESET.theta, tested=tested)

    return run_study(read_study(folder / "study.toml", identified))


def test_within_the_tested_ranges_nothing_is_said(tmp_path: Path) -> None:
    results = studied(tmp_path, ranges())
    assert results.warnings() == []
    assert [each["outside_tested_range"] for each in study_document(results)["results"]] == [[]] * 4


def test_demand_is_that_on_one_damper(tmp_path: Path) -> None:
    results = studied(tmp_path, ranges())
    off, on = results.runs[1, 0], results.runs[2, 0]
    (demand,) = (each.demand for each in results.demands(2, 0))
    assert demand.force == pytest.approx(0.5 * on.peak_force[0])
    assert demand.power == pytest.approx(0.5 * on.device_energy[0] / results.motions[0].duration)
    assert (demand.stroke, demand.velocity) == (on.peak_stroke[0], on.peak_rate[0])
    # The largest command is that of the tests; kwok2006 itself goes to 1.88 A.
    assert demand.command == (pytest.approx(1.5), pytest.approx(1.5))
    assert results.demands(1, 0)[0].demand.command == (0.0, 0.0)
    assert off.peak_current[0] == 0.0
    # The building without dampers, and ideal actuators in their place.
    assert results.demands(0, 0) == results.demands(3, 0) == ()


def test_a_sentence_for_each_quantity_names_the_worst_run(tmp_path: Path) -> None:
    velocity = studied(tmp_path, ranges()).runs[1, 0].peak_rate[0]
    results = studied(tmp_path, ranges(velocity=0.25 * velocity, command=(0.5, 1.5)))
    first, second = results.warnings()
    assert first.startswith(
        f"velocity {1e3 * velocity:.3g} mm/s, tested to {250 * velocity:.3g} mm/s (4 times): "
    )
    assert first.endswith(
        "under Kanai-Tajimi with Passive-off; outside the tested range in 2 of 2 runs with dampers."
    )
    assert second.startswith("command 0 A, tested from 0.5 to 1.5 A; the laws of c, k, alpha, delta, f0 are")
    assert second.endswith("in 1 of 2 runs with dampers.")
    assert "velocity" in repr(results)
    document = study_document(results)
    assert [each["outside_tested_range"] for each in document["results"]] == [
        [],
        ["velocity", "command"],
        ["velocity"],
        [],
    ]
    assert document["warnings"] == [first, second]


def test_unknown_ranges_are_said_once_and_are_no_warning(tmp_path: Path) -> None:
    text = STUDY.replace('run = "run"', 'run = "run"\nlargest_command = 1.5')
    results = studied(tmp_path, None, text)
    assert results.warnings() == []
    assert study_document(results)["results"][1]["outside_tested_range"] is None
    assert [fact for fact in results.facts if fact[0] == "Tested ranges"] == [("Tested ranges", "not known")]


def test_strokes_below_the_tested_ones_are_named_for_every_run_with_dampers(tmp_path: Path) -> None:
    results = studied(tmp_path, ranges(least_stroke=0.1))
    (warning,) = results.warnings()
    assert warning.startswith("small half cycles, ")
    assert " make 20 % of the travel or more, tested from 100 mm, so " in warning
    assert warning.endswith("outside the tested range in 2 of 2 runs with dampers.")
    # The uncontrolled building and that with actuators demand nothing.
    assert [run.least_stroke.size for run in results.runs.values()] == [0, 1, 1, 1]
    found = results.demands(2, 0)[0].demand.least_stroke
    assert found is not None
    assert 0.0 < found < results.runs[2, 0].peak_stroke[0]
    # A damper that was tested at strokes as small is within its range.
    assert studied(tmp_path, ranges(least_stroke=0.9 * found)).warnings() == []


def test_histories_for_the_least_stroke_change_no_bit_of_the_other_results(tmp_path: Path) -> None:
    without, found = studied(tmp_path, ranges()), studied(tmp_path, ranges(least_stroke=1e-9))
    assert without.runs.keys() == found.runs.keys()
    for key, run in found.runs.items():
        other = replace(run, least_stroke=np.empty(0))
        assert plain(other) == plain(replace(without.runs[key], least_stroke=np.empty(0)))


def test_a_law_that_turns_negative_at_a_demanded_command_is_a_warning(tmp_path: Path) -> None:
    text = STUDY.replace('run = "run"', 'run = "run"\nparameters = { alpha = [-100, 900] }')
    results = studied(tmp_path, ranges(), text)
    assert results.warnings() == ["the law of alpha turns negative: -100 N at 0 A, taken as 0.001 N."]


def test_the_simulation_in_python_says_the_same() -> None:
    building = mr.building("uts")
    device = mr.Device(
        name="pair",
        spec=PRESET.spec,
        theta=PRESET.theta,
        row=building.storeys[0],
        largest_command=1.88,
        count=2.0,
        tested=ranges(velocity=1e-3),
    )
    ground = np.sin(15.0 * np.arange(0.0, 2.0, 0.01))
    motion = mr.GroundMotion(name="sine", dt=0.01, acceleration=ground)
    law = mr.ControlLaw(name="passive", gains={"command": [[1.0], [1.88]]})
    responses = mr.simulate_loop(building, [device], law, [motion])
    assert responses.demand(0, 0).force == pytest.approx(0.5 * responses.peak_force[0, 0])
    assert [each.names for run in (0, 1) for each in responses.outside(run)] == [
        ("velocity",),
        ("velocity", "command"),
    ]
    velocity, command = responses.warnings()
    assert velocity.startswith(f"pair: velocity {1e3 * responses.peak_rate.max():.3g} mm/s, tested to 1 mm/s")
    assert command.startswith("pair: command 1.88 A, tested from 0 to 1.5 A (1.3 times); the laws of")
    assert "warning: pair: velocity" in repr(responses)


def test_the_simulation_in_python_knows_small_strokes_from_its_histories() -> None:
    building = mr.building("uts")
    device = mr.Device(
        name="one",
        spec=PRESET.spec,
        theta=PRESET.theta,
        row=building.storeys[0],
        largest_command=1.88,
        tested=ranges(least_stroke=0.1),
    )
    motion = mr.GroundMotion(name="sine", dt=0.01, acceleration=np.sin(15.0 * np.arange(0.0, 2.0, 0.01)))
    law = mr.ControlLaw(name="passive", gains={"command": [[1.0]]})
    without = mr.simulate_loop(building, [device], law, [motion])
    assert (without.demand(0, 0).least_stroke, without.warnings()) == (None, [])
    (warning,) = mr.simulate_loop(building, [device], law, [motion], histories=True).warnings()
    assert warning.endswith("tested from 100 mm, so the hysteresis of small strokes is extrapolated")


def test_the_page_shows_the_demand_beside_the_tested_range() -> None:
    results = study_samples.results()
    building = mr.building("uts")
    devices = tuple(
        mr.Device(
            name=name,
            spec=PRESET.spec,
            theta=PRESET.theta,
            row=building.storeys[0],
            largest_command=1.88,
            tested=ranges(stroke=1e-3),
        )
        for name in results.device_names
    )
    page = study_page(judged_by_demand(results, devices, building, (0, 0)), study_samples.histories)
    assert "Demand on the dampers" in page
    assert "outside the tested range in stroke." in page
    assert "tested to 1 mm" in page


def test_a_run_that_did_not_finish_demands_nothing() -> None:
    run = replace(study_samples.run(0.1, 1), outcome="diverged").with_numbers(peak_stroke=np.array([np.inf]))
    device = mr.Device(
        name="one", spec=PRESET.spec, theta=PRESET.theta, row=[1.0], largest_command=1.0, tested=ranges()
    )
    assert demands_of(run, (device,), 8.0) == ()
    assert len(demands_of(study_samples.run(0.1, 1), (device,), 8.0)) == 1


def test_the_command_line_says_it_from_a_run_folder(tmp_path: Path) -> None:
    run = tmp_path / "run"
    printed("identify", "synthetic:rd1005_1a", "--model", "bingham", "--out", run, "--quiet")
    stored = json.loads((run / "fit.json").read_text())
    stored["tested"] |= {"velocity": 1e-3}
    (run / "fit.json").write_text(json.dumps(stored))
    study = STUDY.partition("[[controller]]")[0].replace("count = 2", "passive = true")
    (tmp_path / "study.toml").write_text(study + '[[motion]]\nsynthetic = "kanai_tajimi"\nduration = 2\n')
    out = tmp_path / "out"
    text = printed("respond", tmp_path / "study.toml", "--out", out, "--quiet")
    assert "warning: velocity" in text
    assert "mm/s, tested to 1 mm/s" in text
    stored = mr.study.read_results(out)
    assert any("tested to 1 mm/s" in each for each in stored.warnings())
    assert "velocity" in stored.demands(1, 0)[0].outside.names
    assert "tested to 1 mm/s" in (out / "report.html").read_text()
