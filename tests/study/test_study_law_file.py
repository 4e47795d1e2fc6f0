"""A study takes a law from a Python file; a law that misbehaves is one sentence and leaves stdout and folders alone."""

import json
import os
import re
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import COMMAND, PATIENCE, mrwork, printed, started, wait_until
from refusals import refusal

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
    run = results.quantities.at(len(study.arrangements) - 1, 0)
    np.testing.assert_array_equal(run["peak_drift"], alone.peak_drift[0])
    assert run["mean_current"][0] > 0.0


def test_realisations_and_a_part_of_the_command_go_with_it(tmp_path: Path) -> None:
    uncertain = "largest_command = 0.1\nlabel = 'Mine'\n[uncertainty]\nrealisations = 3\nstiffness = 0.1"
    study = mr.read_study(write(tmp_path, slope=1e3, more=uncertain))
    results = mr.run_study(study, threads=1)
    row = len(study.arrangements) - 1
    assert results.n_realisations == 3
    assert np.unique(results.criteria_of_runs.peak_drift[row, :, 1:]).size == 3
    assert results.quantities.peak_current[row, 0, 0][0] == pytest.approx(0.1)


def test_an_edited_law_is_not_resumed(tmp_path: Path) -> None:
    study = write(tmp_path)
    out = tmp_path / "run"
    before = digest_of_run(mr.read_study(study).arrangements[-1])
    text = printed("respond", study, "--out", out, "--quiet")
    assert "brake" in text
    printed("respond", study, "--out", out, "--quiet", "--resume")
    write(tmp_path, slope=6.0)
    assert digest_of_run(mr.read_study(study).arrangements[-1]) != before
    assert "arrangement" in printed("respond", study, "--out", out, "--quiet", "--resume", status=2)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"file": "none.py"}, "line 17: .*no such file"),
        ({"function": "brakes"}, "'brakes', did you mean brake"),
        ({"function": "number"}, "no function 'number'"),
        ({"more": "law = 'fuzzy'"}, "line 18: .*has no law; leave it out"),
    ],
)
def test_a_file_that_is_no_law_is_refused_with_its_line(
    tmp_path: Path, changes: dict[str, str], word: str
) -> None:
    refusal(mr.read_study, write(tmp_path, **changes), match=word)


SHORT_STUDY = STUDY.format(file="law.py", function="law", more="").replace("duration = 2", "duration = 0.1")
NAMED = "mrwork: study.toml, line 17: running law.py as Python, for its function law\n"
REFUSED = {
    "sys.exit(0) in a call": (
        "import sys\ndef law(sample, memory):\n    sys.exit(0)\n",
        "law failed at 0 s in law.py, line 3: SystemExit: 0",
    ),
    "an error in a function that it calls": (
        "def speed(sample):\n    return sample.speed\ndef law(sample, memory):\n    return speed(sample)\n",
        "law.py, line 2: AttributeError: 'LoopSample' object has no attribute 'speed'",
    ),
    "NaN": (
        "\ndef law(sample, memory):\n    return float('nan') * sample.rate\n",
        "law.py, line 2.*not a number",
    ),
    "no Python": ("def law(sample, memory):\n    return (\n", "line 17: law.py, line 2 .*SyntaxError"),
    "too few arguments": ("def law(sample):\n    return 0.0\n", "line 17: .*a function of 2 arguments"),
    "a change of what it is given": (
        "def law(sample, memory):\n    sample.largest[:] = 0.0\n",
        "law.py, line 2: ValueError: ",
    ),
}
SENT = "def law(sample, memory):\n    {}\n    return 0.0 * sample.rate\n"
KEPT = {
    "chdir at import": "import os\nos.chdir('/')\n" + SENT.format(""),
    "print in a call": SENT.format("print('a line of the law')"),
    "another stdout at import": "import io, sys\nsys.stdout = sys.stderr = io.StringIO()\n" + SENT.format(""),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a study, in which commands run."""
    (tmp_path / "study.toml").write_text(SHORT_STUDY)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def respond(folder: Path, law: str) -> tuple[object, str, str]:
    """Exit status, stdout and stderr of the study with this law."""
    (folder / "law.py").write_text(law)
    ended = mrwork("respond", "study.toml", "--out", "run", "--json", "--quiet")
    return ended.returncode, ended.stdout, ended.stderr


@pytest.mark.parametrize(("law", "word"), REFUSED.values(), ids=REFUSED)
def test_a_wrong_law_is_one_sentence_with_file_and_line(folder: Path, law: str, word: str) -> None:
    status, out, err = respond(folder, law)
    assert (status, out) == (2, "")
    named, said = err.splitlines()
    assert f"{named}\n" == NAMED
    assert re.search(word, said), said


@pytest.mark.parametrize("law", KEPT.values(), ids=KEPT)
def test_what_a_law_changes_in_the_process_is_undone(folder: Path, law: str) -> None:
    streams = sys.stdout, sys.stderr
    status, out, err = respond(folder, law)
    assert status == 0, err
    assert json.loads(out)["out"] == "run"
    assert (folder / "run" / "results.json").is_file()
    assert (Path.cwd(), sys.stdout, sys.stderr) == (folder, *streams)
    assert err.startswith(NAMED)
    assert set(err.removeprefix(NAMED).splitlines()) <= {"a line of the law"}
    assert ("a line of the law" in law) == ("a line of the law" in err)


@pytest.mark.machine
def test_ctrl_c_in_a_law_is_an_interrupt(folder: Path) -> None:
    waits = "import pathlib, time\n" + SENT.format("pathlib.Path('asked').touch(); time.sleep(60.0)")
    (folder / "law.py").write_text(waits)
    with started(*COMMAND, "respond", "study.toml", "--out", "run", "--json") as process:
        wait_until((folder / "asked").exists, process)
        os.kill(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, err
    assert json.loads(out)["complete"] is False
    assert "interrupted; what was simulated so far is in run" in err
    # Matplotlib takes longer to load than anyone waits after Ctrl-C.
    assert (folder / "run" / "results.json").exists()
    assert not (folder / "run" / "report.html").exists()
