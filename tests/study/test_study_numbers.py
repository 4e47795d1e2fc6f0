"""Studies whose numbers are known: a published experiment, a tall building, and the non-causal optimum."""

from __future__ import annotations

import os
from pathlib import Path

import measured_data
import numpy as np
import pytest
from refusals import refusal

from mrwork import Journal
from mrwork.errors import Interrupted
from mrwork.study import StudyResults, compared, read_study, run_study
from mrwork.study.course import StudyProgress
from mrwork.study.folder import study_document

N = 40
MASS, STIFFNESS = 3e5, 6e8
TALL = f"""\
[building]
n_storeys = {N}
masses = [{MASS}]
stiffnesses = [{STIFFNESS}]
rayleigh = {{ ratios = [0.02, 0.02], modes = [1, 5] }}

[[damper]]
storey = 1
preset = "kwok2006"
count = 2000

[[damper]]
storey = 2
preset = "kwok2006"
count = 2000

[[controller]]
law = "clipped_optimal"
settings = {{ drifts = 1, control_weight = 1e-15 }}

[[motion]]
synthetic = "kanai_tajimi"
duration = 6
pga = "0.3 g"

[hardware]
sample_time = "5 ms"
step = "2.5 ms"
delay = "5 ms"
feedback = "observer"
measured_floors = [1, 20, 40]
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> StudyResults:
    path = tmp_path_factory.mktemp("tall") / "study.toml"
    path.write_text(TALL)
    study = read_study(path)
    # Angular frequencies of equal floors on equal springs: 2 sqrt(k/m) sin((2 j - 1) pi / (4 n + 2)).
    orders = np.arange(1, N + 1)
    wanted = 2.0 * np.sqrt(STIFFNESS / MASS) * np.sin((2 * orders - 1) * np.pi / (4 * N + 2))
    assert study.building.frequencies * 2.0 * np.pi == pytest.approx(wanted, rel=1e-9)
    return run_study(study, check_step=True)


def test_every_run_of_forty_storeys_ends_and_its_energies_add_up(results: StudyResults) -> None:
    assert results.complete
    for run in results.runs.values():
        assert run.outcome == "finished"
        assert run.peak_drift.shape == run.peak_acceleration.shape == (N,)
        assert run.energy_error < 1e-6
    assert results.warnings() == []


def test_two_dampers_behind_an_observer_take_up_energy_and_lower_the_drift(results: StudyResults) -> None:
    off, controlled = results.runs[1, 0], results.runs[2, 0]
    assert controlled.device_energy.shape == (2,)
    assert (controlled.device_energy > off.device_energy).all()
    assert (controlled.rms_current > 0.0).all()
    assert controlled.rms_drift.max() < off.rms_drift.max() < results.runs[0, 0].rms_drift.max()


def test_half_the_step_hardly_moves_it(results: StudyResults) -> None:
    for row in range(len(results.rows)):
        changes = results.step_changes(row, 0)
        assert changes is not None
        assert changes["peak_drift"] < 1e-3


STUDY = """
[building]
published = "uts"

[[damper]]
storey = 1
preset = "kwok2006"
lag = 190
differential = true

[[controller]]
law = "clipped_optimal"
settings = { drifts = 1, control_weight = 1e-13 }

[[motion]]
synthetic = "kanai_tajimi"
duration = 1
pga = "0.1 g"

[report]
histories = "none"
"""
ASKED = STUDY + '[clairvoyant]\ninterval = "20 ms"\nexplore = 1\nfinish = 1\n'


def ran(folder: Path, *, resume: bool = False, stop: str = "nowhere") -> StudyResults:
    """Run the study; Ctrl-C comes when a label contains `stop`."""
    path = folder / "study.toml"
    path.write_text(ASKED)

    def on_progress(progress: StudyProgress) -> None:
        if stop in progress.label:
            raise KeyboardInterrupt

    with_journal = Journal(
        folder / f"journal {stop}" if not resume else folder / "journal random", resume=resume
    )
    try:
        return run_study(read_study(path), journal=with_journal, on_progress=on_progress)
    finally:
        with_journal.close()


@pytest.mark.long
def test_the_row_is_ranked_apart_and_resumes_to_the_bit(tmp_path: Path) -> None:
    whole = ran(tmp_path)
    last = len(whole.rows) - 1
    assert (whole.rows[last].label, whole.complete) == ("Clairvoyant", True)
    assert [rank.name for rank, rows in compared(whole).ranks if last in rows] == ["clairvoyant"]
    # The commands of the law are a start, as means over the intervals.
    found = whole.clairvoyants[0]
    assert "Clipped-optimal" in [start.name for start in found.starts]
    assert whole.score(last) == pytest.approx(found.score, rel=1e-12)
    document = study_document(whole)
    assert document["clairvoyant"][0]["score"] == found.score
    assert "not certified" in document["clairvoyant"][0]["statement"]
    with pytest.raises(Interrupted) as stopped:
        ran(tmp_path, stop="random")
    assert (last, 0) not in stopped.value.result.runs
    lines = (tmp_path / "journal random").read_text().count("\n")
    resumed = ran(tmp_path, resume=True)
    np.testing.assert_array_equal(resumed.clairvoyants[0].commands.command, found.commands.command)
    # The searches that were done are not done again.
    assert (tmp_path / "journal random").read_text().count("\n") == lines + 2


@pytest.mark.parametrize(
    ("before", "after", "word"),
    [
        ('"20 ms"', '"20.5 ms"', "interval.*multiple"),
        ("[clairvoyant]", "[hardware]\ncommand_rate = 5\n[clairvoyant]", "command_rate; leave one out"),
    ],
)
def test_an_optimum_that_cannot_be_searched_for_is_refused(
    before: str, after: str, word: str, tmp_path: Path
) -> None:
    path = tmp_path / "study.toml"
    path.write_text(ASKED.replace(before, after))
    refusal(read_study, path, match=word)


STUDIES = measured_data.ROOT / "studies" / "respond"
RECORDS = Path(os.environ.get("MRWORK_DATA", "../shared/data")) / "records"


@pytest.fixture(scope="module")
def dyke(tmp_path_factory: pytest.TempPathFactory) -> StudyResults:
    """The study, its record taken from where it is here."""
    if not (RECORDS / "el_centro_1940_ns.csv").is_file():
        pytest.skip(f"no measured records in {RECORDS}; set MRWORK_DATA")
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
