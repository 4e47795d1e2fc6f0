"""Labelled arrays as netCDF 4, which xarray, MATLAB, Julia and `ncdump` open; h5py alone writes and reads them."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.base.labelled import NamedArray, NamedArrays
from mrwork.store.input_file import Allowance


def netcdf_of(groups: Mapping[str, NamedArrays], *, checksums: bool = False) -> bytes:
    """The content of a file with these groups, each complete with its axes; the name "" stands for the root.

    Arrays over an axis without labels are left out, and so is the axis. Reading compares `checksums`. Dimensions are
    HDF5 scales, as the netCDF-4 format has them.
    """
    import h5py

    with h5py.File("memory", "w", driver="core", backing_store=False, track_order=True) as file:
        numbers = count()
        for name, arrays in groups.items():
            group = file.create_group(name, track_order=True) if name else file
            group.attrs["title"] = arrays.title
            scales: dict[str, Any] = {}
            for axis, label in arrays.labels.items():
                if label.values.size:
                    scales[axis] = _write(group, axis, label, checksums=checksums)
                    scales[axis].make_scale(axis)
                    scales[axis].attrs["_Netcdf4Dimid"] = np.int32(next(numbers))
            for array_name, array in arrays.arrays.items():
                if scales.keys() >= set(array.axes):
                    made = _write(group, array_name, array, checksums=checksums)
                    for number, axis in enumerate(array.axes):
                        made.dims[number].attach_scale(scales[axis])
        file.flush()
        return bytes(file.id.get_file_image())


def _write(group: Any, name: str, array: NamedArray, *, checksums: bool) -> Any:
    import h5py

    values: Any = array.values
    if values.dtype.kind in "UO":
        made = group.create_dataset(
            name, data=values.astype(object), dtype=h5py.string_dtype(), track_order=True
        )
    else:
        block: Any = {"fletcher32": True, "chunks": values.shape} if checksums else {}
        made = group.create_dataset(name, data=values, track_order=True, **block)
        if values.dtype.kind == "f":
            made.attrs["_FillValue"] = np.array([np.nan], dtype=values.dtype)
    made.attrs.update(array.attributes)
    return made


def read_netcdf(file: Path | bytes, path: Path) -> dict[str, NamedArrays]:
    """The groups of the file at `path` as `netcdf_of` has written them; h5py raises errors on other contents."""
    import h5py

    size = len(file) if isinstance(file, bytes) else file.stat().st_size
    allowance = Allowance(path, size)
    with h5py.File(io.BytesIO(file) if isinstance(file, bytes) else file, "r") as opened:
        children = {name: member for name, member in opened.items() if isinstance(member, h5py.Group)}
        return {name: _read(group, allowance) for name, group in {"": opened, **children}.items()}


def _read(group: Any, allowance: Allowance) -> NamedArrays:
    import h5py

    labels, arrays = dict[str, NamedArray](), dict[str, NamedArray]()
    for name, member in group.items():
        if isinstance(member, h5py.Dataset):
            allowance.take(math.prod(member.shape) * max(member.dtype.itemsize, 8), f"'{name}'")
            is_text = h5py.check_string_dtype(member.dtype) is not None
            values = member.asstr()[...].astype(str) if is_text else member[...]
            axes = tuple(dimension[0].name.rpartition("/")[2] for dimension in member.dims if len(dimension))
            unit, words = (str(member.attrs.get(key, "")) for key in ("units", "long_name"))
            array = NamedArray(values=values, axes=axes, unit=unit, long_name=words)
            (labels if member.attrs.get("CLASS") == b"DIMENSION_SCALE" else arrays)[name] = array
    return NamedArrays(title=str(group.attrs.get("title", "")), rows=(), labels=labels, arrays=arrays)
