"""Files of named arrays (.npz) that may be damaged: sizes are counted before anything is allocated."""

from __future__ import annotations

import io
import math
import warnings
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError, reason_of
from mrwork.escaping import escaped
from mrwork.store.input_file import FileKind, bytes_of

# The last character of Unicode; Python makes a broken text of larger numbers.
_LAST: Final = 0x10FFFF
# Bytes of all arrays.
_LARGEST: Final = 256 << 20


def read_arrays(path: Path, kind: FileKind) -> dict[str, NDArray[Any]]:
    """The arrays of a file by name."""
    data = bytes_of(path, kind)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            if sum(each.file_size for each in members) > max(_LARGEST, len(data)):
                raise ValueError("it claims more numbers than such a file has")
            return {each.filename.removesuffix(".npy"): _array(archive.read(each)) for each in members}
    except Exception as reason:  # the libraries raise whatever a damaged file leads them to
        raise RecordError(escaped(f"{path} is damaged ({reason_of(reason)}); {kind.remedy}")) from None


def finite_numbers(arrays: Mapping[str, NDArray[Any]], name: str) -> NDArray[np.float64]:
    """One of the arrays of a file, of floating-point numbers."""
    if name not in arrays:
        raise ValueError(f"it has no {name}")
    found = arrays[name]
    # Half precision is written by no program of this package, and extended precision has invalid numbers.
    if found.dtype.kind != "f" or found.dtype.itemsize not in (4, 8):
        raise ValueError(f"{name} has other values than floating-point numbers")
    if not np.isfinite(found).all():
        raise ValueError(f"{name} has a number that is not finite")
    return found.astype(np.float64)


def _array(data: bytes) -> NDArray[Any]:
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    read_header = (
        np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    )
    with warnings.catch_warnings():
        # A header that Python warns of has been written by other means.
        warnings.simplefilter("error")
        shape, by_columns, dtype = read_header(stream)
    if dtype.hasobject or math.prod(shape) * dtype.itemsize != len(data) - stream.tell():
        raise ValueError(f"an array claims the shape {shape}")
    items = np.frombuffer(data, dtype=dtype, offset=stream.tell())
    if (
        dtype.kind == "U"
        and np.frombuffer(data, f"{dtype.str[0]}u4", offset=stream.tell()).max(initial=0) > _LAST
    ):
        raise ValueError("a text has characters that do not exist")
    return items.reshape(shape, order="F" if by_columns else "C")
