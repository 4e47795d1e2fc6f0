"""A run folder opened again has its fit, and its tests to the last bit."""

import json
import os
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from command_line import printed
from refusals import refusal
from verb_folders import written_record

from mrwork.identification.fit_file import OpenedRun, reopen
from mrwork.records.reading import Reading
from mrwork.store.codec import built

OPTIONS = [
    "--column",
    "force=F:kN",
    "--from",
    "0.2",
    "--every",
    "2",
    "--settle",
    "0.1",
    "--repair",
    "offset=30",
]
RIG = ["--observe", "average=0.02", "--observe", "gain=each"]
SEARCH = ["--model", "bingham", "--search", "genetic", "--generations", "2", "--quiet"]


def record(folder: Path) -> Path:
    """A record whose heading does not say what its force is in."""
    path = written_record(folder / "10mm1Hz0x5A.csv", rate=200.0)
    path.write_text(path.read_text().replace("force_kN", "F"))
    return path


def identified(*arguments: str | Path) -> None:
    printed("identify", *arguments, *SEARCH, "--json")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Identified from a file named relative to the folder of the run."""
    folder = tmp_path_factory.mktemp("rig")
    record(folder)
    before = Path.cwd()
    os.chdir(folder)
    try:
        identified("10mm1Hz0x5A.csv", *OPTIONS, *RIG, "--out", folder / "run")
    finally:
        os.chdir(before)
    return folder / "run"


def test_tests_come_back_as_they_were_read_from_any_folder(run: Path) -> None:
    opened = reopen(run)
    assert isinstance(opened, OpenedRun)
    (test,), (quality,) = opened.tests, opened.fit.quality
    window = opened.fit.provenance.settings["windows"]["10mm1Hz0x5A.csv"]
    assert (test.start_time, test.dt, test.n_time, test.n_settle) == tuple(
        window[name] for name in ("start", "dt", "n_time", "n_settle")
    )
    assert test.observation.average_seconds == 0.02
    assert test.observation == quality.observation
    assert opened.fit.settings.observing.words == ["average=0.02", "gain=each"]
    assert any(remark.code == "repaired_offset" for remark in test.remarks)


def test_a_reading_survives_json() -> None:
    reading = Reading(
        files=("a.csv",), repairs={"offset": 3.0, "rest": None}, columns={"force": "F:kN"}, end=2.0
    )
    assert built(Reading, json.loads(json.dumps(asdict(reading)))) == reading


def test_a_run_keeps_the_velocity_that_it_was_fitted_to(tmp_path: Path) -> None:
    """Also where a later verb reads further files for it."""
    time = np.arange(0.0, 2.0, 0.005)
    x = 10.0 * np.sin(2.0 * np.pi * time)
    v = np.append(0.0628, np.diff(x) / 5.0)
    rows = "\n".join(
        f"{t:.3f},{a:.6f},{b:.6f},{900.0 * np.tanh(20.0 * b):.3f}" for t, a, b in zip(time, x, v, strict=True)
    )
    file, folder = tmp_path / "rig.csv", tmp_path / "run"
    file.write_text(f"t_s,x_mm,v_mps,F_N\n{rows}\n")
    for option, source, code in (
        (["--keep-velocity"], "measured", "velocity_late"),
        ([], "derived", "velocity_difference"),
    ):
        identified(file, *option, "--out", folder)
        opened = reopen(folder)
        assert opened.tests[0].velocity_source == source
        predicted = json.loads(printed("predict", folder, file, "--json"))
        told = {each["code"] for each in predicted["test_remarks"]}
        assert told & {"velocity_late", "velocity_difference"} == {code}
        assert predicted["files"][0]["fit_percent"] == pytest.approx(opened.fit.quality[0].fit_percent)


def test_a_file_that_changed_and_one_that_is_gone_are_refused(run: Path) -> None:
    file = run.parent / "10mm1Hz0x5A.csv"
    original = file.read_text()
    try:
        file.write_text(original.replace("F\n", "F \n", 1))
        refusal(reopen, run, match="changed since")
        file.unlink()
        refusal(reopen, run, match="no such file")
    finally:
        file.write_text(original)
