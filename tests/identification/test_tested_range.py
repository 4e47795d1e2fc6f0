"""A fit carries the ranges of its tests, and says what of a prediction lies outside of them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import printed
from sentences import Refused

import mrwork as mr
from mrwork.errors import SimulationError
from mrwork.identification.fit_file import fit_from_json, read_fit
from mrwork.identification.result import explain_failures
from mrwork.records import DamperTest, build_damper_test
from mrwork.search import EfficientGA, StopRules
from mrwork.store.codec import json_document

LAWFUL = mr.damper("bingham").with_current_laws({"f_c": "linear"}, unit="A")
SEARCH = EfficientGA(stop=StopRules(max_generations=10))
# The friction turns negative below 0.125 A.
THETA = [-100.0, 800.0, 0.02, 900.0, 0.0]
PER_CYCLE = 60


def a_test(current: float, amplitude: float = 0.01, frequency: float = 1.0) -> DamperTest:
    dt = 1.0 / (PER_CYCLE * frequency)
    angle = 2.0 * np.pi * np.arange(3 * PER_CYCLE + 1) / PER_CYCLE
    displacement = amplitude * np.sin(angle)
    velocity = 2.0 * np.pi * frequency * amplitude * np.cos(angle)
    loading = mr.Loading(
        dt=dt, displacement=displacement, velocity=velocity, command=current, command_unit="A"
    )
    force = mr.simulate_force(LAWFUL, THETA, loading)
    noise = np.random.default_rng(1).standard_normal(angle.size)
    made = build_damper_test(
        name=f"{1e3 * amplitude:g} mm {frequency:g} Hz {current:g} A",
        time=dt * np.arange(angle.size),
        displacement=displacement,
        velocity=velocity,
        force=force + 0.01 * np.std(force) * noise,
        synthetic=True,
    )
    return replace(made, current=current)


@pytest.fixture(scope="module")
def fit() -> mr.Fit:
    return mr.identify(LAWFUL, [a_test(current) for current in (0.25, 0.5, 1.0)], search=SEARCH)


def test_a_fit_carries_the_ranges_of_its_tests_into_its_file(fit: mr.Fit) -> None:
    assert fit.tested is not None
    assert fit.tested.stroke == pytest.approx(0.01)
    assert fit.tested.velocity == pytest.approx(0.02 * np.pi, rel=1e-3)
    assert (fit.tested.command, fit.tested.command_unit) == ((0.25, 1.0), "A")
    assert "command 0.25 to 1 A" in repr(fit)
    assert fit_from_json(json_document(fit.as_dict()), origin="fit.json").tested == fit.tested


def test_a_law_that_turns_negative_near_the_tested_commands_is_a_warning_of_the_fit(fit: mr.Fit) -> None:
    (sentence,) = fit.warnings
    assert sentence.startswith("the law of f_c turns negative: -")
    assert "at 0 A" in sentence
    assert "the tests are at 0.25 to 1 A: do not use the fit there" in sentence


def test_a_prediction_within_the_tested_ranges_says_nothing(fit: mr.Fit) -> None:
    found = mr.predict(fit, a_test(0.7, 0.0101, 0.99))
    assert found.outside.sentences == ()
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
    fit: mr.Fit, test: Callable[[], DamperTest], names: tuple[str, ...]
) -> None:
    assert mr.predict(fit, test()).outside.names == names


def test_at_a_command_that_was_left_out_the_law_is_named(fit: mr.Fit) -> None:
    said = " ".join(repr(mr.predict(fit, a_test(0.0))).split())
    assert "warning: command 0 A, tested from 0.25 to 1 A; the law of f_c is extrapolated" in said
    assert "warning: the law of f_c turns negative" in said


def test_a_simulation_that_fails_outside_the_tested_range_says_so(fit: mr.Fit) -> None:
    for current, said in ((0.0, r"diverged; outside the tested range: command 0 A"), (0.5, r"diverged$")):
        with pytest.raises(SimulationError, match=said), explain_failures(fit, a_test(current)):
            raise SimulationError("diverged")


def test_both_verbs_say_what_the_fit_says(tmp_path: Path, refused: Refused) -> None:
    names = []
    for current in (0.25, 0.5, 1.0, 0.0):
        test = a_test(current)
        names.append(tmp_path / f"{current:g}.csv")
        np.savetxt(
            names[-1],
            np.column_stack(
                [test.time, test.displacement, test.velocity, test.force, np.full(test.n_time, current)]
            ),
            delimiter=",",
            header="time_s,displacement_m,velocity_mps,force_N,current_A",
            comments="",
        )
    *fitted, left_out = names
    out = tmp_path / "run"
    laws = ("--model", "bingham", "--law", "f_c=linear:0.25,1", "--generations", "5", "--population", "20")
    text = printed("identify", *fitted, *laws, "--out", out, "--quiet")
    assert "tested: stroke to 10 mm" in text
    assert "warning: the law of f_c turns negative" in text
    loaded = " ".join(repr(mr.load(out)).split())
    assert "tested: stroke to 10 mm" in loaded
    assert "warning: the law of f_c turns negative" in loaded
    page = (out / "report.html").read_text()
    assert "Not beyond the tested ranges: stroke to 10 mm" in page.replace("\N{NO-BREAK SPACE}", " ")
    assert "the law of f_c turns negative" in page
    text = printed("predict", out, left_out, fitted[0])
    assert "warning: command 0 A, tested from 0.25 to 1 A; the law of f_c is extrapolated" in text
    assert "outside on 1 of 2 files" in text
    document = json.loads(printed("predict", out, left_out, fitted[0], "--json"))
    assert document["files"][0]["outside_tested_range"] == ["command"]
    assert any("turns negative" in each for each in document["files"][0]["warnings"])
    assert (document["files"][1]["outside_tested_range"], document["files"][1]["warnings"]) == ([], [])
    stored = json.loads((out / "fit.json").read_text())
    assert len(read_fit(out).motions) == len(fitted)
    for name in ("tested", "motions"):
        (out / "fit.json").write_text(json.dumps({key: stored[key] for key in stored if key != name}))
        refused(read_fit, out)
