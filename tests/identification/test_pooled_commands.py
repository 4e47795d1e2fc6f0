"""Tests at different commands with constant parameters: said before the search and with the result, by name."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from pathlib import Path

import pytest
from command_line import mrwork
from sinusoidal_tests import MOTIONS, sinusoidal_test

import mrwork as mr
from mrwork.errors import MrworkWarning
from mrwork.identification import Multistart
from mrwork.identification.fit_file import fit_from_json, read_fit
from mrwork.identification.problem import command_warning
from mrwork.records import DamperTest
from mrwork.store.record import json_document

FEW = Multistart(samples=6, starts=3, least_rounds=1, most_rounds=1, found=2)
BINGHAM = (400.0, 0.01, 900.0, 0.0)


def at(*currents: float | None) -> tuple[DamperTest, ...]:
    return tuple(
        replace(sinusoidal_test("bingham", BINGHAM, motion, noise=0.02), current=current)
        for motion, current in zip(MOTIONS, currents, strict=False)
    )


def test_a_pooled_fit_warns_before_the_search_and_carries_the_warning() -> None:
    with pytest.warns(MrworkWarning, match=r"3 commands \(0, 0.5, 1 A\).*bingham.*--law") as caught:
        fit = mr.identify("bingham", at(1.0, 0.0, 0.5), search=FEW)
    assert Path(caught[0].filename) == Path(__file__)
    assert fit.warnings == (str(caught[0].message),)
    assert "warning: the tests are at 3 commands" in repr(fit)
    # However long it is, it can be read to its end.
    assert "tests at one command" in " ".join(repr(fit).split())
    assert fit_from_json(json_document(fit.as_dict()), origin="fit.json").warnings == fit.warnings


@pytest.mark.parametrize("currents", [(0.5, 0.5), (0.499, 0.501), (None, None), (None, 0.5)])
def test_one_command_with_its_noise_and_unknown_ones_give_no_warning(
    currents: tuple[float | None, ...],
) -> None:
    assert command_warning(at(*currents), [mr.damper("bingham")]) == ()


def test_only_models_without_laws_are_named() -> None:
    lawful = mr.damper("dahl").with_current_laws({"k_w": "linear"}, unit="A")
    assert command_warning(at(0.0, 1.0), [lawful]) == ()
    (sentence,) = command_warning(at(0.0, 1.0), [lawful, mr.damper("bingham")])
    assert "dahl" not in sentence
    assert "bingham" in sentence


def test_volts_and_amperes_are_both_listed() -> None:
    in_volts = replace(at(None)[0], voltage=2.0)
    (sentence,) = command_warning((*at(0.5, 1.0), in_volts), [mr.damper("bingham")])
    assert "3 commands (0.5, 1 A, 2 V)" in sentence


def test_a_fit_of_an_earlier_version_has_no_warnings() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MrworkWarning)
        fit = mr.identify("bingham", at(0.0, 1.0), search=FEW)
    document = fit.as_dict()
    del document["warnings"]
    assert fit_from_json(json_document(document), origin="fit.json").warnings == ()


@pytest.mark.parametrize("model", ["bingham", "bingham,dahl"])
def test_the_command_line_says_it_on_stderr_on_stdout_in_the_json_and_on_the_page(
    tmp_path: Path, model: str
) -> None:
    files = []
    for test in at(0.0, 1.0):
        path = tmp_path / f"10mm1Hz{test.current:g}A.csv"
        rows = zip(test.time, test.displacement, test.velocity, test.force, strict=True)
        path.write_text(
            "t_s,displacement_m,velocity_mps,force_n\n"
            + "\n".join(",".join(repr(float(cell)) for cell in row) for row in rows)
        )
        files.append(path)
    place = tmp_path / "run"
    printed = mrwork("identify", *files, "--model", model, "--out", place, "--quiet")
    assert printed.returncode == 0
    assert printed.stderr.count("mrwork: warning: the tests are at 2 commands (0, 1 A)") == 1
    assert "--law" in printed.stdout
    assert "warning: the tests are at 2 commands (0, 1 A)" in printed.stdout
    assert "<li>the tests are at 2 commands (0, 1 A)" in (place / "report.html").read_text()
    (kept,) = read_fit(place).warnings
    assert "2 commands" in kept
    document = json.loads(mrwork("identify", *files, "--model", model, "--out", place, "--json").stdout)
    key = "warnings" if model == "bingham" else "remarks"
    assert any("2 commands (0, 1 A)" in sentence for sentence in document[key])
