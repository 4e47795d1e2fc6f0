"""Open a file of any format as named columns."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from mrwork.errors import RecordError
from mrwork.records.formats.delimited import open_delimited
from mrwork.records.formats.matlab import open_matlab
from mrwork.records.formats.tdms import open_tdms
from mrwork.records.formats.workbook import open_workbook
from mrwork.records.table import ColumnTable, open_parquet
from mrwork.store.input_file import RECORD, check_file

TEXT_EXTENSIONS: Final = (".csv", ".tsv", ".txt", ".dat", ".asc", ".lvm")
EXTENSIONS: Final = (*TEXT_EXTENSIONS, ".mat", ".tdms", ".xlsx", ".parquet", ".pq")
"""Extensions of the files that can hold a test."""


def open_table(path: Path) -> ColumnTable:
    """Open a text, .mat, .tdms, .xlsx or Parquet file as named columns.

    Raises
    ------
    RecordError
        The path is missing, a directory, of an unknown extension, unreadable, or its content is refused.
    """
    extension = path.suffix.lower()
    check_file(path, RECORD)
    if extension in TEXT_EXTENSIONS:
        return open_delimited(path)
    if extension == ".mat":
        return open_matlab(path)
    if extension == ".tdms":
        return open_tdms(path)
    if extension == ".xlsx":
        return open_workbook(path)
    if extension in (".parquet", ".pq"):
        return open_parquet(path)
    came = f"the extension is '{extension}'" if extension else "there is no extension"
    raise RecordError(
        f"{path}: {came} where one of {', '.join(EXTENSIONS)} was expected; export the record as one of these"
    )
