"""What the child process of `child_reader` writes of a Parquet file."""

from __future__ import annotations

import json
from typing import IO

import numpy as np
import pyarrow
from pyarrow import parquet


def answer(data: bytes, out: IO[bytes]) -> None:
    """A line of JSON with the columns, then those of numbers as float64, each read by itself."""
    file = parquet.ParquetFile(pyarrow.BufferReader(data))
    n_rows = file.metadata.num_rows
    numeric = {
        field.name: pyarrow.types.is_integer(field.type) or pyarrow.types.is_floating(field.type)
        for field in file.schema_arrow
    }
    head: dict[str, object] = {
        name: {"group": False, "shape": [n_rows], "type": "<f8" if known else None, "attributes": {}}
        for name, known in numeric.items()
    }
    out.write(json.dumps(head).encode() + b"\n")
    out.flush()
    for name, known in numeric.items():
        if known:
            # A single thread: the others would count towards the limit of memory.
            column = file.read(columns=[name], use_threads=False).column(name)
            if len(column) != n_rows:
                raise ValueError(f"column '{name}' has {len(column)} rows of {n_rows}")
            out.write(np.ascontiguousarray(column.to_numpy(), dtype="<f8").data)
