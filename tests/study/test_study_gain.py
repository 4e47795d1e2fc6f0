"""A finished gain is a law of a study file, as an array or in a file, and a wrong one is told its shape and units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy
from command_line import mrwork
from sentences import Refused
from study_texts import study_text

import mrwork as mr
from mrwork.control import RegulatorSettings

FRAME = mr.building("uts")
PLANT = mr.control.plant_of(FRAME, FRAME.storeys[:1])
GAIN = mr.control.regulator_of_outputs(PLANT, mr.control.drifts(PLANT), 1.0, 1e-11).gain


def study(folder: Path, law: str) -> mr.Study:
    file = folder / "study.toml"
    text = study_text("drifts = 1\ncontrol_weight = 1e-11", damper="differential = true\nlag = 190")
    file.write_text(f"{text}\n[[controller]]\nlabel = 'given'\n{law}")
    return mr.read_study(file)


def gain_of(read: mr.Study) -> object:
    law = read.arrangements[-1].law
    assert law is not None
    return law.gains["gain"]


@pytest.mark.parametrize("name", ["gain.csv", "gain.txt", "gain.npy", "gain.mat", "array", "settings"])
def test_a_gain_from_anywhere_is_the_gain_of_the_law(tmp_path: Path, name: str) -> None:
    rows = GAIN.tolist()
    if name.endswith((".csv", ".txt")):
        np.savetxt(tmp_path / name, GAIN, fmt="%.17g", delimiter="," if name.endswith("csv") else " ")
    if name.endswith(".npy"):
        np.save(tmp_path / name, GAIN)
    if name.endswith(".mat"):
        scipy.io.savemat(tmp_path / name, {"K": GAIN})
    law = f"law = 'clipped_optimal'\ngain = {name!r}"
    if name == "array":
        law = f"law = 'clipped_optimal'\ngain = {rows}"
    if name == "settings":
        law = f"law = 'modified_clipped_optimal'\ngain = {rows}\nsettings = {{ full_force = 500 }}"
    np.testing.assert_array_equal(np.asarray(gain_of(study(tmp_path, law))), GAIN)


def test_a_given_gain_has_the_responses_of_the_regulator_that_it_is_of(tmp_path: Path) -> None:
    results = mr.run_study(study(tmp_path, f"law = 'clipped_optimal'\ngain = {GAIN.tolist()}"), threads=1)
    rows = [row.label for row in results.rows]
    one, other = (results.criteria(rows.index(label), 0) for label in ("Clipped-optimal", "given"))
    assert one == pytest.approx(other, rel=1e-9)


def test_a_given_gain_is_reported_and_cited_as_others(tmp_path: Path) -> None:
    study(tmp_path, f"law = 'clipped_optimal'\ngain = {GAIN.tolist()}")
    shown = mrwork("respond", tmp_path / "study.toml", "--out", tmp_path / "run", "--quiet")
    assert "The gain, 1 x 10, is as given." in shown.stdout
    assert shown.stdout.count("Margins of the linear loop") == 2
    assert "is as given" in (tmp_path / "run" / "report.html").read_text()
    cited = mrwork("cite", tmp_path / "run")
    assert "Dyke" in cited.stdout


def test_a_gain_that_cannot_be_is_told_its_shape_and_units(tmp_path: Path, refused: Refused) -> None:
    np.save(tmp_path / "cube.npy", np.zeros((2, 2, 2)))
    np.save(tmp_path / "objects.npy", np.array([{}]), allow_pickle=True)
    scipy.io.savemat(tmp_path / "two.mat", {"K": GAIN, "L": GAIN})
    for law in (
        "law = 'clipped_optimal'\ngain = [[1, 2], [3, 4]]",
        f"law = 'clipped_optimal'\ngain = {GAIN.T.tolist()}",
        "law = 'clipped_optimal'\ngain = [1, 2]",
        "law = 'clipped_optimal'\ngain = [[1, 2], [3]]",
        "law = 'clipped_optimal'\ngain = 5",
        "law = 'clipped_optimal'\ngain = 'absent.csv'",
        "law = 'clipped_optimal'\ngain = 'cube.npy'",
        "law = 'clipped_optimal'\ngain = 'objects.npy'",
        "law = 'clipped_optimal'\ngain = 'two.mat'",
        "law = 'clipped_optimal'\ngain = 'gain.xlsx'",
        f"law = 'clipped_optimal'\ngain = {GAIN.tolist()}\nsettings = {{ drifts = 1 }}",
        f"law = 'clipped_optimal'\ngain = {GAIN.tolist()}\nsettings = {{ gain = {GAIN.tolist()} }}",
        f"law = 'lyapunov'\ngain = {GAIN.tolist()}",
        f"law = 'best_passive'\ngain = {GAIN.tolist()}",
    ):
        refused(study, tmp_path, law)


def test_a_given_gain_is_designed_in_a_batch_and_certified() -> None:
    damper = mr.damper("static_hysteretic").preset("kwok2006")
    device = mr.Device(
        name="1", spec=damper.spec, theta=damper.theta, row=FRAME.storeys[0], largest_command=1.88
    )
    problem = mr.control.DesignProblem(building=FRAME, devices=[device], sample_time=1e-3)
    given = RegulatorSettings(gain=GAIN.tolist())
    many = [given, RegulatorSettings(drifts=1.0, control_weight=1e-11)]
    for found in RegulatorSettings.designs(problem, many):
        assert isinstance(found, mr.control.Design)
        np.testing.assert_allclose(found.gains["gain"], GAIN, rtol=1e-9)
    assert "is stable" in given.certificate(problem)
