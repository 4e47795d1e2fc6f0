"""A study takes a law of the user with its settings, tunes and prints it, and finds it again in its file."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from own_laws import skyhook_law
from refusals import refusal

import mrwork as mr

LAW = '''
import numpy as np
import mrwork as mr


def brake(sample, memory, settings):
    """i = gain |v| where the force resists"""
    return np.where(sample.force * sample.rate > 0.0, settings.gain * np.abs(sample.rate), 0.0)


law = mr.own_law(brake, settings={"gain": ("A s/m", 0.5, 6.0, 100.0)}, title="Brake")
number = 3
'''
STUDY = """[building]
published = "uts"

[[damper]]
storey = 1
preset = "kwok2006"

[[motion]]
synthetic = "kanai_tajimi"
duration = 1

[[controller]]
user = { file = "my_law.py", law = "law" }
settings = { gain = 20.0 }
dead_zone = "1 mm/s"

[[controller]]
user = { file = "my_law.py", law = "law" }
label = "nominal"
"""
TUNE = """
[[tune]]
user = { file = "my_law.py", law = "law" }
free = { gain = [1, 50] }
population = 5
budget = 5
"""


def write(folder: Path, more: str = "", *, study: str = STUDY) -> Path:
    (folder / "my_law.py").write_text(LAW)
    (folder / "study.toml").write_text(study + more)
    return folder / "study.toml"


def test_the_row_has_the_settings_of_its_table(tmp_path: Path) -> None:
    study = mr.read_study(write(tmp_path))
    rows = study.arrangements[-2:]
    assert [each.row.label for each in rows] == ["Brake", "nominal"]
    assert rows[0].row.description == "Brake of my_law.py"
    assert [float(each.law.gains["gain"][0]) for each in rows] == [20.0, 6.0]
    assert rows[0].law.dead_zone == 1e-3
    results = mr.run_study(study, threads=1)
    run = results.quantities.at(len(study.arrangements) - 1, 0)
    alone = mr.simulate_loop(rows[1].building, rows[1].devices, rows[1].law, study.grounds, study.hardware)
    np.testing.assert_array_equal(run["peak_drift"], alone.peak_drift[0])
    assert not [remark for remark in results.remarks if remark.code == "law_in_python"]


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ('law = "law"', 'law = "lw"', "no 'lw' that mr.own_law has made"),
        ('law = "law"', 'law = "number"', "no 'number' that mr.own_law has made"),
        ('law = "law"', 'law = "law", function = "brake"', "both law and function"),
        (', law = "law"', "", "neither law nor function"),
        ('law = "law"', 'law = "law", memory = 2', "memory is given to mr.own_law"),
        ("gain = 20.0", "gain = 200.0", "200.*100"),
        ("gain = 20.0", "slope = 2.0", "slope"),
    ],
)
def test_what_is_no_law_of_the_file_is_refused(tmp_path: Path, old: str, new: str, word: str) -> None:
    refusal(mr.read_study, write(tmp_path, study=STUDY.replace(old, new, 1)), match=word)


def test_tune_searches_its_settings_and_its_folder_is_read_without_the_file(tmp_path: Path) -> None:
    study = mr.read_study(write(tmp_path, TUNE))
    tuned = mr.tune(study)
    (law,) = tuned.laws
    assert 1.0 <= law.settings["gain"] <= 50.0
    assert law.label == "Brake, tuned"
    out = tmp_path / "out"
    command = [sys.executable, "-m", "mrwork", "tune", "study.toml", "--out", str(out), "--quiet"]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    chosen = mr.read_study(out / "chosen.toml")
    assert chosen.arrangements[-1].row.label == "Brake, tuned"
    (tmp_path / "my_law.py").unlink()
    read = f"import mrwork as mr; print(mr.load({str(out)!r}).tuned.laws[0].label)"
    ended = subprocess.run([sys.executable, "-c", read], capture_output=True, text=True, check=False)
    assert ended.stdout == "Brake, tuned\n", ended.stderr


def test_it_is_printed_as_c_with_its_settings(tmp_path: Path) -> None:
    files = mr.export(write(tmp_path), "c", tmp_path / "brake", law="Brake")
    assert files
    text = (tmp_path / "brake" / "brake.h").read_text()
    assert "double gain[1];  /* [A s/m] setting of Brake, from 0.5 to 100 */" in text


def test_a_function_of_rows_is_printed_too(tmp_path: Path) -> None:
    rows = "import numpy as np\n\ndef brake(sample, memory):\n    return 10.0 * np.abs(sample.rate)\n"
    path = write(tmp_path, study=STUDY.split("[[controller]]")[0])
    (tmp_path / "rows.py").write_text(rows)
    path.write_text(path.read_text() + '[[controller]]\nuser = { file = "rows.py", function = "brake" }\n')
    mr.export(path, "c", tmp_path / "brake")
    assert "fabs" in (tmp_path / "brake" / "brake.c").read_text()


def test_a_study_in_python_takes_it_and_writes_it(tmp_path: Path) -> None:
    law = skyhook_law()
    study = mr.study_of(
        building=mr.building("uts"),
        dampers=[{"storey": 1, "preset": "kwok2006"}, {"storey": 2, "preset": "kwok2006"}],
        laws=[law, {"law": law, "label": "more", "settings": {"gain": 9.0}}],
        motions=[mr.synthetic_motion(duration=1.0)],
        tune={"laws": [law], "population": 5, "budget": 5},
    )
    assert [each.row.label for each in study.arrangements[-2:]] == ["skyhook", "more"]
    study.to_toml(tmp_path / "study.toml")
    again = mr.read_study(tmp_path / "study.toml")
    for mine, its in zip(study.arrangements[-2:], again.arrangements[-2:], strict=True):
        assert mine.law.gains == its.law.gains
    assert again.tunes[0].laws == (again.arrangements[-1].law.name,)
    refusal(mr.study_of, building=mr.building("uts"), laws=[mr.ControlLaw(name="passive", gains={"command": [1.0]})],
            motions=[mr.synthetic_motion(duration=1.0)], match="designed already")  # fmt: skip


def test_a_law_that_cannot_be_recorded_is_told_once_with_its_line(tmp_path: Path) -> None:
    branch = "10.0 * abs(sample.rate) if sample.time > 0.1 else 0.0 * sample.rate"
    rows = f"import numpy as np\n\ndef brake(sample, memory):\n    return {branch}\n"
    path = write(tmp_path, study=STUDY.split("[[controller]]")[0])
    (tmp_path / "rows.py").write_text(rows)
    path.write_text(path.read_text() + '[[controller]]\nuser = { file = "rows.py", function = "brake" }\n')
    results = mr.run_study(mr.read_study(path), threads=1)
    (remark,) = [remark for remark in results.remarks if remark.code == "law_in_python"]
    assert "rows.py, line 4: `if`" in remark.message
