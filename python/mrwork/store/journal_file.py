"""File of a journal: JSON objects, one per line, each with a checksum that detects damage.

It is apart from the journal, whose module is public and checks its arguments.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from mrwork.errors import JournalError
from mrwork.store.codec import plain
from mrwork.store.input_file import FileKind, start_of
from mrwork.store.parse import json_value

# Increased whenever names or order of the entries change, or the bits of what is computed: older journals are refused.
FORMAT = 3

JOURNAL_FILE: Final = FileKind(
    name="a journal", largest=1 << 30, remedy="move it away, and run again without --resume"
)
_START = b'{"line": '
_SUM = ', "crc32": "'
_END = '"}\n'


def line_of(entry: Mapping[str, object]) -> bytes:
    """Line of an entry; its last key is the CRC-32 of the text before it."""
    text = json.dumps(plain(entry), allow_nan=False, ensure_ascii=False)[:-1]
    return f"{text}{_SUM}{zlib.crc32(text.encode()):08x}{_END}".encode()


def is_journal(path: Path) -> bool:
    """Whether a file begins as a journal does; an empty one is one that has not begun."""
    start = start_of(path, JOURNAL_FILE, len(_START))
    return start in (_START, b"")


def read_lines(content: bytes, path: Path) -> tuple[list[dict[str, Any]], int]:
    """The entries of a journal, and the number of bytes that they occupy.

    A dead process leaves the last line incomplete, a power cut damages the last few: a damaged end is ignored; damage
    before an intact line is an error.
    """
    lines = content.split(b"\n")
    # An intact last line ends with a newline, after which `split` returns an empty item.
    lines = [line + b"\n" for line in lines[:-1]] + ([lines[-1]] if lines[-1] else [])
    entries = [_entry_of(line) for line in lines]
    sound = 0
    while sound < len(entries) and entries[sound] is not None:
        sound += 1
    if any(entry is not None for entry in entries[sound:]):
        raise JournalError(
            f"{path} is damaged in line {sound + 1}, with sound lines after it; run again without --resume"
        )
    if not sound and len(lines) > 1:
        raise JournalError(
            f"{path} is not a journal that this version can resume; run again without --resume"
        )
    kept = [entry for entry in entries[:sound] if entry is not None]
    if kept and kept[0].get("format") != FORMAT:
        raise JournalError(
            f"{path} has format {kept[0].get('format')}, this version reads {FORMAT}; run again without --resume"
        )
    for number, entry in enumerate(kept, start=1):
        if entry.get("line") != number:
            raise JournalError(
                f"{path} lacks a line before its line {number}, which says it is line {entry.get('line')}; "
                "run again without --resume"
            )
    return kept, sum(len(line) for line in lines[:sound])


def _entry_of(line: bytes) -> dict[str, Any] | None:
    """Entry of an intact line; `None` if the line is damaged."""
    try:
        text = line.decode()
    except UnicodeDecodeError:
        return None
    body, _, rest = text.rpartition(_SUM)
    if rest != f"{zlib.crc32(body.encode()):08x}{_END}":
        return None
    try:
        entry: dict[str, Any] = json_value(body + "}")
    except ValueError:
        return None
    # The checksum is no proof that this package has written the line.
    seconds = entry.get("seconds")
    sound = isinstance(seconds, int | float) and math.isfinite(seconds) and isinstance(entry.get("step"), str)
    return entry if sound else None
