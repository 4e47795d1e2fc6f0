"""Numeric variables of MATLAB .mat files of version 7.3, which are HDF5."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.store.child_reader import Member, TooLargeError, UnreadableError, read_members


def hdf5_variables(data: bytes, path: Path) -> dict[str, NDArray[np.generic] | None]:
    """Variables of a version 7.3 file, or the fields of its only struct; `None` for other contents than real numbers.

    Links to other files are not followed.

    Raises
    ------
    RecordError
        The file is damaged, or claims more data than a test has.
    """
    try:
        members = read_members(data, "hdf5")
    except TooLargeError as error:
        raise RecordError(f"{path}: {error}; save one test without others") from None
    except UnreadableError as error:
        raise RecordError(
            f"{path}: not a readable version 7.3 .mat file ({error}); it is cut off or damaged, save it again"
        ) from None
    names = [name for name in members if name and "/" not in name]
    prefix = ""
    if len(names) == 1 and members[names[0]].is_group:
        prefix = f"{names[0]}/"
        names = [name.removeprefix(prefix) for name in members if name.startswith(prefix)]
    return {name: _values(members[f"{prefix}{name}"]) for name in names}


def _values(member: Member) -> NDArray[np.generic] | None:
    """An array of real numbers as MATLAB shows it; MATLAB stores columns one after the other."""
    is_text = member.attributes.get("MATLAB_class", "double") == "char"
    if member.array is None or is_text or "MATLAB_empty" in member.attributes:
        return None
    return member.array.T
