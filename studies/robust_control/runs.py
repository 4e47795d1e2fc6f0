"""Virtual tests of the RD-1005-3, and run folders made by the command line: the identified damper, the tuned laws."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

import mrwork as mr

CURRENTS = (0.0, 0.47, 0.94, 1.41, 1.88)
# Amplitude [m] and frequency [Hz] of the motions. Without the smallest one the posterior of x_s, the elongation over
# which the force turns, spans three decades, and with it the floor accelerations.
MOTIONS = ((0.0003, 1.0), (0.002, 3.0), (0.006, 2.0))
CYCLES, DT = 4, 1e-3
# Standard deviations of the sensors.
FORCE_NOISE, DISPLACEMENT_NOISE = 15.0, 5e-6
LAWS = {
    "c": "linear",
    "k": "linear",
    "alpha": "quadratic",
    "delta": "linear",
    "f0": "linear",
}


def write_tests(folder: Path) -> list[Path]:
    """A file for each current and motion, with sensor noise."""
    rd1005 = mr.damper("static_hysteretic").preset("kwok2006")
    rng = np.random.default_rng(2006)
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for current in CURRENTS:
        for amplitude, frequency in MOTIONS:
            omega = 2.0 * np.pi * frequency
            time = DT * np.arange(round(CYCLES / frequency / DT) + 1)
            x, v = amplitude * np.sin(omega * time), amplitude * omega * np.cos(omega * time)
            force = mr.simulate_force(
                rd1005.spec,
                rd1005.theta,
                mr.Loading(dt=DT, displacement=x, velocity=v, command=current, command_unit="A"),
            )
            noisy = np.column_stack(
                [
                    time,
                    x + DISPLACEMENT_NOISE * rng.standard_normal(time.size),
                    v,
                    force + FORCE_NOISE * rng.standard_normal(time.size),
                    np.full(time.size, current),
                ]
            )
            files.append(folder / f"{1e3 * amplitude:g}mm_{frequency:g}Hz_{current:g}A.csv")
            header = "time [s],displacement [m],velocity [m/s],force [N],current [A]"
            np.savetxt(files[-1], noisy, delimiter=",", header=header, comments="", fmt="%.9g")
    return files


QUICK = ("--quick", "--law", "clipped_optimal")


def identified(folder: Path, say: Callable[[str], None]) -> Path:
    """The run folder of the damper with posterior draws, unless it is there already, from the same tests."""
    run, mark = folder / "damper", folder / "tests.digest"
    files = write_tests(folder / "tests")
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
    if not (mark.is_file() and mark.read_text(encoding="utf-8") == digest):
        laws = [part for name, law in LAWS.items() for part in ("--law", f"{name}={law}")]
        say(f"identification of the damper from {len(files)} tests")
        _mrwork(
            "identify",
            *map(str, files),
            "--model",
            "static_hysteretic",
            *laws,
            "--seed",
            "0",
            "--out",
            str(run),
        )
        say("its posterior")
        _mrwork("sample", str(run), "--seed", "0")
        mark.write_text(digest, encoding="utf-8")
    return run


def tuned(
    file: Path, run: Path, *, computation: Sequence[str], quick: bool, resume: bool
) -> mr.tuning.TuningResults:
    """The tuning of a study file, continued where it was begun if `resume`; its folder has chosen.toml and a page.

    `computation` are options of the verb that do not change the result.
    """
    begun = any((folder / "journal.jsonl").is_file() for folder in (run, run.with_name(f"{run.name}.part")))
    _mrwork(
        "tune",
        str(file),
        "--out",
        str(run),
        *computation,
        *(["--resume"] if resume and begun else []),
        *(QUICK if quick else ()),
    )
    return mr.tuning.read_tuning(run)


def _mrwork(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "mrwork", *arguments], check=True, stdout=subprocess.DEVNULL)
