"""Fingerprints of the inputs of a run: digests, versions of packages, and the differences between two fingerprints."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

# Half of a SHA-256: two different inputs have the same digest with a probability of 1e-38.
_LENGTH = 32
_ABSENT = "absent"
_LONGEST = 40


def digest_of(*inputs: object) -> str:
    """Digest of values: of an array by its bytes, of others by their `repr`, which states every bit of a number."""
    digest = hashlib.sha256()
    for value in inputs:
        if isinstance(value, np.ndarray):
            digest.update(f"{value.dtype.str}{value.shape}".encode())
            digest.update(np.ascontiguousarray(value).tobytes())
        else:
            digest.update(repr(value).encode())
        digest.update(b"\0")
    return digest.hexdigest()[:_LENGTH]


def package_version(name: str) -> str:
    """Version of an installed package; "unknown" if it is not installed."""
    return _installed().get(name) or _described(name)


@cache
def _installed() -> Mapping[str, str]:
    """Versions of the installed packages, from the names of their `dist-info` folders.

    `importlib.metadata` parses whole package descriptions instead, a tenth of a second for five packages.
    """
    found: dict[str, str] = {}
    for folder in sys.path:
        for path in Path(folder).glob("*-*.dist-info"):
            name, _, version = path.stem.partition("-")
            found.setdefault(name, version)
    return found


def _described(name: str) -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"


def differences(recorded: Any, stated: Any, name: str = "") -> list[str]:
    """One phrase for each fact that differs, such as "seed is 1 there and 2 here"; nested names are joined by dots."""
    if isinstance(recorded, Mapping) and isinstance(stated, Mapping):
        names = [*recorded, *(key for key in stated if key not in recorded)]
        pairs = [(key, recorded.get(key, _ABSENT), stated.get(key, _ABSENT)) for key in names]
    elif isinstance(recorded, list) and isinstance(stated, list) and len(recorded) == len(stated):
        pairs = [(str(n), one, other) for n, (one, other) in enumerate(zip(recorded, stated, strict=True), 1)]
    else:
        return [] if recorded == stated else [f"{name} is {_shown(recorded)} there and {_shown(stated)} here"]
    return [
        phrase
        for key, one, other in pairs
        for phrase in differences(one, other, f"{name}.{key}" if name else key)
    ]


def _shown(value: Any) -> str:
    text = "none" if value is None else str(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"
