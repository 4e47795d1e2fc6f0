"""A run folder of each verb that has --out, made in little time."""

from pathlib import Path

import numpy as np
import tuning_samples
from command_line import printed

from mrwork.cli.completions import subcommands
from mrwork.cli.door import parser, verbs

COMMANDS = subcommands(parser(verbs()))
RECORD = ("synthetic:spencer1997", "--every", 40)
FIXED = ("--model", "static_hysteretic", "--fix", "x_s=1e-4")


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


def verbs_with(destination: str) -> list[str]:
    """The verbs that have an argument of this name."""
    return [
        verb
        for verb, parser in COMMANDS.items()
        if any(action.dest == destination for action in parser._actions)
    ]


def words(verb: str, inputs: Path) -> list[object]:
    """A command that writes a run folder in little time, but for --out; a new verb with --out needs its line."""
    given: dict[str, list[object]] = {
        "characterise": [inputs / "rig", "--model", "viscous_dahl"],
        "identify": [*RECORD, *FIXED],
        "respond": [inputs / "small.toml"],
        "tune": [inputs / "tuned.toml", "--quick"],
    }
    return [verb, *given[verb], "--threads", 1, "--quiet"]


def write_inputs(place: Path) -> None:
    """Files that the commands of `words` read."""
    tuning_samples.small_files(place)
    (place / "rig").mkdir()
    written_record(place / "rig" / "10mm1Hz.csv")


def write_runs(inputs: Path, place: Path) -> None:
    """A run folder of each verb that has --out, by its name, and a comparison of models."""
    for verb in verbs_with("out"):
        printed(*words(verb, inputs), "--out", place / verb)
    models = ("--model", "bingham,static_hysteretic", "--threads", 1)
    printed("identify", *RECORD, *models, "--quiet", "--out", place / "compared")
