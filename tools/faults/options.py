"""Options of every verb, as the parser declares them, and values that they cannot take."""

from __future__ import annotations

import argparse
from itertools import cycle
from pathlib import Path

import numpy as np
from study_texts import study_text

from mrwork.cli.door import parser
from mrwork.cli.numbers import Listed, OrWord, Range

NO_NUMBERS = (
    *("nan", "-nan", "inf", "-inf", "1e400", "-1e400", "1e30", "-1e30", str(2**70), str(-(2**70))),
    *("9" * 20, "9" * 5000, "", " ", "x", "0x10", "1:2", "1;2", "\x1b[31m", "\udcff", "1\n2", "\u202e1"),
)
NO_VALUES = (
    *("nan", "inf", "-inf", "1e400", "-1e400", "1e30", "-1e30", "9" * 400, "1e30A", "-5A", "1e9A", "", "x"),
    *("nan:1", "1:nan", "inf:1", "2:1", "1:1e400", "normal:nan:1", "uniform:-inf:inf", "\x1b[31m", "\udcff"),
)
NAMES = ("force", "command", "delay", "offset", "mass", "average", "lowpass", "gain", "c", "k", "no")
NO_TEXTS = (
    *("", "=", "nan", "1", "=1", "\x1b[31m", "\udcff", "x" * 300, "a\nb", "lowpass=0", "average=1e5"),
    *(f"{name}={value}" for name, value in zip(cycle(NAMES), NO_VALUES, strict=False)),
)
NO_PATHS = ("", "x" * 300, "/dev/null/x", "/dev/null/\x1b[31m", "/dev/null/\u202e\udcff")


def options_of(verb: str) -> list[argparse.Action]:
    """Options of a verb that take a value, and its arguments."""
    (commands,) = (each for each in parser([verb])._actions if isinstance(each, argparse._SubParsersAction))
    return [each for each in commands.choices[verb]._actions if each.nargs != 0]


def is_number(option: argparse.Action) -> bool:
    return isinstance(option.type, Range | Listed | OrWord)


def written_record(path: Path, stroke: float = 10.0, noise: float = 0.0, rate: float = 100.0) -> Path:
    """A test at 1 Hz of a damper with friction and viscosity: `stroke` in mm, `noise` in kN, `rate` in Hz."""
    time = np.arange(0.0, 2.0, 1.0 / rate)
    velocity = 2.0 * np.pi * stroke * np.cos(2.0 * np.pi * time)
    force = 0.4 * np.tanh(velocity / 10.0) + 0.005 * velocity
    scatter = noise * np.random.default_rng(3).standard_normal(time.size)
    columns = (time, stroke * np.sin(2.0 * np.pi * time), force + scatter)
    rows = "\n".join(",".join(f"{number:.9f}" for number in row) for row in zip(*columns, strict=True))
    path.write_text(f"t_s,displacement_mm,force_kN\n{rows}\n")
    return path


def arguments_of(verb: str, record: Path, run: Path, folder: Path) -> list[object]:
    """Arguments with which a verb would run, writing into a folder; a new verb needs its line."""
    study = folder / "study.toml"
    study.write_text(study_text("control_weight = 1e-13"))
    rig = folder / "rig"
    rig.mkdir(exist_ok=True)
    written_record(rig / "10mm1Hz.csv")
    arguments: dict[str, list[object]] = {
        "demo": ["--out", folder / "demo"],
        "init": ["study", folder / "sample"],
        "models": [],
        "check": [record],
        "characterise": [rig, "--model", "static_hysteretic", "--out", folder / "damper"],
        "compare": [run, run, "--out", folder / "compare.html"],
        "identify": [record, "--model", "static_hysteretic", "--out", folder / "new"],
        "profile": [run],
        "sample": [run, "--steps", "2"],
        "calibrate": [run, record],
        "predict": [run, record],
        "report": [run],
        "plan": [run],
        "respond": [study, "--out", folder / "study"],
        "tune": [study, "--out", folder / "tuned", "--quick"],
        "fragility": [run, "--limit", "peak_drift_ratio=1%"],
        "convert": ["spencer", "--to", "normalised", "alpha=1", "A=1", "n=2", "gamma=1", "beta=1"],
        "export": [run, "--to", "csv"],
        "cite": [run],
        "completion": ["bash"],
    }
    return arguments[verb]
