"""Studies of laws at levels of the motions: their options, and the file of all that they find."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from studies.common.command import Command


def levels_command(
    file: str, about: str | None, levels: Iterable[str], *, quick: str, clairvoyants: int, resume: str
) -> Command:
    """The command of a study with a file for each level, and a clairvoyant under some of its test motions."""
    command = Command(file, about, quick=quick, threads=True)
    add = command.parser.add_argument
    add("--level", action="append", choices=list(levels), help="one level of the motions; repeat for more")
    meaning = "test motions with a clairvoyant, minutes each; 0 for none"
    add("--clairvoyants", type=int, default=clairvoyants, help=meaning)
    add("--resume", action="store_true", help=resume)
    return command


def write_numbers(path: Path, numbers: Mapping[str, Any]) -> None:
    """Write all numbers that were found as JSON."""
    path.write_text(json.dumps(numbers, indent=1), encoding="utf-8")
