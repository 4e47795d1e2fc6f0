"""A study file asks for designed weights, and says what they reach wherever it shows itself."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import mrwork
from study_texts import study_text

import mrwork as mr
from mrwork.control import RegulatorSettings, WeightWishes, design_weights
from mrwork.errors import InvalidSettingError, SettingError
from mrwork.motions import fitted_spectrum

WISHES = "designed = { rms_drift = '4 mm', rms_acceleration = '0.5 g', budget = '0.9 kN' }"


def read(folder: Path, settings: str) -> mr.Study:
    file = folder / "study.toml"
    file.write_text(study_text(settings))
    return mr.read_study(file)


def designed() -> mr.control.DesignedWeights:
    frame = mr.building("uts")
    return design_weights(
        frame,
        frame.storeys[:1],
        limits={"rms_drift": 4e-3, "rms_acceleration": 0.5 * 9.80665},
        budget="0.9 kN",
    )


@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_the_law_has_the_gain_of_the_design_with_r_scaled(tmp_path: Path, scale: float) -> None:
    law = read(tmp_path, f"{WISHES}\ncontrol_weight = {scale}").arrangements[-1].law
    assert law is not None
    expected = designed().gain_with(scale)
    error = np.linalg.norm((np.asarray(law.gains["gain"]) - expected) @ designed().plant.scaling)
    assert error <= 1e-7 * np.linalg.norm(expected @ designed().plant.scaling)


def test_what_the_design_reaches_is_said_everywhere(tmp_path: Path) -> None:
    study = read(tmp_path, f"{WISHES}\ncontrol_weight = 1e-2")
    (label, notes), *_ = study.design_notes
    assert label == "Clipped-optimal"
    assert "All limits can be met" in notes[0]
    assert any("scanned in the true loop" in each for each in notes)
    assert notes[0] in repr(study.arrangements[-1].law)
    shown = mrwork("respond", tmp_path / "study.toml", "--out", tmp_path / "run", "--quiet")
    assert shown.returncode in (0, None)
    assert notes[0] in shown.stdout
    assert "scanned in the true loop" in (tmp_path / "run" / "report.html").read_text()
    ended = mrwork("respond", tmp_path / "study.toml", "--out", tmp_path / "run", "--quiet", "--json")
    assert json.loads(ended.stdout)["weights"] == [{"controller": label, "notes": list(notes)}]


def test_limits_out_of_reach_are_said_and_not_refused(tmp_path: Path) -> None:
    wishes = "designed = { rms_drift = '1 mm', budget = 100 }\ncontrol_weight = 1"
    (_, notes), *_ = read(tmp_path, wishes).design_notes
    assert "cannot be met" in notes[0]


def test_spectra_of_a_record_and_stiffness_cases_are_keys(tmp_path: Path) -> None:
    motion = mr.synthetic_motion(rng=4, duration=20.0)
    lines = [f"{time:.3f},{each:.6f}" for time, each in zip(motion.time, motion.acceleration, strict=True)]
    (tmp_path / "record.csv").write_text("\n".join(["time [s],acceleration [m/s2]", *lines]))
    wishes = "designed = { rms_drift = 0.004, budget = 900, record = 'record.csv', stiffness = [0.8, 1.2] }"
    law = read(tmp_path, f"{wishes}\ncontrol_weight = 1").arrangements[-1].law
    assert law is not None
    frame = mr.building("uts")
    spectrum = fitted_spectrum(mr.read_motion(tmp_path / "record.csv"))
    expected = design_weights(
        frame,
        frame.storeys[:1],
        limits={"rms_drift": 4e-3},
        budget=900.0,
        spectrum=spectrum,
        cases=mr.control.stiffness_cases(frame, (0.8, 1.2), spectrum),
    ).gain
    np.testing.assert_allclose(
        np.asarray(law.gains["gain"]), expected, rtol=1e-4, atol=1e-4 * np.abs(expected).max()
    )


def test_one_number_of_r_keeps_the_ratio_of_two_devices() -> None:
    frame, rd1005 = mr.building("uts"), mr.damper("static_hysteretic").preset("kwok2006")
    devices = [
        mr.Device(
            name=f"{k}", spec=rd1005.spec, theta=rd1005.theta, row=frame.storeys[k], largest_command=1.88
        )
        for k in range(2)
    ]
    problem = mr.control.DesignProblem(building=frame, devices=devices, sample_time=1e-3)
    wishes = WeightWishes(rms_drift=4e-3, budget=(600.0, 200.0))
    settings = RegulatorSettings(designed=wishes, control_weight=0.1)
    expected = design_weights(frame, devices, limits={"rms_drift": 4e-3}, budget=[600.0, 200.0])
    np.testing.assert_allclose(
        settings.regulator(problem).gain @ problem.plant.scaling,
        expected.gain_with(0.1) @ problem.plant.scaling,
        rtol=0.0,
        atol=1e-6 * np.linalg.norm(expected.gain_with(0.1) @ problem.plant.scaling),
    )


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (f"{WISHES}\ncontrol_weight = 1\ndrifts = 1", "designed weights, and drifts; keep one"),
        ("designed = { rms_drift = 0.004 }\ncontrol_weight = 1", "has no budget"),
        ("designed = { peak_drift = 0.004, budget = 1 }\ncontrol_weight = 1", "no key 'peak_drift'"),
        ("designed = { rms_drift = [1, 2], budget = 1 }\ncontrol_weight = 1", "2 limits, and there are 5"),
        ("designed = { budget = 100 }\ncontrol_weight = 1", "no response is limited"),
        ("designed = { rms_drift = '4 kN', budget = 1 }\ncontrol_weight = 1", "its unit may be"),
        (WISHES, "has no control_weight"),
    ],
)
def test_what_cannot_be_designed_is_refused_with_its_line(tmp_path: Path, settings: str, words: str) -> None:
    with pytest.raises(SettingError, match=words) as refusal:
        read(tmp_path, settings)
    assert "study.toml, line 1" in str(refusal.value)


def test_a_budget_in_another_unit_is_refused() -> None:
    frame = mr.building("uts")
    with pytest.raises(SettingError, match="its unit may be N, kN"):
        design_weights(frame, frame.storeys[:1], limits={"rms_drift": 1e-3}, budget="1.5 mm")
    with pytest.raises(InvalidSettingError, match="fitted to the record"):
        WeightWishes(rms_drift=1e-3, budget=1.0, record="x.csv", intensity=0.1).spectral_density()
