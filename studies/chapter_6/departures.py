"""Comparison of the findings with expected.toml."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_EXPECTED = Path(__file__).parent / "expected.toml"


def departures(found: dict[str, Any]) -> list[str]:
    """One sentence for each value outside its limits; values that were not measured are not compared."""
    return list(compared("", found, tomllib.loads(_EXPECTED.read_text())))


def compared(path: str, found: dict[str, Any], expected: dict[str, Any]) -> Iterator[str]:
    for name, below in expected.items():
        if name not in found:
            continue
        inner = f"{path}, {name}" if path else name
        value = found[name]
        if not isinstance(below, dict):
            if value != below:
                yield f"{inner} is {value!r}, expected {below!r}"
        elif not {"least", "most", "value"} & below.keys():
            yield from compared(inner, value, below)
        elif "value" in below:
            if not abs(value - below["value"]) <= below["tolerance"]:
                yield f"{inner} is {value:.5g}, expected {below['value']:g} +- {below['tolerance']:g}"
        elif not below.get("least", -math.inf) <= value <= below.get("most", math.inf):
            yield f"{inner} is {value:.5g}, expected {below}"
