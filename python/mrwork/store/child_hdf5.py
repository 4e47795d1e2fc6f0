"""What the child process of `child_reader` writes of an HDF5 file."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Iterator
from typing import IO, Any

import h5py
import numpy as np

_DEEPEST = 2
_MOST = 10_000
_LONGEST = 100_000


def answer(data: bytes, out: IO[bytes]) -> None:
    """A line of JSON with the path, shape, type and attributes of everything in the file, then the arrays."""
    with h5py.File(io.BytesIO(data), "r") as file:
        members = [("", file), *_members(file, "", 1)]
        head = {path: _described(member) for path, member in members}
        out.write(json.dumps(head).encode() + b"\n")
        out.flush()
        for path, member in members:
            if head[path]["type"] is not None:
                out.write(np.ascontiguousarray(member[()]).data)


def _members(group: Any, prefix: str, depth: int) -> Iterator[tuple[str, Any]]:
    """What a group holds itself; other files and MATLAB's own tables (`#refs#`) are not followed."""
    for number, name in enumerate(group):
        if number == _MOST:
            raise ValueError(f"more than {_MOST} entries")
        if name.startswith("#") or not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        member, path = group[name], f"{prefix}{name}"
        yield path, member
        if isinstance(member, h5py.Group) and depth < _DEEPEST:
            yield from _members(member, f"{path}/", depth + 1)


def _described(member: Any) -> dict[str, Any]:
    """Shape and type, which is null for all but real numbers that the file itself holds, and attributes."""
    is_group = isinstance(member, h5py.Group)
    is_numeric = (
        isinstance(member, h5py.Dataset)
        and member.shape is not None
        and member.dtype.kind in "iuf"
        and not member.is_virtual
        and not member.external
    )
    return {
        "group": is_group,
        "shape": member.shape if is_numeric else (),
        "type": member.dtype.str if is_numeric else None,
        "attributes": dict(_attributes(member)),
    }


def _attributes(member: Any) -> Iterator[tuple[str, Any]]:
    """Attributes that are a number or a text."""
    for name in member.attrs:
        identifier = member.attrs.get_id(name)
        if math.prod(identifier.shape or ()) != 1 or identifier.dtype.kind not in "iufSO":
            continue
        try:
            value = np.ravel(member.attrs[name])[0]
        except OSError:
            # References to what is not there.
            continue
        value = value.decode(errors="replace") if isinstance(value, bytes) else value
        value = value.item() if isinstance(value, np.generic) else value
        if isinstance(value, int | float | str) and not (isinstance(value, str) and len(value) > _LONGEST):
            yield name, value
