"""The studies that come with the project, on measured records."""

from __future__ import annotations

import os
from pathlib import Path

import measured_data
import pytest

from mrwork.study import StudyResults, read_study, run_study

STUDIES = measured_data.ROOT / "studies" / "respond"
RECORDS = Path(os.environ.get("MRWORK_DATA", "../shared/data")) / "records"
if not (RECORDS / "el_centro_1940_ns.csv").is_file():
    pytest.skip(f"no measured records in {RECORDS}; set MRWORK_DATA", allow_module_level=True)


@pytest.fixture(scope="module")
def dyke(tmp_path_factory: pytest.TempPathFactory) -> StudyResults:
    """The study, its record taken from where it is here."""
    text = (STUDIES / "dyke1996.toml").read_text()
    path = tmp_path_factory.mktemp("dyke") / "study.toml"
    path.write_text(text.replace("../../../shared/data/records", str(RECORDS.resolve())))
    return run_study(read_study(path))


# Peaks of the paper: displacement and drift [cm], acceleration [cm/s2], force [N].
PUBLISHED = {
    "Passive-off": ((0.211, 0.357, 0.455), (0.211, 0.153, 0.103), (420.0, 480.0, 717.0), 258.0),
    "passive-on, 2.25 V": ((0.0798, 0.196, 0.306), (0.0798, 0.158, 0.110), (281.0, 494.0, 767.0), 979.0),
    "Clipped-optimal": ((0.114, 0.185, 0.212), (0.114, 0.0902, 0.101), (696.0, 739.0, 703.0), 941.0),
}


@pytest.mark.parametrize("label", list(PUBLISHED))
def test_the_peaks_of_dyke_are_met(dyke: StudyResults, label: str) -> None:
    row = [each.label for each in dyke.rows].index(label)
    run = dyke.runs[row, 0]
    # The record and its interpolation are not quite the paper's.
    in_motion, in_force = (0.02, 0.05) if label == "Clipped-optimal" else (0.03, 0.03)
    displacement, drift, acceleration, force = PUBLISHED[label]
    assert 100.0 * run.peak_displacement == pytest.approx(displacement, rel=in_motion)
    assert 100.0 * run.peak_drift == pytest.approx(drift, rel=in_motion)
    assert 100.0 * run.peak_acceleration == pytest.approx(acceleration, rel=in_force)
    assert run.peak_force.max() == pytest.approx(force, rel=in_force)
    assert run.energy_error < 1e-6
