"""Parquet files through pyarrow, the only place that needs it."""

from __future__ import annotations

import hashlib
from pathlib import Path

from mrwork.errors import RecordError
from mrwork.records.table import Table, VectorTable


def open_parquet(path: Path, source: str) -> Table:
    """Open a .parquet file; its numeric columns are the columns.

    Raises
    ------
    RecordError
        pyarrow is not installed, or the file is damaged.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise RecordError(
            f"{source}: reading Parquet needs pyarrow; run: pip install 'mrwork[parquet]'"
        ) from error
    data = path.read_bytes()
    try:
        table = pyarrow.parquet.ParquetFile(pyarrow.BufferReader(data)).read()
        vectors = {name: table.column(name).to_numpy() for name in table.column_names}
    except (pyarrow.ArrowException, OSError, KeyError, ValueError) as error:
        first_line = str(error).partition("\n")[0]
        raise RecordError(f"{source}: not a readable Parquet file ({first_line}); write it again") from error
    return VectorTable(source=source, sha256=hashlib.sha256(data).hexdigest(), vectors=vectors)
