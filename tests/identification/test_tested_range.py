"""A fit carries the ranges and commands of its tests, and says what of a prediction lies outside of them."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import mrwork, printed
from record_files import write_test
from sinusoidal_tests import MOTIONS, sinusoidal_test

import mrwork as mr
from mrwork.base.remark import warnings_of
from mrwork.identification.fit_file import read_fit
from mrwork.identification.problem import pooled_commands
from mrwork.identification.result import explain_failures
from mrwork.store.codec import built, json_document

LAWFUL = mr.damper("bingham").with_current_laws({"f_c": "linear"}, unit="A")
SEARCH = mr.search.EfficientGA(stop=mr.search.StopRules(max_generations=10))
# The friction turns negative below 0.125 A.
THETA = [-100.0, 800.0, 0.02, 900.0, 0.0]


def a_test(current: float, amplitude: float = 0.01, frequency: float = 1.0) -> mr.DamperTest:
    return sinusoidal_test(LAWFUL, THETA, (amplitude, frequency), noise=0.01, rng=1, command=current)


@pytest.fixture(scope="module")
def fit() -> mr.Fit:
    return mr.identify(LAWFUL, [a_test(current) for current in (0.25, 0.5, 1.0)], search=SEARCH)


def test_a_fit_carries_the_ranges_of_its_tests_into_its_file(fit: mr.Fit) -> None:
    assert fit.tested is not None
    assert fit.tested.stroke == pytest.approx(0.01)
    assert fit.tested.velocity == pytest.approx(0.02 * np.pi, rel=1e-3)
    assert (fit.tested.command, fit.tested.command_unit) == ((0.25, 1.0), "A")
    assert "command 0.25 to 1 A" in repr(fit)
    assert built(mr.Fit, json.loads(json_document(fit.as_dict()))).tested == fit.tested


def test_a_law_that_turns_negative_near_the_tested_commands_is_a_warning_of_the_fit(fit: mr.Fit) -> None:
    (remark,) = fit.remarks
    assert (remark.code, remark.words) == ("law_leaves_range_beyond", ("f_c",))
    assert remark.measured is not None
    assert remark.measured.value < 0.0
    assert "at 0 A" in remark.message


def test_a_prediction_within_the_tested_ranges_says_nothing(fit: mr.Fit) -> None:
    found = mr.predict(fit, a_test(0.7, 0.0101, 0.99))
    assert found.outside.remarks == ()
    assert "warning" not in repr(found)


@pytest.mark.parametrize(
    ("test", "names"),
    [
        (lambda: a_test(0.0), ("command",)),
        (lambda: a_test(0.5, 0.02, 0.5), ("stroke", "frequency")),
        (lambda: a_test(0.5, 0.002, 4.99), ("frequency", "stroke")),
        (lambda: a_test(1.0, 0.01, 3.0), ("velocity", "frequency", "force", "power")),
    ],
)
def test_a_prediction_outside_the_tested_ranges_names_each_quantity(
    fit: mr.Fit, test: Callable[[], mr.DamperTest], names: tuple[str, ...]
) -> None:
    assert mr.predict(fit, test()).outside.names == names


def test_at_a_command_that_was_left_out_the_law_is_named(fit: mr.Fit) -> None:
    said = " ".join(repr(mr.predict(fit, a_test(0.0))).split())
    assert "the law of f_c is extrapolated" in said
    assert "the law of f_c turns negative" in said


def test_a_simulation_that_fails_outside_the_tested_range_says_so(fit: mr.Fit) -> None:
    for current, said in ((0.0, r"diverged; outside the tested range: command 0 A"), (0.5, r"diverged$")):
        with pytest.raises(mr.errors.SimulationError, match=said), explain_failures(fit, a_test(current)):
            raise mr.errors.SimulationError("diverged")


def test_both_verbs_say_what_the_fit_says(tmp_path: Path) -> None:
    tests = [a_test(current) for current in (0.25, 0.5, 1.0, 0.0)]
    *fitted, left_out = (write_test(tmp_path / f"{each.current:g}.csv", each) for each in tests)
    out = tmp_path / "run"
    laws = ("--model", "bingham", "--law", "f_c=linear:0.25,1", "--generations", "5", "--population", "20")
    text = printed("identify", *fitted, *laws, "--out", out, "--quiet")
    text = " ".join(text.split())
    assert "tested stroke to 10 mm" in text
    assert "warning: the law of f_c turns negative" in text
    assert len(read_fit(out).motions) == len(fitted)
    outside, inside = json.loads(printed("predict", out, left_out, fitted[0], "--json"))["files"]
    assert outside["outside_tested_range"] == ["command"]
    assert {"outside_tested_range", "law_leaves_range_beyond"} == {
        each["code"] for each in outside["remarks"]
    }
    assert (inside["outside_tested_range"], inside["remarks"]) == ([], [])


FEW = mr.identification.Race(samples=6, starts=4, population=8, generations=4, most_rounds=1)
BINGHAM = (400.0, 0.01, 900.0, 0.0)


def at(*currents: float | None) -> tuple[mr.DamperTest, ...]:
    return tuple(
        replace(sinusoidal_test("bingham", BINGHAM, motion, noise=0.02), current=current)
        for motion, current in zip(MOTIONS, currents, strict=False)
    )


def test_a_pooled_fit_warns_before_the_search_and_carries_the_warning() -> None:
    with pytest.warns(mr.errors.MrworkWarning, match=r"3 commands \(0, 0.5, 1 A\).*bingham.*--law") as caught:
        fit = mr.identify("bingham", at(1.0, 0.0, 0.5), search=FEW)
    assert Path(caught[0].filename) == Path(__file__)
    assert warnings_of(fit.remarks) == (str(caught[0].message),)
    # However long it is, it can be read to its end.
    assert "tests at one command" in " ".join(repr(fit).split())
    assert built(mr.Fit, json.loads(json_document(fit.as_dict()))).remarks == fit.remarks


@pytest.mark.parametrize("currents", [(0.5, 0.5), (0.499, 0.501), (None, None), (None, 0.5)])
def test_one_command_with_its_noise_and_unknown_ones_give_no_warning(
    currents: tuple[float | None, ...],
) -> None:
    assert not [*pooled_commands(at(*currents), [mr.damper("bingham")])]


def test_only_models_without_laws_are_named() -> None:
    lawful = mr.damper("dahl").with_current_laws({"k_w": "linear"}, unit="A")
    assert not [*pooled_commands(at(0.0, 1.0), [lawful])]
    (remark,) = pooled_commands(at(0.0, 1.0), [lawful, mr.damper("bingham")])
    assert remark.words == ("bingham",)


def test_the_command_line_says_it_once_on_stderr_and_in_the_json(tmp_path: Path) -> None:
    files = [write_test(tmp_path / f"10mm1Hz{each.current:g}A.csv", each) for each in at(0.0, 1.0)]
    ended = mrwork("identify", *files, "--model", "bingham", "--out", tmp_path / "run", "--quiet", "--json")
    assert ended.returncode == 0
    assert ended.stderr.count("the tests are at 2 commands (0, 1 A)") == 1
    assert "commands_pooled" in {each["code"] for each in json.loads(ended.stdout)["remarks"]}
    assert "2 commands (0, 1 A)" in read_fit(tmp_path / "run").remarks[0].message
