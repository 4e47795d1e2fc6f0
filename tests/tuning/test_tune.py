"""A tuning: chosen on training motions, judged on test motions, the same bits again after an interruption."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tuning_samples
from refusals import refusal
from tuning_samples import TWO_STOREYS, without_times

import mrwork as mr
from mrwork.closed_loop.evaluation import SCORE, ties_in_words
from mrwork.study.loop_case import training_case
from mrwork.study.results import bands_over
from mrwork.study.running import unrun
from mrwork.tuning.judging import TunedStudy, judge, with_tuned_rows, with_tuning
from mrwork.tuning.law_plan import Bench
from mrwork.tuning.space import LawCandidate
from mrwork.tuning.tuned_laws import settings_in_words
from mrwork.tuning.tuning_folder import chosen_study, tuning_document
from mrwork.tuning.tuning_run import plan_of


@pytest.fixture(scope="module")
def study() -> mr.Study:
    return tuning_samples.small_study()


@pytest.fixture(scope="module")
def results(study: mr.Study) -> mr.TuningResults:
    return mr.tune(study, threads=1)


@pytest.fixture(scope="module")
def judged(study: mr.Study, results: mr.TuningResults) -> TunedStudy:
    return judge(study, results, threads=1)


def test_a_largest_command_that_is_the_best_constant_one_is_told_once(
    results: mr.TuningResults, judged: TunedStudy
) -> None:
    largest = next(each for each in results.references if each.kind == "passive")
    best = (
        replace(each, settings=largest.settings) if each.kind == "best_passive" else each
        for each in results.references
    )
    small = replace(results, references=tuple(best))
    for found in (small.remarks, replace(judged, tuned=small).remarks):
        assert [each.code for each in found].count("largest_command_best") == 1


def test_tuned_settings_are_no_worse_than_equal_weights_on_the_training_motions(
    results: mr.TuningResults,
) -> None:
    law = results.laws[0]
    equal = next(each for each in results.references if each.label.startswith("Equal drift weights"))
    assert law.least <= equal.least
    assert law.trace[-1].least == pytest.approx(law.least)


def test_the_study_finds_the_objective_again_and_judges_on_motions_that_the_tuning_has_not_seen(
    study: mr.Study, results: mr.TuningResults, judged: TunedStudy
) -> None:
    assert results.training == ("A",)
    assert [judged.motions[each].name for each in judged.judged_motions] == ["B", "C"]
    assert judged.held_out
    assert "motions_not_held_out" not in [each.code for each in judged.remarks]
    wider = with_tuned_rows(study, results)
    assert with_tuned_rows(wider, results).arrangements == wider.arrangements
    for law in (*results.laws, *results.references):
        train, test = judged.judgement(law, "training"), judged.judgement(law, "test")
        assert train is not None
        assert test is not None
        assert train.score.mean == train.objective == pytest.approx(law.least, rel=1e-12)
        assert test.score == judged.score(judged.row_of_law(law))  # type: ignore[arg-type] # it has a row
        assert test.score.motions == 2


def test_the_references_begin_with_the_dampers_at_zero_command(results: mr.TuningResults) -> None:
    off, best, largest = results.references[:3]
    assert off.least == 1.0
    assert best.least <= min(off.least, largest.least)
    assert largest.settings["command"] == 1.88


def test_the_best_constant_command_is_that_of_the_study(results: mr.TuningResults) -> None:
    """Whether the study adds the row by itself or has none."""
    best = results.references[1]
    alone = replace(tuning_samples.small_study(), arrangements=tuning_samples.small_study().arrangements[:2])
    for study in (tuning_samples.small_study(), alone):
        found = judge(study, results, threads=1)
        row = found.row_of("best_passive")
        assert row is not None
        assert found.score(row, found.motions_of("training")).mean == pytest.approx(best.least, rel=1e-12)


def test_threads_change_no_bit(study: mr.Study, results: mr.TuningResults) -> None:
    assert without_times(mr.tune(study, threads=2)) == without_times(results)


def test_the_chosen_study_has_the_scores_of_the_tuning(results: mr.TuningResults, tmp_path: Path) -> None:
    tuning_samples.assert_its_score(results, tuning_samples.small_study(), tmp_path)


def test_designed_weights_and_numbers_with_units_are_held(tmp_path: Path) -> None:
    text = (
        tuning_samples.TUNE.replace("clipped", "modified_clipped")
        + 'settings = { full_force = "2 kN", designed = { rms_drift = "2 mm", budget = "0.5 kN" } }\n'
        + "free = { control_weight = [1e-4, 10] }\n"
    )
    found = tuning_samples.tuned(text)
    settings = found.laws[0].settings
    assert settings["full_force"] == 2000.0
    assert settings["designed"] == {"rms_drift": 0.002, "budget": 500.0}
    assert "rms_drift 0.002" in settings_in_words(settings, found.command_unit)
    tuning_samples.assert_its_score(found, tuning_samples.small_study(text), tmp_path)


@pytest.mark.parametrize("settings", ["", "settings = { drifts = 1.0 }\n"])
def test_stated_weights_and_bounds_are_kept_where_other_weights_are_better(settings: str) -> None:
    found = tuning_samples.tuned(
        tuning_samples.TUNE + settings + "free = { control_weight = [1e-4, 1e-3] }\n"
    )
    tuned = found.laws[0].settings
    assert {name: value for name, value in tuned.items() if name.endswith("s")} == {"drifts": 1.0}
    assert 1e-4 <= tuned["control_weight"] <= 1e-3
    assert min(law.least for law in found.references) < found.laws[0].least


def test_a_label_of_the_study_is_not_given_again(tmp_path: Path, results: mr.TuningResults) -> None:
    source = tuning_samples.study_file(tmp_path, building=TWO_STOREYS)
    chosen = tmp_path / "chosen.toml"
    chosen.write_text(chosen_study(results, mr.read_study(source).origin.file), encoding="utf-8")
    refusal(mr.tune, mr.read_study(chosen), threads=1, match="'Clipped-optimal, tuned'")


def test_the_chosen_study_finds_the_files_of_a_study_that_names_a_folder(
    results: mr.TuningResults, tmp_path: Path
) -> None:
    source = tuning_samples.study_file(tmp_path, building=TWO_STOREYS)
    (tmp_path / "data").mkdir()
    time = np.linspace(0.0, 2.0, 201)
    np.savetxt(tmp_path / "data" / "m.csv", np.c_[time, np.sin(9.0 * time)], delimiter=",", header="t,a")
    text = source.read_text(encoding="utf-8").replace("title", 'folder = "data"\ntitle')
    source.write_text(text + '\n[[motion]]\nfile = "m.csv"\nunit = "m/s2"\n', encoding="utf-8")
    (tmp_path / "out").mkdir()
    chosen = tmp_path / "out" / "chosen.toml"
    chosen.write_text(chosen_study(results, mr.read_study(source).origin.file), encoding="utf-8")
    assert len(mr.read_study(chosen).motions) == len(mr.read_study(source).motions)


def test_an_interrupted_tuning_keeps_the_laws_so_far(study: mr.Study) -> None:
    def interrupt(progress: object) -> None:
        calls.append(progress)
        if len(calls) == 3:
            raise KeyboardInterrupt

    calls: list[object] = []
    with pytest.raises(mr.errors.Interrupted) as caught:
        mr.tune(study, threads=1, on_progress=interrupt)
    found: mr.TuningResults = caught.value.result
    assert found.status == "interrupted"
    assert len(found.references) == 7
    assert found.laws[0].least > 0.0
    assert found.laws[0].certificate == ""
    partial = with_tuning(unrun(study), found)
    assert partial.status == tuning_document(partial)["status"] == "interrupted"
    assert partial.tuned is found
    assert partial.judgement(found.laws[0], "test") is None


@pytest.mark.parametrize(
    ("name", "unit", "share"), [("rms_current", "A", 0.5), ("command_travel", "A/s", 0.7)]
)
def test_a_limit_that_holds_is_kept(
    name: str, unit: str, share: float, results: mr.TuningResults, judged: TunedStudy
) -> None:
    def largest(of: TunedStudy) -> float:
        found = of.criteria(len(of.rows) - 1, 0)
        assert found is not None
        return found[name]

    limit = share * largest(judged)
    text = tuning_samples.TUNE.replace("16", "48") + f'constraints = {{ {name} = "{limit:.6g} {unit}" }}\n'
    found = tuning_samples.tuned(text)
    assert found.laws[0].violation == 0.0
    assert largest(judge(tuning_samples.small_study(), found, threads=1)) <= limit * (1.0 + 1e-5)


def test_laws_are_compared_by_the_score_of_a_study_whatever_they_minimise() -> None:
    text = '[[tune]]\nlaws = ["maximum_energy_dissipation"]\ncriteria = { peak_acceleration = 2, peak_drift = 1 }\n'
    found = tuning_samples.judgement(tuning_samples.tuned(text), tuning_samples.small_study())
    ratios = [found.criteria[name].mean for name in SCORE]
    assert found.score.mean == pytest.approx(sum(ratios) / 4)
    weighted = 2.0 * found.criteria["peak_acceleration"].mean + found.criteria["peak_drift"].mean
    assert found.objective == pytest.approx(weighted / 3.0)


def test_a_law_may_be_tuned_to_be_better_than_the_best_constant_command() -> None:
    peaks = ("peak_drift", "peak_acceleration")
    keys = f'criteria = {list(peaks)}\nrelative_to = "best_passive"\ncombine = "largest"\n'
    text = '[[tune]]\nlaws = ["maximum_energy_dissipation"]\n' + keys
    found = tuning_samples.tuned(text)
    judged = judge(tuning_samples.small_study(), found, threads=1)
    row, constant = judged.row_of_law(found.laws[0]), judged.row_of("best_passive")
    assert row is not None
    ratios = [judged.ratios(row, motion, constant) for motion in judged.judged_motions]
    worst = [max(each[name] for name in peaks) for each in ratios]
    law = judged.judgement(found.laws[0], "test")
    assert law is not None
    assert law.objective == pytest.approx(np.mean(worst), rel=1e-12)
    # The objectives of references are others, and stand in no column beside this one.
    assert [law.label for law in (*found.laws, *found.references) if found.is_comparable(law)] == [
        found.laws[0].label
    ]


@pytest.mark.parametrize("law", ["clipped_optimal", "maximum_energy_dissipation"])
def test_candidates_of_several_largest_commands_are_one_batch_with_the_results_of_single_ones(
    study: mr.Study, law: str
) -> None:
    bench = Bench(study=study, case=training_case(study, threads=1))
    settings = {"drifts": 1.0, "control_weight": 1e-13} if law == "clipped_optimal" else {}
    candidates = [LawCandidate({**settings, "largest_command": largest}) for largest in (0.3, 1.0, 1.88)]
    together, alone = bench.run(law, candidates), [bench.run(law, [each]) for each in candidates]
    for name, array in together.numbers.items():
        single = np.concatenate([each.numbers[name] for each in alone])
        # An error of the balance is rounding itself.
        assert name == "energy_error" or array == pytest.approx(single, rel=1e-9, nan_ok=True)
        assert np.array_equal(array[2], single[2], equal_nan=True)


def test_every_first_candidate_has_settings_of_the_law() -> None:
    """Also where the force of a damper costs nothing in convex weights, which a regulator does not take."""
    second = '\n[[damper]]\nstorey = 2\npreset = "kwok2006"\nlag = 190\ndifferential = true\n'
    training = tuning_samples.motion("A", 1, "training") + tuning_samples.motion("B", 5, "training")
    motions = training + tuning_samples.motion("C", 2)
    study = tuning_samples.study_with(building=TWO_STOREYS, more=second, motions=motions, tune="")
    plan = plan_of(study, mr.study.TuneTable(laws=("clipped_optimal",)), 1)
    assert np.isfinite(plan.scores(plan.firsts).objective).any()


@pytest.mark.long
def test_realisations_belong_to_a_robust_objective() -> None:
    more = "[uncertainty]\nrealisations = 3\nstiffness = 0.1\ndelay = '2 ms'\n"
    text = tuning_samples.TUNE + 'robust = true\nrisk = "max"\n'
    motions = tuning_samples.motion("A", 1)
    study = tuning_samples.study_with(tune=text, more=more, motions=motions, building=TWO_STOREYS)
    found = mr.tune(study, threads=1)
    law, judged = found.laws[0], judge(study, found, threads=1)
    row = judged.row_of_law(law)
    assert row is not None
    band = bands_over(judged, row, judged.row_of("passive_off"))["score"]
    assert band is not None
    assert band.lower < band.median < band.upper
    # The largest of three realisations under one motion; the band lies within them.
    assert law.least >= band.upper
    train = judged.judgement(law, "training")
    assert train is not None
    assert train.objective == pytest.approx(law.least, rel=1e-12)
    # Without other motions nothing is judged.
    assert judged.judgement(law, "test") is None
    assert "motions_not_held_out" in [each.code for each in judged.remarks]


@pytest.mark.parametrize(
    ("table", "word"),
    [
        ("", r"nothing to tune; give it a \[\[tune\]\]"),
        ('laws = ["lyapunov"]\nrobust = true', "line 39: robust needs an .uncertainty"),
        ('laws = ["lyapunov"]\n[[tune]]\nlaws = ["lyapunov"]', "'Lyapunov, tuned'"),
        ('laws = ["lyapunov"]\nbudget = 6\npopulation = 8', "one generation takes 8"),
        ('laws = ["clipped_optimal"]\nsettings = { drifts = [1, 2] }', "2 weights, and there are 5 storeys"),
        ('laws = ["lyapunov"]\ncriteria = ["rms_current"]', "rms_current is 0 or missing at i = 0"),
        ('laws = ["lyapunov"]\ncriteria = ["storey_energy"]', "storey_energy is 0 or missing at i = 0"),
        ('laws = ["lyapunov"]\nconstraints = { peak_drift_ratio = "1 %" }', "height or heights"),
    ],
)
def test_what_cannot_be_tuned_is_refused(table: str, word: str) -> None:
    text = table and f"[[tune]]\n{table}"
    refusal(lambda: mr.tune(tuning_samples.study_with(tune=text), threads=1), match=word)


def test_points_of_a_front_are_ratios_whatever_the_limits() -> None:
    pytest.importorskip("pymoo")
    text = '[[tune]]\nlaws = ["clipped_optimal"]\nbudget = 5\npopulation = 5\n'
    text += 'objectives = ["peak_drift", "rms_drift"]\n'
    limit = "constraints = { peak_stroke = 1e-9 }\n"
    found = tuning_samples.tuned(text + limit)
    front = judge(tuning_samples.small_study(), found, threads=1).tuned.fronts[0]
    for point in front.points:
        assert point.test is not None
        assert all(0.0 < ratio < 3.0 for ratio in (*point.train.values(), *point.test.values()))


def test_semi_active_weights_are_scanned_by_their_budget_and_are_a_reference(
    study: mr.Study, results: mr.TuningResults
) -> None:
    """The study with them as rows states the margins of each law, and ground and budget of the designed weights."""
    (found,) = [each for each in results.references if "budget scanned" in each.label]
    assert found.settings["designed"]["semi_active"] == 0.1
    assert found.settings["control_weight"] == 1.0
    assert found.candidates >= 10
    notes = dict(with_tuned_rows(study, results).design_notes)
    assert any("budget_scale" in each for each in notes[f"Weights of {found.label}"])
    assert "Margins of the linear loop" in notes[f"Loop of {results.laws[0].label}"][-1]


def test_laws_that_motions_do_not_tell_apart_are_named() -> None:
    """A difference counts from two standard errors of its mean on; one motion tells nothing."""
    one, other = [0.5, 0.6, 0.7, 0.8], [0.51, 0.59, 0.72, 0.79]
    worse = [0.6, 0.71, 0.8, 0.91]
    (sentence,) = ties_in_words("A", one, {"B": other, "C": worse})
    assert "B (+0.003)" in sentence
    assert "C" not in sentence
    assert ties_in_words("A", one, {"C": worse}) == ()
    assert ties_in_words("A", one[:1], {"B": other[:1]}) == ()
