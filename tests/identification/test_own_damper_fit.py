"""Dampers of users in fits, run folders, choices and other processes."""

import json
import re
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import own_dampers
import pytest
from command_line import printed
from refusals import command_refusal

import mrwork as mr
from mrwork.errors import JournalError
from mrwork.records import cut
from mrwork.store.codec import built, json_document
from test_imports import in_fresh_process

FILE = Path(own_dampers.__file__)
TEST = mr.synthetic_test("spencer1997")


@pytest.mark.long
def test_estimates_are_those_of_the_model() -> None:
    own, model = own_dampers.bounded_loop, own_dampers.LOOP
    ours, theirs = (mr.identify(spec, TEST, rng=1) for spec in (own, model))
    errors = np.array([each.standard_error for each in theirs.estimates], dtype=float)
    assert (np.abs(np.array(ours.theta) - np.array(theirs.theta)) <= 1e-4 * errors).all()
    assert ours.half_step_percent is None or ours.half_step_percent < 0.01
    again = built(mr.Fit, json.loads(json_document(ours.as_dict())))
    assert again.spec == own
    assert again.fingerprint == ours.fingerprint != replace(ours, own=None, model=model.name).fingerprint


@pytest.mark.long
def test_a_joint_fit_of_laws_and_a_choice_beside_models_of_the_package(tmp_path: Path) -> None:
    printed("init", "rig", tmp_path / "rig")
    tests = [cut(each, every=4) for each in mr.read_damper_tests([tmp_path / "rig"])[:2]]
    laws = {"A1": "linear"}
    ours, theirs = (
        mr.identify(spec.with_current_laws(laws), tests) for spec in (own_dampers.guo, own_dampers.GUO)
    )
    np.testing.assert_allclose(ours.theta, theirs.theta, rtol=1e-6)
    choices = [own_dampers.guo, "bingham"]
    test = cut(TEST, every=4)
    here = mr.choose_model(test, choices)
    assert here.ranking.chosen == "my_guo"
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        there = mr.choose_model(test, choices, executor=pool)
    np.testing.assert_allclose(there.fits[0].theta, here.fits[0].theta, rtol=1e-12)


@pytest.mark.long
@pytest.mark.usefixtures("pages")
def test_a_run_folder_runs_without_the_file_of_its_author_and_without_jax(tmp_path: Path) -> None:
    run, file = tmp_path / "run", tmp_path / "mine.py"
    file.write_text(FILE.read_text())
    printed("identify", "synthetic:spencer1997", "--model", f"{file}:guo", "--out", run, "--quiet")
    file.unlink()
    assert "def slide(p, velocity, displacement)" in re.sub(r": Any", "", (run / "report.html").read_text())
    assert mr.load(run, mr.StoredRun).fit.spec == own_dampers.guo
    code = (
        "import sys; sys.modules['jax'] = None\n"
        "from mrwork.cli import main\n"
        "main(['predict', sys.argv[1], 'synthetic:spencer1997'])"
    )
    assert "97." in in_fresh_process(code, run)


@pytest.mark.long
def test_equations_as_python_alone_say_what_to_do(tmp_path: Path) -> None:
    """As versions before tapes have written them."""
    run = tmp_path / "run"
    printed("identify", "synthetic:spencer1997", "--model", f"{FILE}:guo", "--out", run, "--quiet")
    fit = json.loads((run / "fit.json").read_text())
    fit["own"]["own"] = {"source": "", "force": "guo_force", "rate": None, "relaxation": None}
    (run / "fit.json").write_text(json.dumps(fit))
    command_refusal(
        "predict", run, "synthetic:spencer1997", "--changed", match="as Python alone.* again with --model"
    )


def twice(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    shifted = velocity + p.omega * displacement
    return p.A1 * np.tanh(p.A3 * shifted) + p.A2 * shifted + 2.0 * p.f0


def test_a_changed_file_does_not_resume(tmp_path: Path) -> None:
    journal = tmp_path / "journal.jsonl"
    kept = mr.Journal(journal)
    mr.identify(own_dampers.guo, TEST, journal=kept)
    kept.close()
    other = mr.own_damper(
        "my_guo", parameters={each.name: each for each in own_dampers.GUO.parameters}, force=twice
    )
    with pytest.raises(JournalError, match="equations"):
        mr.identify(other, TEST, journal=mr.Journal(journal, resume=True))


def test_a_file_that_fails_says_where(tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.py"
    wrong.write_text("import os\nos.chdir('/')\nraise ValueError('no rig')\n")
    command_refusal(
        *("identify", "synthetic:spencer1997", "--model", f"{wrong}:mine"),
        match=r"wrong.py, line 3 .* ValueError: no rig",
    )
