"""Dead zone and slope of [[controller]], and accelerometers of [hardware], in a study."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tuning_samples
from sentences import Refused

import mrwork as mr
from mrwork.study import StudyResults
from mrwork.study.folder import design_document
from mrwork.study.study import fingerprint_of

LAW = '\n[[controller]]\nlaw = "clipped_optimal"\nsettings = {{ control_weight = 1e-12 }}\n{}\n'
MOTION = tuning_samples.motion("A", 1)


def read(folder: Path, more: str) -> mr.Study:
    return mr.read_study(tuning_samples.study_file(folder, tune="", motions=MOTION, more=more))


def ran(folder: Path, more: str) -> StudyResults:
    return mr.run_study(read(folder, more), threads=1)


def test_dead_zone_and_slope_of_a_controller_quiet_its_command(tmp_path: Path) -> None:
    found = ran(
        tmp_path,
        LAW.format('label = "plain"')
        + LAW.format('label = "shaped"\ndead_zone = "5 mm/s"\ncommand_slope = "20 A/s"'),
    )
    plain, shaped = (
        found.runs[row, 0] for row, each in enumerate(found.rows) if each.label in ("plain", "shaped")
    )
    assert shaped.command_travel.max() <= 20.0
    assert plain.command_travel.max() > 20.0
    assert shaped.switching_rate.max() < plain.switching_rate.max()


def test_dead_zone_and_slope_are_told_by_terminal_and_page(tmp_path: Path) -> None:
    study = read(tmp_path, LAW.format('label = "shaped"\ndead_zone = "5 mm/s"\ncommand_slope = "20 A/s"'))
    told = dict(study.design_notes)["Loop of shaped"]
    assert "The command is zero below a damper velocity of 0.005 m/s." in told
    assert "The command changes by at most 20 A or V per second." in told
    # Facts of the study stand on its page, and its document in the folder.
    assert " ".join(told) in dict(study.facts)["Loop of shaped"]
    assert design_document(study)["loops"][0]["notes"] == list(told)
    (quiet,) = read(tmp_path, LAW.format('label = "plain"')).design_notes
    assert not any("The command" in each for each in quiet[1])


def test_a_dead_zone_is_an_input_of_a_run(tmp_path: Path) -> None:
    """A journal without it is of another study."""
    plain = read(tmp_path, LAW.format(""))
    shaped = read(tmp_path, LAW.format('dead_zone = "5 mm/s"'))
    off = read(tmp_path, LAW.format('dead_zone = "0 m/s"'))
    assert fingerprint_of(plain) != fingerprint_of(shaped)
    assert fingerprint_of(plain)["arrangement"] == fingerprint_of(off)["arrangement"]


@pytest.mark.parametrize("law", ["acceleration_driven", "mixed_skyhook"])
def test_laws_of_accelerations_take_no_settings_and_have_noise(law: str, tmp_path: Path) -> None:
    controller = f'\n[[controller]]\nlaw = "{law}"\n'
    noise = 'acceleration_noise = "0.05 m/s2"\n'
    quiet, noisy = ran(tmp_path, controller), ran(tmp_path, noise + controller)
    assert quiet.runs[3, 0].finished
    assert quiet.runs[3, 0].switching_rate.max() > 0.0
    assert np.any(noisy.runs[3, 0].rms_drift != quiet.runs[3, 0].rms_drift)
    # The others read no accelerations.
    np.testing.assert_array_equal(noisy.runs[1, 0].rms_drift, quiet.runs[1, 0].rms_drift)


def test_what_a_study_cannot_shape_or_read_is_refused(tmp_path: Path, refused: Refused) -> None:
    for more in (
        LAW.format('dead_zone = "-1 mm/s"'),
        LAW.format('dead_zone = "5 mm"'),
        LAW.format("command_slope = 0"),
        '\n[[controller]]\nlaw = "best_passive"\ndead_zone = "1 mm/s"\n',
        'acceleration_noise = "0.05 m/s2"\n' + LAW.format(""),
        'ground_preview = "50 ms"\n' + LAW.format(""),
    ):
        refused(read, tmp_path, more)
