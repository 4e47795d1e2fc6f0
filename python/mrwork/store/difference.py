"""What two records of facts do not agree in, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_ABSENT = "absent"
_LONGEST = 40


def differences(recorded: Any, stated: Any, name: str = "") -> list[str]:
    """One phrase for each fact that differs, as in "seed is 1 there and 2 here"; nested names have dots."""
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
