"""Figures of results by their attribute `plot`: those of `mr.plots` that take the result, as methods.

Figures know every result and load Matplotlib, so they stand above all: they are named here, and loaded when one is
asked for.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


def plots_of(result: object, name: str) -> Any:
    """The figures of a result by the name of their class in `mrwork.plots`."""
    return getattr(import_module("mrwork.plots"), name)(result)
