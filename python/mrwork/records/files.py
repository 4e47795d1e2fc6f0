"""From a path to a table: what the path must be, and which reader its extension means."""

from __future__ import annotations

from pathlib import Path

from mrwork.errors import RecordError
from mrwork.records.formats.delimited import open_delimited
from mrwork.records.table import Table


def open_table(path: Path) -> Table:
    """Open a CSV, TSV, Parquet or .mat file as named columns.

    Raises
    ------
    RecordError
        The path is missing, a directory, of an unknown extension, unreadable, or its content is refused.
    """
    source = str(path)
    extension = path.suffix.lower()
    try:
        check_is_file(path)
        if extension in (".csv", ".tsv"):
            return open_delimited(path, source)
        if extension == ".mat":
            # scipy.io is only worth its import time when there is a .mat file.
            from mrwork.records.formats.matlab import open_matlab

            return open_matlab(path, source)
        if extension in (".parquet", ".pq"):
            from mrwork.records.formats.parquet import open_parquet

            return open_parquet(path, source)
    except OSError as error:
        raise RecordError(
            f"{source}: cannot be read ({error}); check the file and its permissions"
        ) from error
    came = f"the extension is '{extension}'" if extension else "there is no extension"
    raise RecordError(
        f"{source}: {came} where .csv, .tsv, .parquet or .mat was expected; export the record as one of these"
    )


def check_is_file(path: Path) -> None:
    """Refuse what is no ordinary file.

    Raises
    ------
    RecordError
        The path is missing, a directory or a device.
    """
    if path.is_dir():
        raise RecordError(f"{path}: is a directory; name the record files in it, such as {path}/*.csv")
    if not path.exists():
        raise RecordError(f"{path}: there is no such file; check the path")
    if not path.is_file():
        raise RecordError(f"{path}: is not an ordinary file; name a record file")
