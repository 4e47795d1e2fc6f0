"""From a rig's record to a building: a damper that `mrwork identify` found stands in a study."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import printed
from sentences import Refused

import mrwork as mr

STUDY = """\
[building]
published = "uts"

[[damper]]
storey = 1
run = "rig/run"
{more}

{controller}

[[motion]]
synthetic = "kanai_tajimi"
duration = 4
pga = "0.1 g"

[report]
histories = "none"
"""


ON = '[[controller]]\nlaw = "passive_on"\nlabel = "on"'
CLIPPED = '[[controller]]\nlaw = "clipped_optimal"'


def responded(folder: Path, more: str, controller: str = "") -> dict[str, Any]:
    """The runs of the study, by label."""
    (folder / "study.toml").write_text(STUDY.format(more=more, controller=controller))
    text = printed("respond", folder / "study.toml", "--out", folder / "out", "--json")
    return {entry["controller"]: entry for entry in json.loads(text)["results"]}


def identify_without_laws(folder: Path) -> None:
    out = folder / "rig" / "run"
    printed("identify", "synthetic:rd1005_1a", "--model", "bingham", "--out", out, "--quiet")


def test_a_run_without_laws_is_taken_as_a_passive_damper_where_the_study_says_so(tmp_path: Path) -> None:
    identify_without_laws(tmp_path)
    found = responded(tmp_path, more="passive = true")
    assert set(found) == {"uncontrolled", "passive"}
    assert found["passive"]["outcome"] == "finished"
    assert found["passive"]["energy_error"] < 1e-6
    assert found["passive"]["criteria"]["peak_drift"] < found["uncontrolled"]["criteria"]["peak_drift"]
    page = (tmp_path / "out" / "report.html").read_text()
    assert "passive: all its parameters are constant" in page
    assert "Passive-off" not in page


@pytest.mark.parametrize(
    ("more", "controller", "message"),
    [
        ("", "", "line 4: no parameter of this bingham .* depends on the command"),
        ("largest_command = 1.0", CLIPPED, "no parameter of this bingham"),
        ("passive = true\nlargest_command = 1.0", "", "line 8: a passive damper takes no command"),
        ("passive = true", CLIPPED, "line 10: clipped_optimal commands the dampers, and they are passive"),
        ("passive = true", ON, "line 10: passive_on commands the dampers, and they are passive"),
        ("passive = true", ON.replace("_on", "_off"), ""),
    ],
)
def test_a_run_without_laws_is_no_controllable_damper(
    tmp_path: Path,
    more: str,
    controller: str,
    message: str,
    refused: Refused,
) -> None:
    identify_without_laws(tmp_path)
    study = tmp_path / "study.toml"
    study.write_text(STUDY.format(more=more, controller=controller))
    if not message:
        assert [each.row.label for each in mr.read_study(study).arrangements] == ["uncontrolled", "on"]
        return
    refused(mr.read_study, study)


def test_a_damper_identified_with_laws_follows_its_command(tmp_path: Path) -> None:
    model = mr.damper("bingham").with_current_laws({"f_c": "linear"}, unit="A")
    theta = dict(zip(model.names, model.nominal, strict=True)) | {"f_c.0": 100.0, "f_c.1": 800.0}
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 2.0, 0.002)
    displacement, velocity = 0.01 * np.sin(6.0 * time), 0.06 * np.cos(6.0 * time)
    records = []
    for current in (0.0, 1.0):
        loading = mr.Loading(
            dt=0.002, displacement=displacement, velocity=velocity, command=current, command_unit="A"
        )
        force = mr.simulate_force(model, list(theta.values()), loading) + 5.0 * rng.standard_normal(time.size)
        records.append(tmp_path / f"{current}.csv")
        np.savetxt(
            records[-1],
            np.column_stack([time, displacement, velocity, force, np.full(time.size, current)]),
            delimiter=",",
            header="time_s,displacement_m,velocity_mps,force_N,current_A",
            comments="",
        )
    short = ("--generations", "3", "--population", "20", "--quiet")
    out = tmp_path / "rig" / "run"
    printed("identify", *records, "--model", "bingham", "--law", "f_c=linear", *short, "--out", out)
    with_laws = responded(tmp_path, more="largest_command = 1.0", controller=ON)
    weak, strong = with_laws["Passive-off"]["criteria"], with_laws["on"]["criteria"]
    # At 1 A the friction is nine times that at none.
    assert strong["peak_force"] > 2.0 * weak["peak_force"]
    assert strong["rms_drift"] < weak["rms_drift"]
    assert with_laws["on"]["energy_error"] < 1e-6
    assert "passive: all" not in (tmp_path / "out" / "report.html").read_text()
