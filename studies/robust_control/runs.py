"""Run folders of the study, made by the command line: the identified damper and the tuning of each level."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import mrwork as mr
from studies.robust_control.damper import LAWS, write_tests

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


def tuned(file: Path, run: Path, *, threads: int, quick: bool, resume: bool) -> mr.tuning.TuningResults:
    """The tuning of a study file, continued where it was begun if `resume`; its folder has chosen.toml and a page."""
    begun = any((folder / "journal.jsonl").is_file() for folder in (run, run.with_name(f"{run.name}.part")))
    _mrwork(
        "tune",
        str(file),
        "--out",
        str(run),
        "--threads",
        str(threads),
        *(["--resume"] if resume and begun else []),
        *(QUICK if quick else ()),
    )
    return mr.tuning.read_tuning(run)


def _mrwork(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "mrwork", *arguments], check=True, stdout=subprocess.DEVNULL)
