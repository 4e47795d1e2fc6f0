"""Every reader of the package, with whole files of all its formats."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import motion_files
import record_files

from fuzzing.reader import Reader, Seed
from mrwork.motions import read_motion
from mrwork.records import read_damper_test

# Few samples: a reader that is fast is tried more often.
N_TIME = 60


def made(file: str, structure: str, write: Callable[[Path], object]) -> Seed:
    """The seed of what `write` writes to a path."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / file
        write(path)
        return Seed(file=file, content=path.read_bytes(), structure=structure)


def all_readers() -> list[Reader]:
    columns = {name: column[:N_TIME] for name, column in record_files.clean_columns().items()}
    text = [
        made(f"rig{suffix}", "text", lambda path, d=d: record_files.write_text(path, columns, d))
        for suffix, d in ((".csv", ","), (".tsv", "\t"), (".txt", ";"))
    ]
    in_g = motion_files.accelerations()[:N_TIME] / 9.80665
    at2 = made(
        "motion.at2",
        "text",
        lambda path: motion_files.write_lines(
            path, motion_files.at2_lines(in_g, f"NPTS= {N_TIME}, DT= .0100 SEC")
        ),
    )
    return [
        Reader(name="records of text", read=read_damper_test, seeds=tuple(text)),
        Reader(name="motions", read=read_motion, seeds=(at2,)),
    ]
