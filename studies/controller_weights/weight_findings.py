"""Every finding of the study, and its comparison with expected.toml."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from weight_designs import extensions, inverses, sizes, unreachable
from weight_loop import LEVELS, scanned

_EXPECTED = Path(__file__).parent / "expected.toml"


def found_by(*, quick: bool, records: Path, threads: int, say: Callable[[str], None]) -> dict[str, Any]:
    """Every figure, as nested dictionaries; the true loop where the records are at hand."""
    say("program and Riccati equations")
    found: dict[str, Any] = {"sizes": dict(sizes(quick=quick))}
    say("extensions")
    found["extensions"] = dict(extensions(quick=quick))
    say("inverse")
    found["inverses"] = dict(inverses(quick=quick))
    found["unreachable"] = unreachable()
    if records.is_dir():
        # The quick form scans less, under one record: its scores are others.
        loop = found["quick_loop" if quick else "true_loop"] = {}
        for level in LEVELS[:1] if quick else LEVELS:
            say(f"true loop, {level:g} g")
            loop[f"{level:g}"] = scanned(level, records, quick=quick, threads=threads)
    return found


def departures(found: dict[str, Any]) -> list[str]:
    """One sentence for each value outside the limits of expected.toml; what was not measured is not compared."""
    return list(_departures("", found, tomllib.loads(_EXPECTED.read_text())))


def _departures(path: str, found: dict[str, Any], expected: dict[str, Any]) -> Iterator[str]:
    for name, below in expected.items():
        if name not in found:
            continue
        inner = f"{path}, {name}".strip(", ")
        if not {"least", "most"} & below.keys():
            yield from _departures(inner, found[name], below)
        elif not below.get("least", -math.inf) <= found[name] <= below.get("most", math.inf):
            yield f"{inner} is {found[name]:.5g}, expected {below}"
