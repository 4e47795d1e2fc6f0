"""The damper of a run of `mrwork identify`, as a study takes it: a `FittedDamper` of `tested_range`.

The control of buildings does not import the identification, which reads run folders. The reader is named by `mrwork`
itself when it is imported, so nothing is imported here.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from typing import Any

_readers: list[Callable[[Path], Any]] = []


def register_reader(reader: Callable[[Path], Any]) -> None:
    """Name the reader of run folders."""
    _readers[:] = [reader]


def fitted_damper(run: Path) -> Any:
    """The `FittedDamper` in the folder of a run of `mrwork identify`."""
    return _readers[-1](run)
