"""Numeric variables of MATLAB .mat files of version 7.3, which are HDF5."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError

if TYPE_CHECKING:
    import h5py

# Bytes of all variables; a compressed one may claim any size.
_LARGEST: Final = 1 << 30


def hdf5_variables(data: bytes, path: Path) -> dict[str, NDArray[np.generic] | None]:
    """Variables of a version 7.3 file, or the fields of its only struct; `None` for other contents than real numbers.

    Links to other files are not followed.

    Raises
    ------
    RecordError
        The file is damaged, or claims more data than a test has.
    """
    # HDF5 takes a moment to load, and other formats do not need it.
    import h5py

    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            members = _members(file)
            if len(members) == 1:
                (only,) = members.values()
                if isinstance(only, h5py.Group):
                    members = _members(only)
            return _read(members, path)
    except RecordError:
        raise
    except Exception as error:  # the library raises whatever a damaged file leads it to
        first_line = str(error).partition("\n")[0]
        raise RecordError(
            f"{path}: not a readable version 7.3 .mat file ({first_line}); it is cut off or damaged, save it again"
        ) from error


def _members(group: h5py.Group) -> dict[str, h5py.Dataset | h5py.Group]:
    """What a group holds itself, without MATLAB's own tables."""
    import h5py

    return {
        name: group[name]
        for name in group
        if not name.startswith("#") and isinstance(group.get(name, getlink=True), h5py.HardLink)
    }


def _read(members: dict[str, h5py.Dataset | h5py.Group], path: Path) -> dict[str, NDArray[np.generic] | None]:
    variables: dict[str, NDArray[np.generic] | None] = {}
    left = _LARGEST
    for name, member in members.items():
        variables[name] = None
        if not _is_numeric(member):
            continue
        left -= member.size * max(member.dtype.itemsize, 8)
        if left < 0:
            raise RecordError(
                f"{path}: the variables up to '{name}' claim more than {_LARGEST >> 30} GiB; "
                "save one test without others"
            )
        # MATLAB stores columns one after the other.
        variables[name] = np.asarray(member[()]).T
    return variables


def _is_numeric(member: h5py.Dataset | h5py.Group) -> bool:
    """Whether a member is an array of real numbers that the file itself holds."""
    import h5py

    return (
        isinstance(member, h5py.Dataset)
        and member.dtype.kind in "iuf"
        and member.shape is not None
        and "MATLAB_empty" not in member.attrs
        and member.attrs.get("MATLAB_class", b"double") != b"char"
        and not member.is_virtual
        and not member.external
    )
