"""What the C of a damper or a controller is, for whoever wraps it: its files, and its variables by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """A variable of the C: its name is an identifier, or an entry of an array as `acceleration[0]`."""

    name: str
    unit: str
    description: str
    value: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CSource:
    """C99 of a damper or a controller, with `math.h` alone; `name` begins every C name and both files."""

    name: str
    kind: Literal["damper", "controller"]
    description: str
    files: dict[str, str]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    parameters: tuple[Signal, ...]
    n_states: int
    is_lagged: bool
    sample_time: float
    substeps: int
