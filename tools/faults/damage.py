"""Every way in which a value of a file, or a file of a run, is made wrong: of JSON, journals, archives and folders."""

from __future__ import annotations

import copy
import json
import os
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mrwork.store.journal import line_of

TWICE = "stands twice"
WRONG: tuple[Any, ...] = (
    *(None, "", "text", "\x1b[31m\n", -1, 0, 1.5, 1e300, -1e300, 10**80, True, [], {}, [[]], {"a": [None]}),
)
# What stands in the place of a file's content.
CONTENTS: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda content: b"",
    "cut": lambda content: content[: len(content) // 2],
    "no UTF-8": lambda content: b'{"kind": "\xff"}',
    "nested": lambda content: b'{"a":' + b"[" * 100_000,
    "a list": lambda content: b"[1, 2]",
    "numbers": lambda content: content.replace(b"0.", b"1" + b"0" * 330 + b"."),
    "null": lambda content: content.replace(b"0", b"null"),
    "renamed": lambda content: content.replace(b'"k', b'"q').replace(b'"n', b'"m'),
}
# What stands in the place of a file.
KINDS: dict[str, Callable[[Path], None]] = {
    "removed": lambda path: None,
    "a folder": Path.mkdir,
    "a pipe": os.mkfifo,
    "a loop": lambda path: path.symlink_to(path),
}


class Place(NamedTuple):
    """A place in a JSON value: its path in words, its container and its key there."""

    where: str
    container: Any
    key: Any


def places(tree: Any) -> list[Place]:
    """Every place in a JSON value, containers before what they contain."""
    listed: list[Place] = []
    waiting = [("", tree)]
    while waiting:
        where, here = waiting.pop()
        keys = list(here) if isinstance(here, dict) else range(len(here)) if isinstance(here, list) else ()
        for key in keys:
            listed.append(Place(f"{where}.{key}", here, key))
            if isinstance(here[key], dict | list):
                waiting.append((f"{where}.{key}", here[key]))
    return listed


def _changed(document: Any, number: int, change: str, wrong: Any) -> str:
    """The text of a document with the value at a place changed."""
    made = copy.deepcopy(document)
    _, container, key = places(made)[number]
    if change == "is":
        container[key] = wrong
    elif change == "removed":
        del container[key]
    elif change == "renamed":
        container[f"{key}_"] = container.pop(key)
    elif isinstance(key, int):
        container.insert(key, copy.deepcopy(container[key]))
    else:
        container[TWICE] = container[key]
    return json.dumps(made).replace(json.dumps(TWICE), json.dumps(key))


def json_mutants(text: str) -> list[tuple[str, Callable[[], str]]]:
    """What is done to a JSON document, and what makes its text: each value is replaced, removed, doubled, renamed."""
    document = json.loads(text)
    made: list[tuple[str, Callable[[], str]]] = [
        (f"all is {wrong!r}", partial(json.dumps, wrong)) for wrong in WRONG
    ]
    for number, place in enumerate(places(document)):
        made += [
            (f"{place.where} is {wrong!r}", partial(_changed, document, number, "is", wrong))
            for wrong in WRONG
        ]
        made += [
            (f"{place.where} {change}", partial(_changed, document, number, change, None))
            for change in ("removed", "twice", *(("renamed",) if isinstance(place.key, str) else ()))
        ]
    return made


def journal_mutants(content: bytes) -> list[tuple[str, Callable[[], bytes]]]:
    """What is done to a journal, and what makes it: each mutant has the checksum of what it says."""
    lines = content.splitlines()

    def forged(number: int, text: Callable[[], str]) -> bytes:
        made = json.loads(text())
        line = line_of(made).rstrip() if isinstance(made, dict) else text().encode()
        return b"\n".join([*lines[:number], line, *lines[number + 1 :]]) + b"\n"

    entries = [json.loads(line) for line in lines]
    for entry in entries:
        del entry["crc32"]
    return [
        (f"line {number + 1}: {what}", partial(forged, number, text))
        for number, entry in enumerate(entries)
        for what, text in json_mutants(json.dumps(entry))
    ]


def array_mutants(arrays: dict[str, np.ndarray], facts: str) -> list[tuple[str, dict[str, Any]]]:
    """What is done to the arrays of an archive, and what is then in it; `facts` is the array whose text is JSON."""
    made: list[tuple[str, dict[str, Any]]] = [
        (f"{facts} {what}", {**arrays, facts: np.array(text())})
        for what, text in json_mutants(str(arrays[facts]))
    ]
    for name, values in arrays.items():
        made.append((f"{name} removed", {key: array for key, array in arrays.items() if key != name}))
        if name == facts:
            continue
        for what, wrong in (
            ("cut", values[:-1]),
            ("empty", values[:0]),
            ("of two rows", np.stack([values, values])),
            ("a number", values[0]),
            ("nan", np.full_like(values, np.nan)),
            ("inf", np.full_like(values, np.inf)),
            ("huge", np.full(values.shape, 1e300)),
            ("zero", np.zeros_like(values)),
            ("complex", values.astype(complex)),
            ("text", np.full(values.shape, "x")),
        ):
            made.append((f"{name} {what}", {**arrays, name: wrong}))
    return made


def _damage(name: str, what: str, place: Path) -> None:
    """Put what is wrong in the place of a file of a folder."""
    path = place / name
    content = path.read_bytes() if path.is_file() else b""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
    if what in KINDS:
        KINDS[what](path)
    else:
        path.write_bytes(CONTENTS[what](content))


def damages(run: Path) -> list[tuple[str, Callable[[Path], None]]]:
    """Ways in which a run folder can be half removed or damaged, each with its name."""
    return [
        (f"{path.name} {what}", partial(_damage, path.name, what))
        for path in sorted(run.iterdir())
        if path.name != "report.html"
        for what in (*CONTENTS, *KINDS)
    ]
