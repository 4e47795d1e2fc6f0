"""A table of numbers reads back to the same numbers, however a program has written it, or is refused by its line."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from examples import examples
from hypothesis import given
from refusals import refusal

from mrwork.errors import MrworkError, RecordError
from mrwork.files.delimited import DelimitedTable, RegularTable, decode_text, open_delimited
from mrwork.files.named_columns import ColumnTable

NAMES = [
    *("t_s", "Time (s)", "displacement_mm", "Position(Linear) (mm)", "force_kN", "F [N]", "v_m_s", "Kraft"),
    *("Temperatur", "current_A", "Command Voltage (V)", "déplacement_µm", "x", "a.b", "Oil temperature (°C)"),
]
UNITS = {"t_s": "s", "displacement_mm": "mm", "force_kN": "kN", "v_m_s": "m/s", "x": "m"}
REMARKS = ["# rig 3, oil at 25 C", "#", "# 1, 2, 3", "   # 4;5;6"]
TITLES = ["MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A", "Rig 3", "Operator: N. N.", "Oil at 25 °C", "----------"]


def possible(facts: dict[str, Any]) -> SimpleNamespace:
    """A dialect that can be read: between blanks is no padding, and between commas no decimal comma."""
    if facts["delimiter"].strip(" ") == "":
        facts |= {"padding": "", "trailing": False, "quoted": False}
    return SimpleNamespace(**facts | {"comma": facts["comma"] and facts["delimiter"] != ","})


# How a table is written.
DIALECTS = st.fixed_dictionaries(
    {
        "delimiter": st.sampled_from([",", ";", "\t", " ", "   "]),
        "comma": st.booleans(),
        "end": st.sampled_from(["\n", "\r\n", "\r"]),
        "last_end": st.booleans(),
        "encoding": st.sampled_from(["utf-8", "utf-8-sig", "latin-1"]),
        "form": st.sampled_from(["r", ".6e", ".12E", "+.17g", ".3f", "12.5f"]),
        "padding": st.sampled_from(["", " "]),
        "trailing": st.booleans(),
        "quoted": st.booleans(),
        "titles": st.lists(st.sampled_from(TITLES), max_size=2),
        "above": st.lists(st.sampled_from(REMARKS), max_size=2),
        "between": st.sampled_from(["", "", "\n", "# halt\n", "  \n"]),
        "remark": st.sampled_from(["", "", " # seen"]),
        "units": st.booleans(),
    }
).map(possible)


def in_form(number: float, dialect: SimpleNamespace) -> str:
    text = repr(number) if dialect.form == "r" else format(number, dialect.form)
    return text.strip() if dialect.delimiter.isspace() else text


def written(names: list[str], table: list[list[str]], dialect: SimpleNamespace) -> bytes:
    """The text of a table of numbers with decimal points, in a dialect."""

    def row(cells: list[str]) -> str:
        joined = f"{dialect.padding}{dialect.delimiter}{dialect.padding}".join(cells)
        return joined + dialect.delimiter * dialect.trailing

    quote = '"' if dialect.quoted else ""
    lines = [*dialect.titles, *dialect.above, row([f"{quote}{name}{quote}" for name in names])]
    if dialect.units and all(name in UNITS for name in names):
        lines.append(row([UNITS[name] for name in names]))
    for number, cells in enumerate(table):
        if number == len(table) // 2:
            lines += dialect.between.splitlines()
        cells = [cell.replace(".", ",") for cell in cells] if dialect.comma else cells
        lines.append(row(cells) + dialect.remark)
    text = dialect.end.join(lines) + dialect.end * dialect.last_end
    return text.encode(dialect.encoding)


NUMBERS = st.floats(-1e12, 1e12) | st.integers(-1000, 1000).map(float) | st.floats(-1.0, 1.0)


@st.composite
def tables(draw: st.DrawFn, dialect: SimpleNamespace) -> tuple[list[str], list[list[str]]]:
    """Names of columns and rows of numbers as texts."""
    known = [
        name
        for name in (list(UNITS) if dialect.units else NAMES)
        # Names with blanks between columns that blanks separate are ambiguous.
        if not (" " in name and dialect.delimiter.isspace() and dialect.delimiter != "\t")
    ]
    names = draw(st.lists(st.sampled_from(known), min_size=2, max_size=5, unique=True))
    size = draw(st.integers(2, 25))
    rows = draw(
        st.lists(st.lists(NUMBERS, min_size=len(names), max_size=len(names)), min_size=size, max_size=size)
    )
    return names, [[in_form(number, dialect) for number in row] for row in rows]


@examples(60)
@given(data=st.data(), dialect=DIALECTS)
def test_a_table_in_any_dialect_gives_its_numbers_or_a_refusal(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, dialect: SimpleNamespace
) -> None:
    names, table = data.draw(tables(dialect))
    path = tmp_path_factory.mktemp("dialect") / "rig.csv"
    path.write_bytes(written(names, table, dialect))
    try:
        opened = open_delimited(path)
        found = np.stack(list(opened.read(opened.names).values()), axis=1)
    except RecordError as refusal:
        # Where every comma stands before three digits, they may separate thousands.
        if not (dialect.comma and "or a comma between thousands" in str(refusal)):
            raise
        return
    assert list(opened.names) == names
    np.testing.assert_array_equal(found, [[float(cell) for cell in row] for row in table])


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
