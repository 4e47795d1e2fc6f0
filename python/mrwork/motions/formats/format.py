"""What a format of strong-motion records is to its readers' list."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError, SettingError
from mrwork.motions.formats.lines import Lines
from mrwork.motions.ground_motion import GroundMotion

# The strongest accelerograms reach 4.4 g; what is far beyond was read in the wrong unit.
_LARGEST = 200.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """What the caller states because the file does not.

    `unit` of the acceleration; `dt` [s] where there is no column of times; `column` of the acceleration in a table or
    its variable in a .mat file; `channel`, counted from 1, of a file that holds several.
    """

    unit: str | None = None
    dt: float | None = None
    column: str | None = None
    channel: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A text format: how it is known by its content, how it is read, and which of `Stated` it needs."""

    name: str
    recognises: Callable[[Lines], bool]
    read: Callable[[Lines, Stated], GroundMotion]
    needs: frozenset[str] = frozenset()


def refuse_needless(stated: Stated, needs: frozenset[str], *, source: str, kind: str) -> None:
    """Refuse a statement about what the file itself says, rather than pass over it.

    Raises
    ------
    SettingError
        Names the first option that the format does not take.
    """
    for field in fields(stated):
        if getattr(stated, field.name) is not None and field.name not in needs:
            raise SettingError(f"{source}: {kind} takes no `{field.name}`; leave it out")


def recorded(
    path: Path,
    *,
    dt: float,
    acceleration: NDArray[np.float64],
    source: str,
    name: str | None = None,
    changes: tuple[str, ...] = (),
) -> GroundMotion:
    """Motion of a file, by default of its name; `source` gets the file's name as well.

    Raises
    ------
    RecordError
        The record has fewer than two samples, or no finite step or sample.
    """
    if acceleration.size < 2:
        raise RecordError(
            f"{path}: the record has too few samples ({acceleration.size}); it needs two or more"
        )
    if not (0.0 < dt < np.inf):
        raise RecordError(f"{path}: the step between samples is {dt:g} s; a record needs a positive one")
    refuse_absurd(acceleration, source=str(path))
    return GroundMotion(
        name=path.stem if name is None else name,
        dt=dt,
        acceleration=acceleration,
        source=f"{source} ({path.name})",
        changes=changes,
    )


def refuse_absurd(acceleration: NDArray[np.float64], *, source: str) -> None:
    """Refuse accelerations [m/s^2] beyond any earthquake's.

    Raises
    ------
    RecordError
        The peak is above 20 g.
    """
    peak = float(np.abs(acceleration).max(initial=0.0))
    if not peak <= _LARGEST:
        raise RecordError(
            f"{source}: a peak of {peak:.4g} m/s2 is beyond any earthquake; check the unit of the acceleration"
        )
