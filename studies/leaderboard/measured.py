"""Measured files of the leaderboard, under `MRWORK_DATA`: refused unless their SHA-256 is the listed one.

`records.sha256` has the form of `sha256sum`: in the folder of the data, `sha256sum -c records.sha256` checks it too.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from mrwork.errors import RecordError
from studies.former.records import data

HASHES = Path(__file__).parent / "records.sha256"
UTFSM = "dampers/utfsm"
MOTIONS = "records"
BENCHMARK = "benchmarks/boucwen"


def listed(folder: str) -> dict[str, str]:
    """SHA-256 by path of the listed files that lie in a folder of the data."""
    lines = (line.split(maxsplit=1) for line in HASHES.read_text(encoding="utf-8").splitlines() if line)
    return {path: digest for digest, path in lines if str(Path(path).parent) == folder}


def measured_files(folder: str) -> list[Path]:
    """The listed files of a folder, none where one of them is absent; those that are there are checked."""
    hashes = listed(folder)
    files = {data() / path: digest for path, digest in hashes.items()}
    present = {file: digest for file, digest in files.items() if file.is_file()}
    for file, digest in present.items():
        found = hashlib.sha256(file.read_bytes()).hexdigest()
        if found != digest:
            raise RecordError(
                f"{file} has the SHA-256 {found[:12]}..., {HASHES.name} lists {digest[:12]}...; "
                "obtain the file again, scores on other data cannot be compared"
            )
    return list(files) if present == files else []


def absent_sentence(folder: str) -> str:
    """What a table says where files of a folder are absent."""
    missing = [path for path in listed(folder) if not (data() / path).is_file()]
    return (
        f"No rows: {len(missing)} of {len(listed(folder))} files of {folder} are not at {data()}; "
        "see README.md for where they are obtained, and point MRWORK_DATA at the data."
    )
