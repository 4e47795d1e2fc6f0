"""Read ground motions from files; the format is recognised by the content."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np

from mrwork.arguments import checked
from mrwork.errors import RecordError
from mrwork.files.delimited import read_text_bytes
from mrwork.files.named_columns import listed_files
from mrwork.motions.formats.format import Format, Stated, lines_of, refuse_absurd, refuse_needless
from mrwork.motions.formats.networks import COSMOS, ESM, K_NET, PEER_AT2, refuse_false_at2
from mrwork.motions.formats.table import TABLE, read_matrix_motion, read_regular_motion
from mrwork.motions.ground_motion import GroundMotion
from mrwork.store.input_file import RECORD, is_file, is_folder, start_of

# Each format recognises its content; a table is the fallback and comes last.
FORMATS: Final[tuple[Format, ...]] = (PEER_AT2, K_NET, COSMOS, ESM, TABLE)

# Files of a folder that are no records.
_DOCUMENTS: Final = frozenset({".md", ".pdf", ".html", ".json", ".toml", ".py", ".zip"})
_MATLAB_5: Final = b"MATLAB 5.0"


@checked
def read_motion(
    path: str | os.PathLike[str],
    *,
    unit: str | None = None,
    dt: float | None = None,
    column: str | None = None,
    channel: int | None = None,
) -> GroundMotion:
    """Read a ground motion: PEER AT2, K-NET, COSMOS, ESM, a table of text or CSV, or a .mat file.

    The options supply what a file does not state; an option that repeats what the file states is refused.

    Parameters
    ----------
    path
        The file.
    unit
        Unit of the acceleration, for tables whose column names do not state it: ``"g"``, ``"m/s2"``, ``"cm/s2"``,
        ``"gal"``, ...
    dt
        Sampling step [s] of a table without a column of times.
    column
        Column of the acceleration in a table, or variable of a .mat file, if there are several candidates.
    channel
        Channel of a file with several channels, counted from 1.

    Returns
    -------
    GroundMotion
        Motion in m/s^2 on a uniform step; `changes` lists what the reader had to do.

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
    # Overflowing values become infinite, and the readers refuse them.
    with np.errstate(over="ignore", invalid="ignore"):
        motion = _read(file, stated)
    refuse_absurd(motion.acceleration, source=str(file))
    return motion


@checked
def read_motions(
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]], *, unit: str | None = None
) -> tuple[GroundMotion, ...]:
    """Read several motions: a sequence of paths in its order, or a folder or glob pattern in name order.

    Raises
    ------
    RecordError
        No file matches the pattern, the folder has no files, there is no path, or a file cannot be read as a ground
        motion.
    UnitError, SettingError
        As from `read_motion`.
    """
    return tuple(read_motion(file, unit=unit) for file in motion_files(paths))


def motion_files(paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]]) -> tuple[Path, ...]:
    """Files of motions: a sequence of paths in its order, the files of a folder, or those that match a pattern.

    Of a folder, hidden files and documents such as README.md are left out, and folders in it are not entered.
    """
    if isinstance(paths, str | os.PathLike) and is_folder(Path(paths)):
        found = [path for path in sorted(Path(paths).iterdir()) if is_file(path) and not _is_document(path)]
        if not found:
            raise RecordError(f"{paths}: the folder has no file of a ground motion; check the path")
        return tuple(found)
    files = listed_files(paths, none="no ground motion given; name at least one file")
    return tuple(Path(file) for file in files if len(files) == 1 or not is_folder(file))


def _is_document(path: Path) -> bool:
    return (
        path.name.startswith(".")
        or path.suffix.lower() in _DOCUMENTS
        or path.stem.casefold() in ("readme", "license", "licence")
    )


def _read(path: Path, stated: Stated) -> GroundMotion:
    source = str(path)
    head = start_of(path, RECORD, len(_MATLAB_5))
    if head == _MATLAB_5 or path.suffix.lower() == ".mat":
        refuse_needless(stated, TABLE.needs, source=source, kind="a .mat file")
        return read_matrix_motion(path, stated)
    data = read_text_bytes(path)
    motion = read_regular_motion(data, stated, path, [form for form in FORMATS if form is not TABLE])
    if motion is not None:
        return motion
    lines = lines_of(data, path)
    form = next(candidate for candidate in FORMATS if candidate.recognises(lines))
    if form is TABLE and path.suffix.lower() == ".at2":
        refuse_false_at2(lines)
    refuse_needless(stated, form.needs, source=source, kind=form.name)
    return form.read(lines, stated)
