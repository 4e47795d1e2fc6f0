"""Sets of laws that predict nearly as well: kept with a run, how far they are apart, and a study with each of them."""

import json
import shutil
from collections.abc import Mapping
from dataclasses import asdict, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import printed
from record_files import write_test
from sinusoidal_tests import sinusoidal_test

import mrwork as mr
from mrwork.identification.fit_file import others_content
from mrwork.store.codec import json_document
from mrwork.store.run_folder import NEAR_SETS
from mrwork.store.run_writer import add_to_run

COMMANDS = (0.0, 0.5, 1.0)
MOTIONS = ((0.004, 1.0), (0.004, 2.0), (0.002, 3.0))
SMALL = ("--generations", "10", "--threads", "1")
STUDY = """\
[building]
published = "uts"

[[damper]]
storey = 1
run = "run"

[[controller]]
law = "passive_on"
label = "on"

[[controller]]
law = "clipped_optimal"
settings = { drifts = 1, control_weight = 1e-13 }

[[motion]]
synthetic = "kanai_tajimi"
duration = 4
pga = "0.3 g"

[report]
histories = "none"
"""


def made(motion: tuple[float, float], command: float, seed: int) -> mr.DamperTest:
    theta = (800.0, 200.0 + 960.0 * command - 480.0 * command**2, 2000.0, 20.0)
    return sinusoidal_test("viscous_dahl", theta, motion, noise=0.02, rng=seed, command=command)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with the laws of auto, a test beyond its tests, and a study with its damper."""
    place = tmp_path_factory.mktemp("sets")
    files = [
        write_test(place / f"test{number}.csv", made(motion, command, number))
        for number, (motion, command) in enumerate(product(MOTIONS, COMMANDS))
    ]
    write_test(place / "fast.csv", made((0.006, 2.0), 1.0, 99))
    laws = ("--model", "viscous_dahl", "--law", "auto")
    printed("identify", *files, *laws, *SMALL, "--out", place / "run", "--json")
    (place / "study.toml").write_text(STUDY)
    return place


@pytest.fixture(scope="module")
def apart(folder: Path) -> Path:
    """The same, with sets of which the dampers are half and twice as strong, so that a verdict changes."""
    place = Path(shutil.copytree(folder, folder.parent / "apart"))
    fit = mr.load(place / "run", mr.StoredRun).fit
    others = json_document(others_content([scaled(fit, 0.5), scaled(fit, 2.0)])).encode()
    add_to_run(place / "run", {NEAR_SETS: others})
    return place


def scaled(fit: mr.Fit, factor: float) -> mr.Fit:
    """The fit with another yield force."""
    changed = {
        each.name: replace(each, value=factor * each.value, lower=0.0, upper=1e9)
        for each in fit.estimates
        if each.name.startswith("k_w")
    }
    return replace(fit, estimates=tuple(changed.get(each.name, each) for each in fit.estimates))


def respond(folder: Path, *words: str) -> Mapping[str, Any]:
    found = json.loads(printed("respond", folder / "study.toml", *words, "--quiet", "--json"))
    assert isinstance(found, Mapping)
    return found


@pytest.mark.long
def test_sets_that_predict_nearly_as_well_are_fitted_to_all_tests_and_kept(folder: Path) -> None:
    run = mr.load(folder / "run", mr.StoredRun)
    assert run.ranking is not None
    (chosen,) = [each for each in run.ranking.standings if each.is_chosen]
    near = [
        each
        for each in run.ranking.standings
        if each.verdict != "unusable" and each.left_out_percent >= chosen.left_out_percent - 1.0
    ]
    assert run.fit.others
    for other in run.fit.others:
        assert other.provenance.inputs == run.fit.provenance.inputs
        assert other.fit_percent == pytest.approx(run.fit.fit_percent, abs=1.0)
        assert other.spec != run.fit.spec
        assert tuple(sorted(other.spec.following)) in {tuple(sorted(each.laws)) for each in near}


@pytest.mark.long
def test_predict_says_how_far_the_sets_are_apart_where_the_tests_end(apart: Path) -> None:
    run = mr.load(apart / "run", mr.StoredRun)
    test = mr.read_damper_test(apart / "fast.csv")
    prediction = mr.predict(run.fit, test)
    forces = np.concatenate([prediction.model_force[None], prediction.other_forces])
    ends = np.abs(test.velocity) >= 0.95 * run.fit.tested.velocity
    ends |= np.abs(test.displacement) >= 0.95 * run.fit.tested.stroke
    ends[: test.n_settle] = False
    spread = np.linalg.norm(np.ptp(forces[:, ends], axis=0)) / np.linalg.norm(forces[0, ends])
    assert prediction.sets_apart is not None
    assert prediction.sets_apart.percent == pytest.approx(100.0 * spread, rel=0.02)
    (row,) = json.loads(printed("predict", apart / "run", apart / "fast.csv", "--json"))["files"]
    assert row["sets_apart_percent"] == pytest.approx(prediction.sets_apart.percent)
    # The page and Python read what the call has kept, with the same sets.
    held_out = mr.load(apart / "run", mr.StoredRun).held_out
    assert held_out is not None
    np.testing.assert_allclose(held_out.predictions[0].other_forces, prediction.other_forces, rtol=1e-5)
    slow = mr.predict(run.fit, made((0.002, 1.0), 1.0, 3))
    assert slow.sets_apart is None


def test_an_ensemble_says_which_verdict_changes_and_is_read_back(apart: Path, tmp_path: Path) -> None:
    plain = respond(apart, "--out", str(tmp_path / "plain"))
    assert "3 sets of laws" in plain["sets_apart"]
    found = respond(apart, "--ensemble", "--out", str(tmp_path / "run"))
    of_study = {"ensemble", "out"}
    assert {name: found[name] for name in found if name not in of_study} == {
        name: plain[name] for name in plain if name not in of_study
    }
    ensemble = mr.load(tmp_path / "run", mr.StudyResults).ensemble
    assert ensemble is not None
    assert json.loads(json_document(asdict(ensemble))) == found["ensemble"]
    assert len(ensemble.sets) == 3
    drift = next(each for each in ensemble.verdicts if each.subject.startswith("Peak drift"))
    assert len(set(drift.values)) == 3
    assert any(each.changes for each in ensemble.verdicts)
    assert mr.load(tmp_path / "plain", mr.StudyResults).ensemble is None
    # Without the option the runs stay in the journal, from which they come back.
    out = ("--out", str(tmp_path / "run"), "--resume")
    respond(apart, *out)
    assert respond(apart, "--ensemble", *out)["ensemble"] == found["ensemble"]
