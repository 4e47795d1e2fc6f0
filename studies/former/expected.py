"""Figures of a study beside those that its file expects."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from mrwork.errors import RecordError


def departures(found: Mapping[str, Any], file: Path) -> list[str]:
    """One sentence for each value outside its limits; values that were not measured are not compared.

    The file has tables like those of `found`; a value is expected to be equal, or in a range `{ least, most }`, or at a
    `{ value, tolerance }`.
    """
    try:
        expected = tomllib.loads(file.read_text(encoding="utf-8"))
    except ValueError as reason:
        raise RecordError(f"{file}: is not TOML ({reason}); correct it there") from None
    try:
        return list(_compared("", found, expected))
    except (KeyError, TypeError, AttributeError) as reason:
        raise RecordError(
            f"{file}: an entry is neither a value, a range nor a table ({reason}); correct it there"
        ) from None


def _compared(path: str, found: Mapping[str, Any], expected: Mapping[str, Any]) -> Iterator[str]:
    for name, below in expected.items():
        if name not in found:
            continue
        inner = f"{path}, {name}" if path else name
        value = found[name]
        if not isinstance(below, dict):
            if value != below:
                yield f"{inner} is {value!r}, expected {below!r}"
        elif not {"least", "most", "value"} & below.keys():
            yield from _compared(inner, value, below)
        elif "value" in below:
            if not abs(value - below["value"]) <= below["tolerance"]:
                yield f"{inner} is {value:.5g}, expected {below['value']:g} +- {below['tolerance']:g}"
        elif not below.get("least", -math.inf) <= value <= below.get("most", math.inf):
            yield f"{inner} is {value:.5g}, expected {below}"
