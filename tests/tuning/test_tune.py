"""A tuning: chosen on training motions, judged on test motions, the same bits again after an interruption."""

from __future__ import annotations

import json
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tuning_samples
from sentences import Refused
from study_samples import ranges

import mrwork as mr
from mrwork.closed_loop import SCORE
from mrwork.closed_loop.evaluation import ties_in_words
from mrwork.errors import Interrupted
from mrwork.store.codec import digest_of, plain
from mrwork.store.journal import line_of
from mrwork.study import OPTIMAL_PASSIVE
from mrwork.tuning import TuningResults, tune
from mrwork.tuning.problem import Clock, benches_of
from mrwork.tuning.results import chosen_study, settings_in_words, tuning_document
from mrwork.tuning.space import LawCandidate


def without_times(results: TuningResults) -> Any:
    still = replace(results, seconds=0.0, candidates_per_second=0.0, seconds_outside=0.0)
    laws = tuple(replace(each, seconds=0.0) for each in still.laws)
    references = tuple(replace(each, seconds=0.0) for each in still.references)
    return plain(tuning_document(replace(still, laws=laws, references=references)))


@pytest.fixture(scope="module")
def study() -> mr.Study:
    return tuning_samples.small_study()


@pytest.fixture(scope="module")
def results(study: mr.Study) -> TuningResults:
    return tune(study, threads=1)


@pytest.fixture(scope="module")
def journal_content(study: mr.Study, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The journal of the tuning."""
    path = tmp_path_factory.mktemp("journal") / "journal.jsonl"
    with closing(mr.Journal(path)) as journal:
        tune(study, threads=1, journal=journal)
    return path.read_bytes()


def test_tuned_settings_are_no_worse_than_equal_weights_on_the_training_motions(
    results: TuningResults,
) -> None:
    law = results.laws[0]
    equal = next(each for each in results.references if each.label.startswith("Equal drift weights"))
    assert law.train.objective <= equal.train.objective
    assert law.train.score == law.train.objective
    assert law.trace[-1].least == pytest.approx(law.train.objective)


def test_journals_keep_their_digest_of_a_candidate() -> None:
    # Of the first version that wrote journals, under the former name of the class.
    candidate = LawCandidate(settings={"command": 1.0}, largest_command=2.0)
    assert digest_of(candidate) == "d64e66d7248d4e0953856dcabaf4e1c4"


def test_test_motions_are_not_those_of_the_training(results: TuningResults) -> None:
    assert results.training == ("A",)
    assert results.testing == ("B", "C")
    assert [each.motion for each in results.laws[0].test.motions] == ["B", "C"]  # type: ignore[union-attr] # judged
    assert not any("training" in each and "only" in each for each in results.warnings)


def test_the_references_begin_with_the_dampers_at_zero_command(results: TuningResults) -> None:
    off, best, largest = results.references[:3]
    assert off.train.score == off.test.score == 1.0  # type: ignore[union-attr] # judged
    assert best.train.score <= min(off.train.score, largest.train.score)
    assert largest.settings["command"] == 1.88


def test_threads_change_no_bit(study: mr.Study, results: TuningResults) -> None:
    assert without_times(tune(study, threads=2)) == without_times(results)


@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 0.8, 0.95, 1.0])
def test_a_journal_that_was_cut_resumes_to_the_same_bits(
    study: mr.Study, results: TuningResults, journal_content: bytes, share: float, tmp_path: Path
) -> None:
    path = tmp_path / "journal.jsonl"
    path.write_bytes(journal_content[: int(share * len(journal_content))])
    with closing(mr.Journal(path, resume=True)) as journal:
        again = tune(study, threads=1, journal=journal)
    assert without_times(again) == without_times(results)
    if share == 1.0:
        assert path.read_bytes() == journal_content


@pytest.mark.parametrize("step", ["passive", "reference", "judgement", "first candidates"])
def test_a_result_of_another_size_than_its_inputs_is_refused(
    study: mr.Study, journal_content: bytes, step: str, tmp_path: Path, refused: Refused
) -> None:
    path = tmp_path / "journal.jsonl"
    lines = [json.loads(line) for line in journal_content.splitlines()]
    results = next(line for line in lines if line["step"] == step)["result"]
    for name, value in results.items():
        if isinstance(value, list):
            results[name] = value[:-1]
        elif isinstance(value, dict):
            # An array: the last of its motions is left out.
            shape = [*value["shape"][:-2], 0, value["shape"][-1]]
            results[name] = {**value, "shape": shape, "hex": ""}
    path.write_bytes(
        b"".join(line_of({key: value for key, value in line.items() if key != "crc32"}) for line in lines)
    )
    with closing(mr.Journal(path, resume=True)) as resumed:
        refused(tune, study, threads=1, journal=resumed)


def test_the_chosen_study_has_the_scores_of_the_tuning(results: TuningResults, tmp_path: Path) -> None:
    source = tuning_samples.study_file(tmp_path)
    (tmp_path / "out").mkdir()
    chosen = tmp_path / "out" / "chosen.toml"
    chosen.write_text(chosen_study(results, mr.read_study(source).file), encoding="utf-8")
    found = mr.run_study(mr.read_study(chosen), threads=1)
    row = [each.label for each in found.rows].index(results.laws[0].label)
    assert results.laws[0].test is not None
    assert found.score(row) == pytest.approx(results.laws[0].test.score, rel=1e-12)


def test_designed_weights_and_numbers_with_units_are_held(tmp_path: Path) -> None:
    text = (
        tuning_samples.TUNE.replace("clipped", "modified_clipped")
        + 'settings = { full_force = "2 kN", designed = { rms_drift = "2 mm", budget = "0.5 kN" } }\n'
        + "free = { control_weight = [1e-4, 10] }\n"
    )
    found = tuning_samples.tuned(tmp_path, text)
    source = tmp_path / "study.toml"
    settings = found.laws[0].settings
    assert settings["full_force"] == 2000.0
    assert settings["designed"] == {"rms_drift": 0.002, "budget": 500.0}
    assert "rms_drift 0.002" in settings_in_words(settings, found.command_unit)
    (tmp_path / "chosen.toml").write_text(chosen_study(found, mr.read_study(source).file), encoding="utf-8")
    again = mr.run_study(mr.read_study(tmp_path / "chosen.toml"), threads=1)
    row = [each.label for each in again.rows].index(found.laws[0].label)
    assert found.laws[0].test is not None
    assert again.score(row) == pytest.approx(found.laws[0].test.score, rel=1e-12)


def test_a_label_of_the_study_is_not_given_again(
    tmp_path: Path, results: TuningResults, refused: Refused
) -> None:
    source = tuning_samples.study_file(tmp_path)
    chosen = tmp_path / "chosen.toml"
    chosen.write_text(chosen_study(results, mr.read_study(source).file), encoding="utf-8")
    refused(tune, mr.read_study(chosen), threads=1)


def test_the_chosen_study_finds_the_files_of_a_study_that_names_a_folder(
    results: TuningResults, tmp_path: Path
) -> None:
    source = tuning_samples.study_file(tmp_path)
    (tmp_path / "data").mkdir()
    time = np.linspace(0.0, 2.0, 201)
    np.savetxt(tmp_path / "data" / "m.csv", np.c_[time, np.sin(9.0 * time)], delimiter=",", header="t,a")
    text = source.read_text(encoding="utf-8").replace("title", 'folder = "data"\ntitle')
    source.write_text(text + '\n[[motion]]\nfile = "m.csv"\nunit = "m/s2"\n', encoding="utf-8")
    (tmp_path / "out").mkdir()
    chosen = tmp_path / "out" / "chosen.toml"
    chosen.write_text(chosen_study(results, mr.read_study(source).file), encoding="utf-8")
    assert len(mr.read_study(chosen).motions) == len(mr.read_study(source).motions)


def test_an_interrupted_tuning_keeps_the_laws_so_far(study: mr.Study) -> None:
    def interrupt(progress: object) -> None:
        calls.append(progress)
        if len(calls) == 3:
            raise KeyboardInterrupt

    calls: list[object] = []
    with pytest.raises(Interrupted) as caught:
        tune(study, threads=1, on_progress=interrupt)
    found: TuningResults = caught.value.result
    assert found.status == "interrupted"
    assert len(found.references) == 7
    assert found.laws[0].train.objective > 0.0
    assert found.laws[0].test is None


def test_without_training_motions_the_score_is_said_to_be_of_the_motions_tuned_on(tmp_path: Path) -> None:
    motions = tuning_samples.motion("A", 1)
    found = tune(mr.read_study(tuning_samples.study_file(tmp_path, motions=motions)), threads=1)
    assert found.testing == ()
    assert found.laws[0].test is None
    assert "says nothing about others" in found.warnings[0]


def test_a_limit_that_holds_is_kept(tmp_path: Path, results: TuningResults) -> None:
    limit = 0.5 * results.laws[0].train.largest["rms_current"]
    text = tuning_samples.TUNE.replace("16", "96") + f"constraints = {{ rms_current = {limit} }}\n"
    found = tuning_samples.tuned(tmp_path, text)
    assert found.laws[0].train.violation == 0.0
    assert found.laws[0].train.largest["rms_current"] <= limit


@pytest.mark.parametrize(("name", "unit"), [("command_travel", "A/s"), ("switching_rate", "1/s")])
def test_chatter_is_limited_as_other_criteria_are(
    name: str, unit: str, tmp_path: Path, results: TuningResults
) -> None:
    limit = 0.7 * results.laws[0].train.largest[name]
    text = tuning_samples.TUNE.replace("16", "96") + f'constraints = {{ {name} = "{limit:.6g} {unit}" }}\n'
    found = tuning_samples.tuned(tmp_path, text)
    assert found.laws[0].train.violation == 0.0
    assert found.laws[0].train.largest[name] <= limit * (1.0 + 1e-5)


def test_laws_are_compared_by_the_score_of_a_study_whatever_they_minimise(tmp_path: Path) -> None:
    text = '[[tune]]\nlaws = ["maximum_energy_dissipation"]\ncriteria = { peak_acceleration = 2, peak_drift = 1 }\n'
    found = tuning_samples.tuned(tmp_path, text).laws[0].train
    ratios = [found.criteria[name] for name in SCORE]
    assert found.score == pytest.approx(sum(ratios) / 4)
    weighted = 2.0 * found.criteria["peak_acceleration"] + found.criteria["peak_drift"]
    assert found.objective == pytest.approx(weighted / 3.0)


def test_a_law_may_be_tuned_to_be_better_than_the_best_constant_command(tmp_path: Path) -> None:
    peaks = ("peak_drift", "peak_acceleration")
    keys = f'criteria = {list(peaks)}\nrelative_to = "best_passive"\ncombine = "largest"\n'
    text = '[[tune]]\nlaws = ["maximum_energy_dissipation"]\n' + keys
    found = tuning_samples.tuned(tmp_path, text)
    law, constant = (
        each.test for each in (found.laws[0], next(r for r in found.references if r.label == OPTIMAL_PASSIVE))
    )
    assert law is not None
    assert constant is not None
    worst = [
        max(one.criteria[name] / other.criteria[name] for name in peaks)
        for one, other in zip(law.motions, constant.motions, strict=True)
    ]
    assert law.objective == pytest.approx(np.mean(worst), rel=1e-12)
    assert found.laws[0].better is not None
    assert sum(each < 1.0 for each in worst) == found.laws[0].better.both


@pytest.mark.parametrize("law", ["clipped_optimal", "maximum_energy_dissipation"])
def test_candidates_of_several_largest_commands_are_one_batch_with_the_results_of_single_ones(
    study: mr.Study, law: str
) -> None:
    bench = benches_of(study, journal=None, threads=1, clock=Clock()).training
    settings = {"drifts": 1.0, "control_weight": 1e-13} if law == "clipped_optimal" else {}
    candidates = [LawCandidate(settings=settings, largest_command=largest) for largest in (0.3, 1.0, 1.88)]
    together, alone = bench.run(law, candidates), [bench.run(law, [each]) for each in candidates]
    for name, array in together.numbers.items():
        single = np.concatenate([each.numbers[name] for each in alone])
        # An error of the balance is rounding itself.
        assert name == "energy_error" or array == pytest.approx(single, rel=1e-9, nan_ok=True)
        assert np.array_equal(array[2], single[2], equal_nan=True)


def test_realisations_widen_the_judgement_and_belong_to_a_robust_objective(tmp_path: Path) -> None:
    more = "[uncertainty]\nrealisations = 3\nstiffness = 0.1\ndelay = '2 ms'\n"
    text = tuning_samples.TUNE + 'robust = true\nrisk = "max"\n'
    study = mr.read_study(tuning_samples.study_file(tmp_path, tune=text, more=more))
    found = tune(study, threads=1).laws[0]
    band = found.train.bands["score"]
    assert band.lower < band.median < band.upper
    # The largest of three realisations under one motion; the band lies within them.
    assert found.train.objective >= band.upper


def test_bands_are_those_of_the_test_motions_where_no_table_is_robust(tmp_path: Path) -> None:
    more = "[uncertainty]\nrealisations = 3\nstiffness = 0.1\n"
    found = tune(mr.read_study(tuning_samples.study_file(tmp_path, more=more)), threads=1).laws[0]
    assert found.test is not None
    band = found.test.bands["score"]
    assert band.lower < band.median < band.upper
    assert found.train.bands == {}


def tuned(path: Path) -> TuningResults:
    return tune(mr.read_study(path), threads=1)


def test_what_cannot_be_tuned_is_refused(tmp_path: Path, refused: Refused) -> None:
    for text in (
        "",
        '[[tune]]\nlaws = ["clipped_optima"]',
        '[[tune]]\nlaws = ["lyapunov"]\nsearch = "genetics"',
        '[[tune]]\nlaws = ["lyapunov"]\nrobust = true',
        '[[tune]]\nlaws = ["lyapunov", "lyapunov"]',
        '[[tune]]\nlaws = ["lyapunov"]\n[[tune]]\nlaws = ["lyapunov"]',
        '[[tune]]\nlaws = ["lyapunov"]\nbudget = 6\npopulation = 8',
        '[[tune]]\nlaws = ["lyapunov"]\nbudget = 8\npopulation = 4',
        '[[tune]]\nlaws = "lyapunov"',
        '[[tune]]\nlaws = ["clipped_optimal"]\nsettings = { drifts = -1 }',
        '[[tune]]\nlaws = ["clipped_optimal"]\nsettings = { drifts = [1, 2] }',
        '[[tune]]\nlaws = ["clipped_optimal"]\nsettings = { drifts = 1, energy = 1 }',
        '[[tune]]\nlaws = ["clipped_optimal"]\nfree = { control_weight = [1e-60, 1e60] }',
        '[[tune]]\nlaws = ["lyapunov"]\ncriteria = ["rms_current"]',
        '[[tune]]\nlaws = ["lyapunov"]\ncriteria = ["switching_rate"]',
        '[[tune]]\nlaws = ["lyapunov"]\nobjectives = ["peak_drift", "mean_current"]',
        '[[tune]]\nlaws = ["lyapunov"]\ncriteria = ["peak_drift_ratio"]',
        '[[tune]]\nlaws = ["lyapunov"]\nconstraints = { peak_drift_ratio = "1 %" }',
    ):
        path = tuning_samples.study_file(tmp_path, tune=text)
        refused(tuned, path)


def test_points_of_a_front_are_ratios_whatever_the_limits(tmp_path: Path) -> None:
    pytest.importorskip("pymoo")
    text = '[[tune]]\nlaws = ["clipped_optimal"]\nbudget = 5\npopulation = 5\n'
    text += 'objectives = ["peak_drift", "rms_drift"]\n'
    limit = "constraints = { peak_stroke = 1e-9 }\n"
    front = tuning_samples.tuned(tmp_path, text + limit).fronts[0]
    assert all(0.0 < ratio < 3.0 for point in front.points for ratio in point.train.values())


def test_strokes_below_the_tested_ones_are_named_for_the_tuned_laws(study: mr.Study, tmp_path: Path) -> None:
    tested = ranges(command=(0.0, 2.0), least_stroke=0.1)
    assert study.problem is not None
    devices = tuple(replace(each, tested=tested) for each in study.problem.devices)
    limited = replace(
        study,
        devices=devices,
        problem=replace(study.problem, devices=devices),
        arrangements=tuple(
            replace(each, devices=devices) if each.devices else each for each in study.arrangements
        ),
    )
    with closing(mr.Journal(tmp_path / "journal.jsonl")) as journal:
        found = tune(limited, threads=1, journal=journal)
    (warning,) = found.damper_warnings
    assert " make 20 % of the travel or more, tested from 100 mm, so " in warning
    assert f"with {found.laws[0].label}" in warning
    # Under the training motion and both test motions.
    assert warning.endswith("outside the tested range in 3 of 3 runs with dampers.")
    assert warning in found.warnings
    assert warning in tuning_document(found)["warnings"]
    with closing(mr.Journal(tmp_path / "journal.jsonl", resume=True)) as journal:
        assert without_times(tune(limited, threads=1, journal=journal)) == without_times(found)


def test_within_the_tested_ranges_a_tuning_says_nothing_of_the_dampers(results: TuningResults) -> None:
    assert results.damper_warnings == ()


def test_semi_active_weights_are_scanned_by_their_budget_and_are_a_reference(results: TuningResults) -> None:
    """Each law states its margins, and the reference its ground and the budget of the best scale."""
    (found,) = [each for each in results.references if "budget scanned" in each.label]
    assert found.settings["designed"]["semi_active"] == 0.1
    assert found.settings["control_weight"] == 1.0
    assert found.candidates >= 10
    assert any(
        "1 training motion" in each or "of the training motion" in each for each in found.design.weights
    )
    assert any("budget_scale" in each for each in found.design.weights)
    assert "Margins of the linear loop" in results.laws[0].design.loop[-1]
    assert [labels for labels, _ in results.designs] == [(found.label,)]


def test_laws_that_motions_do_not_tell_apart_are_named() -> None:
    """A difference counts from two standard errors of its mean on; one motion tells nothing."""
    one, other = [0.5, 0.6, 0.7, 0.8], [0.51, 0.59, 0.72, 0.79]
    worse = [0.6, 0.71, 0.8, 0.91]
    (sentence,) = ties_in_words("A", one, {"B": other, "C": worse})
    assert "B (+0.003)" in sentence
    assert "C" not in sentence
    assert ties_in_words("A", one, {"C": worse}) == ()
    assert ties_in_words("A", one[:1], {"B": other[:1]}) == ()


def test_a_resumed_tuning_tells_the_share_of_the_candidates_that_are_done(
    study: mr.Study, tmp_path: Path
) -> None:
    path, told = tmp_path / "journal.jsonl", list[Any]()

    def stop(progress: Any) -> None:
        told.append(progress)
        if progress.share > 0.85:
            raise KeyboardInterrupt

    with closing(mr.Journal(path)) as journal, pytest.raises(Interrupted):
        tune(study, threads=1, journal=journal, on_progress=stop)
    before = told[-1].share
    assert before == told[-1].candidates / told[-1].budget < 1.0
    told.clear()
    with closing(mr.Journal(path, resume=True)) as journal:
        tune(study, threads=1, journal=journal, on_progress=told.append)
    shares = [each.share for each in told]
    assert before in shares
    assert shares == sorted(shares)
