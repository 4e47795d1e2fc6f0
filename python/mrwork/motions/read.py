"""Read ground motions from files: the format is known by the content."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np

from mrwork.errors import RecordError
from mrwork.motions.formats.at2 import PEER_AT2, refuse_false_at2
from mrwork.motions.formats.cosmos import COSMOS
from mrwork.motions.formats.esm import ESM
from mrwork.motions.formats.format import Format, Stated, open_lines, refuse_absurd, refuse_needless
from mrwork.motions.formats.knet import K_NET
from mrwork.motions.formats.table import TABLE, read_matrix_motion
from mrwork.motions.ground_motion import GroundMotion
from mrwork.records.table import check_is_file

# Each knows its own by content; a table is what is left.
FORMATS: Final[tuple[Format, ...]] = (PEER_AT2, K_NET, COSMOS, ESM, TABLE)

_MATLAB_5: Final = b"MATLAB 5.0"


def read_motion(
    path: str | os.PathLike[str],
    *,
    unit: str | None = None,
    dt: float | None = None,
    column: str | None = None,
    channel: int | None = None,
) -> GroundMotion:
    """Read a ground motion: PEER AT2, K-NET, COSMOS, ESM, a table of text or CSV, or a .mat file.

    The options state what a file does not; what it says itself is not to be stated again.

    Parameters
    ----------
    path
        The file.
    unit
        Of the acceleration: ``"g"``, ``"m/s2"``, ``"cm/s2"``, ``"gal"``, ...; for tables whose columns do not say it.
    dt
        Step [s] of a table without a column of times.
    column
        Column of the acceleration in a table, or variable of a .mat file, where several may be it.
    channel
        Channel of a file that holds several, counted from 1.

    Returns
    -------
    GroundMotion
        In m/s^2 on one step; `changes` says what the reader had to do for that.

    Raises
    ------
    RecordError
        The file cannot be read as a ground motion; the sentence names file, line and remedy.
    UnitError
        The unit of the acceleration is not known.
    SettingError
        An option does not fit the file.

    Examples
    --------
    >>> motion = read_motion("records/el_centro_1940_ns.csv")  # doctest: +SKIP
    >>> round(motion.peak, 3)  # doctest: +SKIP
    3.417
    """
    file = Path(path)
    stated = Stated(unit=unit, dt=dt, column=column, channel=channel)
    check_is_file(file)
    try:
        # What overflows becomes infinite, and the readers refuse that.
        with np.errstate(over="ignore", invalid="ignore"):
            motion = _read(file, stated)
    except OSError as error:
        raise RecordError(f"{file}: cannot be read ({error}); check the file and its permissions") from error
    refuse_absurd(motion.acceleration, source=str(file))
    return motion


def read_motions(
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]], *, unit: str | None = None
) -> tuple[GroundMotion, ...]:
    """Read several motions: a sequence of paths in its order, or a glob pattern in name order.

    Raises
    ------
    RecordError
        No file matches the pattern, there is no path, or a file cannot be read as a ground motion.
    UnitError, SettingError
        As from `read_motion`.
    """
    if isinstance(paths, str | os.PathLike):
        pattern = os.fspath(paths)
        found = glob.glob(pattern, recursive=True)  # noqa: PTH207 - patterns may be absolute
        files = [pattern] if Path(pattern).exists() else sorted(found)
        if not files:
            raise RecordError(f"no file matches '{pattern}'; check the path and the pattern")
    else:
        files = [os.fspath(path) for path in paths]
        if not files:
            raise RecordError("no ground motion given; name at least one file")
    return tuple(read_motion(file, unit=unit) for file in files)


def _read(path: Path, stated: Stated) -> GroundMotion:
    source = str(path)
    with path.open("rb") as stream:
        head = stream.read(len(_MATLAB_5))
    if head == _MATLAB_5 or path.suffix.lower() == ".mat":
        refuse_needless(stated, TABLE.needs, source=source, kind="a .mat file")
        return read_matrix_motion(path, stated)
    lines = open_lines(path)
    form = next(candidate for candidate in FORMATS if candidate.recognises(lines))
    if form is TABLE and path.suffix.lower() == ".at2":
        refuse_false_at2(lines)
    refuse_needless(stated, form.needs, source=source, kind=form.name)
    return form.read(lines, stated)
