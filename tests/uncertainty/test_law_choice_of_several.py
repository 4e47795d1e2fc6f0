"""Choice among the laws of several models: one table, one rule, and no model changes what another one finds."""

import json
from dataclasses import asdict, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import printed
from record_files import write_test
from refusals import refusal
from resumed_steps import stopped_and_resumed
from sinusoidal_tests import MOTIONS, sinusoidal_test

import mrwork as mr
from mrwork.identification import FitSettings
from mrwork.records import DamperTest
from mrwork.search import EfficientGA, StopRules
from mrwork.uncertainty import Choice
from mrwork.uncertainty.choice.ranking import Standing

COMMANDS = (0.0, 1.0)
# Contains dahl as its limit of no stiffness `k_x`; bingham has no hysteresis.
MODELS = ("viscous_dahl", "bingham", "dahl")
# Parameters with bounds remain constant: fewer laws are tried.
HELD = {"f0": (0.0, 100.0), "rho": (100.0, 1e4)}
# No candidate of dahl can be simulated with this rho, and bingham has no such parameter.
TOO_STIFF = HELD | {"rho": (1e7, 1e7)}
SETTINGS = FitSettings(search=EfficientGA(stop=StopRules(max_generations=10)), bounds=HELD)


def dahl_test(motion: tuple[float, float], command: float, *, cycles: int = 3, rng: int = 0) -> DamperTest:
    """A test of dahl, whose k_w is linear in the command."""
    theta = (200.0 + 400.0 * command, 2000.0, 20.0)
    return sinusoidal_test("dahl", theta, motion, noise=0.02, cycles=cycles, rng=rng, command=command)


@pytest.fixture(scope="module")
def tests() -> tuple[DamperTest, ...]:
    cases = product(MOTIONS[:3], COMMANDS)
    return tuple(dahl_test(motion, command, rng=seed) for seed, (motion, command) in enumerate(cases))


@pytest.fixture(scope="module")
def choice(tests: tuple[DamperTest, ...]) -> Choice:
    return mr.choose_laws(MODELS, tests, settings=SETTINGS, threads=1)


def of_model(choice: Choice, model: str) -> list[Standing]:
    """The rows of a model, without what depends on the others."""
    rows = [each for each in choice.ranking.standings if each.model == model]
    return [
        replace(each, verdict="behind", left_out_behind=None, left_out_behind_error=None) for each in rows
    ]


@pytest.mark.long
def test_of_models_as_good_as_the_best_the_one_with_fewest_parameters_is_chosen(choice: Choice) -> None:
    ranking = choice.ranking
    chosen = ranking.chosen_standing
    assert (ranking.chosen, chosen.model, choice.best.model) == ("dahl", "dahl", "dahl")
    assert chosen.laws == {"k_w": "linear"}
    good = [each for each in ranking.standings if each.verdict in ("chosen", "as good")]
    assert {each.model for each in good} == {"dahl", "viscous_dahl"}
    assert chosen.n_params == min(each.n_params for each in good)
    assert ranking.n_models == len(MODELS)
    assert "of 3 models, Dahl with 4 parameters (k_w linear) is chosen" in ranking.sentence


def test_other_models_do_not_change_what_a_model_finds(tests: tuple[DamperTest, ...], choice: Choice) -> None:
    alone = mr.choose_laws("dahl", tests, settings=SETTINGS, threads=1)
    assert of_model(alone, "dahl") == of_model(choice, "dahl")
    assert alone.best.theta == choice.best.theta
    assert alone.ranking.table.columns[0] == "parameters"


def test_a_model_that_cannot_be_fitted_is_named_and_stops_no_other(
    tests: tuple[DamperTest, ...], choice: Choice
) -> None:
    held = replace(SETTINGS, bounds=TOO_STIFF)
    found = mr.choose_laws(["dahl", "bingham"], tests, settings=held, threads=1)
    assert found.best.model == "bingham"
    assert of_model(found, "bingham") == of_model(choice, "bingham")
    failed = found.ranking.standings[-1]
    assert (failed.model, failed.verdict) == ("dahl", "failed")
    assert failed.reason.startswith("none of ")
    refusal(
        mr.choose_laws, ["dahl", "viscous_dahl"], tests, settings=held, threads=1, match="no model predicts"
    )


def test_laws_that_cannot_predict_whole_tests_are_not_chosen() -> None:
    """The best laws on cycles from the middle are of dahl, which no step resolves at the beginning of the tests."""

    def spiked(motion: tuple[float, float], command: float) -> DamperTest:
        test = dahl_test(motion, command, cycles=10)
        spike = np.where(np.arange(test.n_time) == 60, 1e5, 0.0)
        return replace(test, velocity=test.velocity + spike)

    tests = [spiked(motion, command) for motion, command in product(MOTIONS[:2], COMMANDS)]
    found = mr.choose_laws(["dahl", "bingham"], tests, settings=SETTINGS, threads=1)
    assert found.best.model == "bingham"
    of_dahl = [each for each in found.ranking.standings if each.model == "dahl"]
    assert of_dahl
    assert all(each.left_out_percent == pytest.approx(0.0) for each in of_dahl)
    assert all(len(each.not_predicted) == len(tests) for each in of_dahl)
    refusal(mr.choose_laws, "dahl", tests, settings=SETTINGS, threads=1, match="no model predicts")


@pytest.mark.long
def test_interrupted_in_the_second_model_and_resumed_is_as_if_nothing_had_happened(
    tests: tuple[DamperTest, ...], choice: Choice, tmp_path: Path
) -> None:
    so_far, resumed = stopped_and_resumed(
        tmp_path,
        partial(mr.choose_laws, MODELS, tests, settings=SETTINGS, threads=1),
        lambda progress: "model 2 of" in progress.said[0] and progress.said[1] != "first laws",
    )
    assert of_model(so_far, "viscous_dahl") == of_model(choice, "viscous_dahl")
    assert (so_far.best.model, so_far.best.status) == ("viscous_dahl", "interrupted")
    assert "interrupted and lacks bingham, dahl" in so_far.ranking.sentence
    assert asdict(resumed.ranking) == asdict(choice.ranking)
    assert resumed.best.theta == choice.best.theta


def test_given_laws_and_bounds_are_of_the_models_that_have_such_parameters(
    tests: tuple[DamperTest, ...],
) -> None:
    held = replace(SETTINGS, bounds={"v_s": (1e-3, 1e-1), "rho": (100.0, 1e4)})
    found = mr.choose_laws(["dahl", "bingham"], tests, laws={"k_w": "linear"}, settings=held, threads=1)
    assert found.ranking.given == {"k_w": "linear"}
    for each in found.ranking.standings:
        assert each.laws.get("k_w") == ("linear" if each.model == "dahl" else None)
        assert not {"v_s", "rho"} & set(each.laws)


@pytest.mark.parametrize(
    ("models", "laws", "bounds", "word"),
    [
        (["dahl", "bingham"], {"k_x": "linear"}, {}, "law was given for 'k_x'"),
        (["dahl", "bingham"], {}, {"k_x": (1.0, 2.0)}, "bound was given for 'k_x'"),
        (["dahl", "dahl"], {}, {}, "dahl, dahl"),
        (["bingham", mr.damper("dahl").with_current_laws({"k_w": "linear"})], {}, {}, "has current laws"),
    ],
)
def test_models_that_cannot_be_compared_are_refused_before_any_fit(
    tests: tuple[DamperTest, ...], models: list[Any], laws: Any, bounds: Any, word: str
) -> None:
    settings = {
        "settings": replace(SETTINGS, bounds=bounds),
        "on_progress": lambda progress: pytest.fail("fitted"),
    }
    refusal(mr.choose_laws, models, tests, laws=laws, **settings, match=word)


@pytest.mark.long
def test_a_run_of_several_models_names_the_model_of_the_laws(
    tests: tuple[DamperTest, ...], tmp_path: Path
) -> None:
    files = [write_test(tmp_path / f"test{number}.csv", test) for number, test in enumerate(tests)]
    out = tmp_path / "run"
    options = ("--law", "auto", "--bound", "v_s=1e-3:1e-1", "--generations", "10", "--threads", "1")
    command = ("identify", *files, "--model", "dahl,bingham,bouc_wen", *options, "--out", out)
    summary = json.loads(printed(*command, "--json"))
    assert summary["model"] == "dahl"
    shown, written = summary["choice_of_laws"], json.loads((out / "ranking.json").read_text())
    assert shown == written
    assert [each["model"] for each in shown["standings"] if each["verdict"] == "failed"] == ["bouc_wen"]
    run = mr.load(out)
    assert run.fit.model == "dahl"
    assert run.ranking is not None
    assert {each.model for each in run.ranking.standings} == {"dahl", "bingham", "bouc_wen"}
