"""The damper of a run of `mrwork identify`, as a study takes it: a `FittedDamper` of `tested_range`.

The control of buildings does not import the identification, which reads run folders: the reader is named here, and
loaded when a study names a run.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any


def fitted_damper(run: Path) -> Any:
    """The `FittedDamper` in the folder of a run of `mrwork identify`."""
    return import_module("mrwork.stored").fitted_damper(run)
