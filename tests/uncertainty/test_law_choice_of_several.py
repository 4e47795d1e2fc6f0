"""Choice among the laws of several models: one table, one rule, and no model changes what another one finds."""

from __future__ import annotations

import json
from contextlib import closing
from dataclasses import asdict, replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from command_line import printed
from record_files import write_test
from sentences import Refused
from sinusoidal_tests import MOTIONS, sinusoidal_test

import mrwork as mr
from mrwork.errors import Interrupted
from mrwork.identification import FitSettings
from mrwork.records import DamperTest
from mrwork.search import EfficientGA, StopRules
from mrwork.store.output_folder import Destination
from mrwork.store.run_folder import FIT_RUN
from mrwork.store.unfinished import StepJournals
from mrwork.uncertainty.choice.choose import ChoiceProgress
from mrwork.uncertainty.choice.law_table import TriedLaws
from mrwork.uncertainty.choice.laws import LawChoice

COMMANDS = (0.0, 1.0)
# Contains dahl as its limit of no stiffness `k_x`; bingham has no hysteresis.
MODELS = ("viscous_dahl", "bingham", "dahl")
# No candidate of dahl can be simulated with it, and bingham has no such parameter.
TOO_STIFF = {"rho": (1e7, 1e7)}
SETTINGS = FitSettings(search=EfficientGA(stop=StopRules(max_generations=10)))


def dahl_test(motion: tuple[float, float], command: float, *, cycles: int = 3, rng: int = 0) -> DamperTest:
    """A test of dahl, whose k_w is linear in the command."""
    theta = (200.0 + 400.0 * command, 2000.0, 20.0)
    return sinusoidal_test("dahl", theta, motion, noise=0.02, cycles=cycles, rng=rng, command=command)


@pytest.fixture(scope="module")
def tests() -> tuple[DamperTest, ...]:
    cases = product(MOTIONS[:3], COMMANDS)
    return tuple(dahl_test(motion, command, rng=seed) for seed, (motion, command) in enumerate(cases))


@pytest.fixture(scope="module")
def choice(tests: tuple[DamperTest, ...]) -> LawChoice:
    return mr.choose_laws(MODELS, tests, settings=SETTINGS, threads=1)


def of_model(choice: LawChoice, model: str) -> list[TriedLaws]:
    """The rows of a model, without what depends on the others."""
    rows = [each for each in choice.table.tried if each.model == model]
    return [replace(each, verdict="behind", behind=None, behind_error=None) for each in rows]


def test_of_models_as_good_as_the_best_the_one_with_fewest_parameters_is_chosen(choice: LawChoice) -> None:
    table = choice.table
    assert (table.model, table.chosen_laws.model, choice.fit.model) == ("dahl", "dahl", "dahl")
    assert table.chosen_laws.laws == {"k_w": "linear"}
    good = [each for each in table.tried if each.verdict != "behind"]
    assert {each.model for each in good} == {"dahl", "viscous_dahl"}
    assert table.chosen_laws.n_params == min(each.n_params for each in good)
    assert table.models == MODELS
    assert "of 3 models, the one of dahl with 4 parameters is chosen (k_w linear)" in table.sentence


def test_all_laws_stand_in_one_table_that_names_their_model(choice: LawChoice) -> None:
    table = choice.table
    assert {each.model for each in table.tried} == set(MODELS)
    percents = [each.left_out_percent for each in table.tried]
    assert percents == sorted(percents, reverse=True)
    assert all(len(each.left_out) == table.n_folds == 3 for each in table.tried)
    assert table.table.columns[0] == "model"
    assert all(
        line.startswith(each.model) for line, each in zip(table.table.lines()[1:], table.tried, strict=True)
    )


def test_other_models_do_not_change_what_a_model_finds(
    tests: tuple[DamperTest, ...], choice: LawChoice
) -> None:
    alone = mr.choose_laws("dahl", tests, settings=SETTINGS, threads=1)
    assert of_model(alone, "dahl") == of_model(choice, "dahl")
    assert alone.fit.theta == choice.fit.theta
    assert alone.table.table.columns[0] == "parameters"
    assert "of dahl" not in alone.table.sentence


def test_a_model_that_cannot_be_fitted_is_named_and_stops_no_other(
    tests: tuple[DamperTest, ...], choice: LawChoice, refused: Refused
) -> None:
    held = replace(SETTINGS, bounds=TOO_STIFF)
    found = mr.choose_laws(["dahl", "bingham"], tests, settings=held, threads=1)
    assert found.fit.model == "bingham"
    assert of_model(found, "bingham") == of_model(choice, "bingham")
    assert list(found.table.failed) == ["dahl"]
    note = found.table.notes[0]
    assert note.startswith("dahl could not be fitted: none of ")
    refused(mr.choose_laws, ["dahl", "viscous_dahl"], tests, settings=held, threads=1)


def test_laws_that_cannot_predict_whole_tests_are_not_chosen(refused: Refused) -> None:
    """The best laws on cycles from the middle are of dahl, which no step resolves at the beginning of the tests."""

    def spiked(motion: tuple[float, float], command: float) -> DamperTest:
        test = dahl_test(motion, command, cycles=10)
        spike = np.where(np.arange(test.n_time) == 60, 1e5, 0.0)
        return replace(test, velocity=test.velocity + spike)

    tests = [spiked(motion, command) for motion, command in product(MOTIONS[:2], COMMANDS)]
    found = mr.choose_laws(["dahl", "bingham"], tests, settings=SETTINGS, threads=1)
    assert found.fit.model == "bingham"
    of_dahl = [each for each in found.table.tried if each.model == "dahl"]
    assert of_dahl
    assert all(each.left_out_percent == pytest.approx(0.0) for each in of_dahl)
    assert all(len(each.not_predicted) == len(tests) for each in of_dahl)
    refused(mr.choose_laws, "dahl", tests, settings=SETTINGS, threads=1)


def test_interrupted_in_the_second_model_and_resumed_is_as_if_nothing_had_happened(
    tests: tuple[DamperTest, ...], choice: LawChoice, tmp_path: Path
) -> None:
    place = Destination(path=tmp_path / "run", kind=FIT_RUN)
    lines = []

    def stop(progress: ChoiceProgress) -> None:
        lines.append(progress.in_words)
        if progress.number == 2 and progress.task != "first laws":
            raise KeyboardInterrupt

    def choose(journals: StepJournals, **options: object) -> LawChoice:
        return mr.choose_laws(MODELS, tests, settings=SETTINGS, threads=1, journal_of=journals, **options)  # type: ignore[arg-type] # settings of several kinds by name

    with pytest.raises(Interrupted) as interrupted, closing(StepJournals(place, resume=False)) as journals:
        choose(journals, on_progress=stop)
    so_far = interrupted.value.result
    assert of_model(so_far, "viscous_dahl") == of_model(choice, "viscous_dahl")
    assert so_far.fit.model == "viscous_dahl"
    assert so_far.fit.status == "interrupted"
    assert "further laws were not tried, nor any of bingham, dahl" in so_far.table.sentence
    assert lines[0].startswith("viscous_dahl, model 1 of 3, first laws, ")
    assert lines[-1].startswith("bingham, model 2 of 3, fitting ")
    done = (journals.path("viscous_dahl/laws"), journals.path("viscous_dahl/first"))
    before = [path.read_bytes() for path in done]
    with closing(StepJournals(place, resume=True)) as journals:
        resumed = choose(journals)
    assert asdict(resumed.table) == asdict(choice.table)
    assert resumed.fit.theta == choice.fit.theta
    assert [path.read_bytes() for path in done] == before


def test_interrupted_before_any_laws_are_fitted_there_is_no_result(tests: tuple[DamperTest, ...]) -> None:
    def stop(progress: ChoiceProgress) -> None:
        raise KeyboardInterrupt

    with pytest.raises(Interrupted) as interrupted:
        mr.choose_laws(MODELS, tests, settings=SETTINGS, threads=1, on_progress=stop)
    assert interrupted.value.result is None


def test_given_laws_and_bounds_are_of_the_models_that_have_such_parameters(
    tests: tuple[DamperTest, ...],
) -> None:
    held = replace(SETTINGS, bounds={"v_s": (1e-3, 1e-1), "rho": (100.0, 1e4)})
    found = mr.choose_laws(["dahl", "bingham"], tests, laws={"k_w": "linear"}, settings=held, threads=1)
    assert found.table.given == {"k_w": "linear"}
    for each in found.table.tried:
        assert each.laws.get("k_w") == ("linear" if each.model == "dahl" else None)
        assert not {"v_s", "rho"} & set(each.laws)


def test_models_that_cannot_be_compared_are_refused_before_any_fit(
    tests: tuple[DamperTest, ...], refused: Refused
) -> None:
    for models, laws, bounds in (
        (["dahl", "bingham"], {"k_x": "linear"}, {}),
        (["dahl", "bingham"], {}, {"k_x": (1.0, 2.0)}),
        (["dahl", "dahl"], {}, {}),
        ([], {}, {}),
        (["dahl", "nowhere"], {}, {}),
        (["bingham", mr.damper("dahl").with_current_laws({"k_w": "linear"})], {}, {}),
    ):

        def no_fit(progress: ChoiceProgress) -> None:
            raise AssertionError(progress)

        refused(
            mr.choose_laws,
            models,
            tests,
            laws=laws,
            settings=replace(SETTINGS, bounds=bounds),
            on_progress=no_fit,
        )


@pytest.mark.parametrize(
    "change",
    [{"model": "bingham"}, {"models": ("dahl", "viscous_dahl")}, {"failed": {"nowhere": "too stiff"}}],
)
def test_a_table_whose_models_contradict_each_other_is_refused(
    choice: LawChoice, change: dict[str, object]
) -> None:
    assert not choice.table.disagreement()
    assert replace(choice.table, **change).disagreement()  # type: ignore[arg-type] # settings of several kinds by name


def test_a_run_of_several_models_shows_the_model_wherever_it_shows_the_laws(
    tests: tuple[DamperTest, ...], tmp_path: Path
) -> None:
    files = [write_test(tmp_path / f"test{number}.csv", test) for number, test in enumerate(tests)]
    out = tmp_path / "run"
    options = (
        "--law",
        "auto",
        "--bound",
        "v_s=1e-3:1e-1",
        "--generations",
        "10",
        "--threads",
        "1",
        "--out",
        out,
    )
    command = ("identify", *files, "--model", "dahl,bingham,bouc_wen", *options)
    text = printed(*command)
    assert "the one of dahl with 4 parameters is chosen (k_w linear)" in " ".join(text.split())
    assert "Note: bouc_wen could not be fitted: bouc_wen with current laws" in " ".join(text.split())
    run = mr.load(out)
    assert run.fit.model == "dahl"
    assert run.laws is not None
    assert run.laws.models == ("dahl", "bingham", "bouc_wen")
    assert {each.model for each in run.laws.tried} == {"dahl", "bingham"}
    page = (out / "report.html").read_text()
    assert "dahl, k_w linear" in page
    assert ">Model<" in page
    assert "bouc_wen could not be fitted" in page
    assert not (tmp_path / "run.part").exists()
    summary = json.loads(printed(*command, "--json"))
    assert summary["model"] == "dahl"
    assert summary["choice_of_laws"] == json.loads((out / "laws.json").read_text())
    assert list(summary["choice_of_laws"]["failed"]) == ["bouc_wen"]
