"""A study takes a law from a Python file: it runs as any row, an edited law is another one, mistakes are sentences."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import mrwork
from sentences import Refused

import mrwork as mr
from mrwork.study.study import digest_of_run

LAW = """
from dataclasses import dataclass

import numpy as np

@dataclass
class Gains:
    slope: float = {slope}

def brake(sample, memory):
    memory += 1.0
    return Gains().slope * np.abs(sample.rate)

def one(sample):
    return sample.rate

def broken(sample, memory):
    return sample.speed

number = 3
"""
STUDY = """[building]
published = "uts"

[[damper]]
storey = 1
preset = "kwok2006"

[[motion]]
synthetic = "kanai_tajimi"
duration = 2

[hardware]
delay = "2 ms"
force_noise = "1 N"

[[controller]]
user = {{ file = "{file}", function = "{function}", memory = 1 }}
{more}
"""


def write(
    folder: Path, *, slope: float = 5.0, file: str = "my_law.py", function: str = "brake", more: str = ""
) -> Path:
    (folder / "my_law.py").write_text(LAW.format(slope=slope))
    study = folder / "study.toml"
    study.write_text(STUDY.format(file=file, function=function, more=more))
    return study


def test_the_row_is_the_law_in_python(tmp_path: Path) -> None:
    study = mr.read_study(write(tmp_path))
    results = mr.run_study(study, threads=1)
    row = study.arrangements[-1]
    assert (row.row.label, row.row.kind, row.row.description) == (
        "brake",
        "controller",
        "brake of my_law.py, in Python",
    )
    law = mr.closed_loop.UserLaw(name="mine", command=lambda sample, memory: 5.0 * np.abs(sample.rate))
    alone = mr.simulate_loop(
        row.building, row.devices, law, [study.motions[0].ground], study.hardware, threads=1
    )
    run = results.runs[len(study.arrangements) - 1, 0]
    np.testing.assert_array_equal(run.peak_drift, alone.peak_drift[0])
    assert run.mean_current[0] > 0.0


def test_realisations_and_a_part_of_the_command_go_with_it(tmp_path: Path) -> None:
    uncertain = "largest_command = 0.1\nlabel = 'Mine'\n[uncertainty]\nrealisations = 3\nstiffness = 0.1"
    study = mr.read_study(write(tmp_path, slope=1e3, more=uncertain))
    results = mr.run_study(study, threads=1)
    row = len(study.arrangements) - 1
    assert results.n_realisations == 3
    assert np.unique(results.labelled.peak_drift[row, :, 1:]).size == 3
    assert results.runs[row, 0].peak_current[0] == pytest.approx(0.1)


def test_an_edited_law_is_not_resumed(tmp_path: Path) -> None:
    study = write(tmp_path)
    out = tmp_path / "run"
    before = digest_of_run(mr.read_study(study).arrangements[-1])
    first = mrwork("respond", study, "--out", out, "--quiet")
    assert first.returncode == 0, first.stderr
    assert "brake" in first.stdout
    again = mrwork("respond", study, "--out", out, "--quiet", "--resume")
    assert again.returncode == 0, again.stderr
    write(tmp_path, slope=6.0)
    assert digest_of_run(mr.read_study(study).arrangements[-1]) != before
    refused = mrwork("respond", study, "--out", out, "--quiet", "--resume")
    assert refused.returncode == 2
    assert "arrangement" in refused.stderr


def test_a_file_that_is_no_law_is_refused_with_its_line(tmp_path: Path, refused: Refused) -> None:
    for changes in (
        {"file": "none.py"},
        {"file": "study.toml"},
        {"function": "brakes"},
        {"function": "number"},
        {"function": "one"},
        {"more": "law = 'fuzzy'"},
        {"more": "settings = { slope = 1 }"},
    ):
        refused(mr.read_study, write(tmp_path, **changes))


def test_a_row_without_any_law_is_refused(tmp_path: Path, refused: Refused) -> None:
    study = write(tmp_path)
    study.write_text(study.read_text().replace("user = ", "# "))
    refused(mr.read_study, study)


def test_a_passive_damper_takes_no_law_in_python(tmp_path: Path, refused: Refused) -> None:
    study = write(tmp_path)
    passive = 'model = "dahl"\nparameters = { k_w = 1e3, rho = 1e3, f0 = 0.0 }\npassive = true'
    study.write_text(study.read_text().replace('preset = "kwok2006"', passive))
    refused(mr.read_study, study)


def test_a_law_that_raises_while_running_ends_the_command_with_a_sentence(tmp_path: Path) -> None:
    ended = mrwork("respond", write(tmp_path, function="broken"), "--out", tmp_path / "run", "--quiet")
    assert ended.returncode == 2
    assert f"broken failed at 0 s in {tmp_path / 'my_law.py'}, line 18: AttributeError" in ended.stderr
    assert "Traceback" not in ended.stderr
