"""What the child process of `child_reader` writes of an .xlsx workbook."""

from __future__ import annotations

import datetime
import io
import json
import zipfile
from typing import IO, Any

import python_calamine

_WORKBOOK = "xl/workbook.xml"
_MOST_SHEETS = 100
# Bytes of the words as which a text is written.
_WORD = 8
# Ends of lines and separators, within a cell.
_BLANKS = str.maketrans(
    dict.fromkeys("\t\n\v\f\r\x1c\x1d\x1e\x85\u2028\u2029", " ") | {"#": "\N{FULLWIDTH NUMBER SIGN}"}
)


def answer(data: bytes, out: IO[bytes]) -> None:
    """A line of JSON with the sheets, then each as UTF-8 text: a line for each row, with tabs between the cells."""
    if _WORKBOOK not in zipfile.ZipFile(io.BytesIO(data)).namelist():
        raise ValueError("it holds no workbook")
    book = python_calamine.CalamineWorkbook.from_filelike(io.BytesIO(data))
    tables = [
        each.name for each in book.sheets_metadata if each.typ == python_calamine.SheetTypeEnum.WorkSheet
    ]
    if len(tables) > _MOST_SHEETS:
        raise ValueError(f"more than {_MOST_SHEETS} sheets")
    texts = [_text(book.get_sheet_by_name(name)) for name in tables]
    head = {
        str(number): {
            "group": False,
            "shape": [len(text) // _WORD],
            "type": "<u8",
            "attributes": {"name": name},
        }
        for number, (name, text) in enumerate(zip(tables, texts, strict=True))
    }
    out.write(json.dumps(head).encode() + b"\n")
    for text in texts:
        out.write(text)


def _text(sheet: Any) -> bytes:
    rows = ("\t".join(map(_cell, row)) for row in sheet.iter_rows())
    text = "\n".join(rows).encode("utf-8", "replace").rstrip(b"\n")
    return text + b"\n" * (-len(text) % _WORD)


def _cell(value: Any) -> str:
    if isinstance(value, str):
        text = value.translate(_BLANKS)
        return '"' + text.replace('"', '""') + '"' if '"' in text else text
    if isinstance(value, datetime.timedelta):
        seconds, rest = divmod(round(value / datetime.timedelta(microseconds=1)), 10**6)
        return f"{seconds // 3600}:{seconds // 60 % 60:02d}:{seconds % 60:02d}.{rest:06d}"
    if isinstance(value, datetime.datetime):
        return value.isoformat(" ")
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    return repr(float(value)) if isinstance(value, float) else str(value)
