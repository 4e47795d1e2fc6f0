"""Open a file of any format as named columns."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

from mrwork.errors import RecordError
from mrwork.files.delimited import open_delimited
from mrwork.files.matlab import open_matlab
from mrwork.files.named_columns import ColumnTable, open_parquet
from mrwork.files.tdms import open_tdms
from mrwork.files.workbook import open_workbook
from mrwork.store.input_file import RECORD, check_file

TEXT_EXTENSIONS: Final = (".csv", ".tsv", ".txt", ".dat", ".asc", ".lvm")
EXTENSIONS: Final = (*TEXT_EXTENSIONS, ".mat", ".tdms", ".xlsx", ".parquet", ".pq")
"""Extensions of the files that can hold a test."""


def open_table(path: Path, is_record: Callable[[ColumnTable], bool]) -> ColumnTable:
    """Open a .mat, .tdms, .xlsx, Parquet or text file as columns; of several sheets, the first that `is_record`."""
    extension = path.suffix.lower()
    check_file(path, RECORD)
    if extension in TEXT_EXTENSIONS:
        return open_delimited(path)
    if extension == ".mat":
        return open_matlab(path)
    if extension == ".tdms":
        return open_tdms(path)
    if extension == ".xlsx":
        return open_workbook(path, is_record)
    if extension in (".parquet", ".pq"):
        return open_parquet(path)
    came = f"the extension is '{extension}'" if extension else "there is no extension"
    raise RecordError(
        f"{path}: {came} where one of {', '.join(EXTENSIONS)} was expected; export the record as one of these"
    )
