"""Dampers of users in fits, run folders, choices and other processes."""

import json
import re
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import own_dampers
import pytest
from command_line import printed
from refusals import command_refusal

import mrwork as mr
from mrwork.cli import own_models
from mrwork.dampers import own_equations
from mrwork.errors import JournalError
from mrwork.records import cut
from mrwork.store.codec import built, json_document
from mrwork.twins import models

FILE = Path(own_dampers.__file__)
TEST = mr.synthetic_test("spencer1997")


def forget() -> None:
    """As in a process that has not seen any equations."""
    own_equations._TRUSTED.clear()
    own_equations._announce = None
    models.twin_of.cache_clear()
    own_models.own_model.cache_clear()


@pytest.fixture
def strange() -> object:
    """A process that trusts no equations; those of the samples are trusted again afterwards."""
    known = dict(own_equations._TRUSTED)
    forget()
    yield None
    forget()
    own_equations._TRUSTED.update(known)


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
def test_a_run_folder_carries_it_and_runs_it_where_it_is_trusted(tmp_path: Path, strange: None) -> None:
    run = tmp_path / "run"
    printed("identify", "synthetic:spencer1997", "--model", f"{FILE}:guo", "--out", run, "--quiet")
    assert "def slide(p, velocity, displacement)" in re.sub(r": Any", "", (run / "report.html").read_text())
    forget()
    fit = mr.load(run, mr.StoredRun).fit
    assert fit.spec == own_dampers.guo
    predict = "predict", run, "synthetic:spencer1997"
    command_refusal(*predict, match="with your rights")
    changed = tmp_path / "changed.py"
    changed.write_text(FILE.read_text().replace("+ p.f0", "+ 2.0 * p.f0"))
    command_refusal(*predict, "--model", f"{changed}:guo", match="changed since")
    command_refusal(*predict, "--model", f"{changed}:none", match="no damper 'none'")
    forget()
    assert "97." in printed(*predict, "--model", f"{FILE}:guo")
    forget()
    assert "97." in printed(*predict, "--trust")
    forget()
    mr.load(run, trust=True)
    assert np.isfinite(mr.predict(fit, TEST).model_force).all()


def twice(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    shifted = velocity + p.omega * displacement
    return p.A1 * jnp.tanh(p.A3 * shifted) + p.A2 * shifted + p.f0


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
