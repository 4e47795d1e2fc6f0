"""A table that NumPy reads gives numbers, refusals and lines as the reader line by line does, or is left to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from refusals import refusal

from mrwork.errors import MrworkError
from mrwork.files.delimited import DelimitedTable, RegularTable, decode_text, open_delimited
from mrwork.files.named_columns import ColumnTable

HEADER = "time_s,force_n,current_a"
# Longer than the part in which the header is looked for.
ROWS = [f"{0.001 * row:.3f},{np.sin(row):.6f},{row % 7}" for row in range(4500)]


def changed(rows: dict[int, str], ending: str = "") -> str:
    """The table with some lines replaced, by row, and something at the end of each other line."""
    return "\n".join([HEADER, *(rows.get(row, line + ending) for row, line in enumerate(ROWS))])


def told(table: ColumnTable, wanted: list[str]) -> object:
    try:
        return [(name, column.tobytes()) for name, column in table.read(wanted).items()]
    except (MrworkError, ValueError) as error:
        return str(error)


REGULAR = {
    "plain": changed({}),
    "header block": "Test of a damper\n\ntime,force,current\ns,N,A\n" + "\n".join(ROWS) + "\n\n",
    "CR LF": changed({}).replace("\n", "\r\n"),
    "blanks": changed({}).replace(",", "  "),
    "decimal commas": changed({4000: "", 4350: "1,x,2"}).replace(",", ";").replace(".", ","),
    "trailing": changed({}, ","),
    "texts": changed({4350: "1,2,x,läuft"}, ",läuft").replace("current_a", "current_a,Zustand"),
    "quoted texts": changed({}, ',"12:30:00.1, by hand"').replace("current_a", "current_a,note"),
    "empty lines": changed({100: "# remark", 4000: "# 1,2,3", 4250: "", 4499: ""}),
    "gaps": changed({4000: "1,,2", 4001: "nan,NA, n/a ", 4002: ",,"}),
    "cells": changed({4000: "1, OL,2", 4499: "OL,2,3"}),
    "widths": changed({4000: "1,x,2", 4250: "1,2", 4300: "1,2,3,4"}),
    "remarks": changed({4000: "1,2,3 # seen", 4350: "1,2,x # seen"}),
}
IRREGULAR = {
    "a header below": changed({4000: HEADER}),
    "a rule": changed({4000: "---,---,---"}),
    "a quoted break": changed({4000: '1,"2\n3",4'}),
    "a digit of another script": changed({4350: "1,\N{ARABIC-INDIC DIGIT FIVE},2"}),
}


@pytest.mark.parametrize("case", [*REGULAR, *IRREGULAR])
def test_a_table_is_told_as_line_by_line(tmp_path: Path, case: str) -> None:
    data = (REGULAR | IRREGULAR)[case].encode()
    path = tmp_path / "table.csv"
    path.write_bytes(data)
    table = open_delimited(path)
    assert isinstance(table, RegularTable) == (case in REGULAR)
    lines = decode_text(data).replace("\r\n", "\n").split("\n")
    expected = DelimitedTable(source=str(path), sha256="", lines=lines)
    assert (table.names, table.units) == (expected.names, expected.units)
    for names in (table.names, table.names[:2], table.names[::-2]):
        assert told(table, list(names)) == told(expected, list(names))
    for row in (0, 99, 100, 3998, 4250, 4480):
        assert table.locate(row) == expected.locate(row)


def test_the_first_text_in_a_requested_column_is_refused_after_all_widths(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text(changed({4000: "1,2,x", 4001: "OL,2,3"}))
    table = open_delimited(path)
    assert table.read(["force_n"])["force_n"].size == len(ROWS)
    refusal(table.read, ["time_s", "current_a"], match="line 4002, column 'current_a' holds 'x'")
    path.write_text(changed({4000: "1,2,x", 4499: "1,2"}))
    refusal(open_delimited(path).read, ["force_n"], match="line 4501 has 2 fields")
