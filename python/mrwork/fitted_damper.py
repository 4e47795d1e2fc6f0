"""The damper of a run of `mrwork identify`, as a study takes it.

The control of buildings does not import the identification, which reads run folders. The reader is named by `mrwork`
itself when it is imported, so nothing is imported here.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from mrwork.tested_range import FittedDamper

_readers: list[Callable[[Path], FittedDamper]] = []


def read_with(reader: Callable[[Path], FittedDamper]) -> None:
    """Name the reader of run folders."""
    _readers[:] = [reader]


def fitted_damper(run: Path) -> FittedDamper:
    """Model, parameters, draws and tested ranges from the folder of a run of `mrwork identify`."""
    return _readers[-1](run)
