"""From a rig's record to a building: a damper that `mrwork identify` found stands in a study."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import printed

import mrwork as mr

STUDY = """\
[building]
published = "uts"

[[damper]]
storey = 1
run = "rig/run"
{more}

[[controller]]
law = "passive_on"
label = "on"

[[motion]]
synthetic = "kanai_tajimi"
duration = 4
pga = "0.1 g"

[report]
histories = "none"
"""


def responded(folder: Path, capsys: pytest.CaptureFixture[str], more: str) -> dict[str, Any]:
    """The runs of the study, by label."""
    (folder / "study.toml").write_text(STUDY.format(more=more))
    text = printed(capsys, "respond", folder / "study.toml", "--out", folder / "out", "--json")
    return {entry["controller"]: entry for entry in json.loads(text)["results"]}


def test_a_damper_identified_without_laws_is_a_passive_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    printed(
        capsys,
        "identify",
        "synthetic:rd1005_1a",
        "--model",
        "bingham",
        "--out",
        tmp_path / "rig" / "run",
        "--quiet",
    )
    found = responded(tmp_path, capsys, more="")
    assert found["i = 0"]["outcome"] == "finished"
    assert found["i = 0"]["energy_error"] < 1e-6
    assert found["i = 0"]["criteria"]["peak_drift"] < found["uncontrolled"]["criteria"]["peak_drift"]
    # It follows no command, and the page says so.
    assert found["on"]["criteria"]["peak_force"] == found["i = 0"]["criteria"]["peak_force"]
    assert "follows no command" in (tmp_path / "out" / "report.html").read_text()


def test_a_damper_identified_with_laws_follows_its_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
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
    printed(capsys, "identify", *records, "--model", "bingham", "--law", "f_c=linear", *short, "--out", out)
    with_laws = responded(tmp_path, capsys, more="largest_command = 1.0")
    weak, strong = with_laws["i = 0"]["criteria"], with_laws["on"]["criteria"]
    # At 1 A the friction is nine times that at none.
    assert strong["peak_force"] > 2.0 * weak["peak_force"]
    assert strong["rms_drift"] < weak["rms_drift"]
    assert with_laws["on"]["energy_error"] < 1e-6
    assert "follows no command" not in (tmp_path / "out" / "report.html").read_text()
