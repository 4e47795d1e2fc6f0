"""A table that NumPy reads gives numbers, refusals and lines as the reader line by line does, or is left to it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from sentences import Refused

from mrwork.errors import MrworkError
from mrwork.files.delimited import DelimitedTable, RegularTable, decode_text, open_delimited
from mrwork.files.named_columns import ColumnTable

NUMBERS = st.one_of(
    st.floats(allow_nan=False, width=64).map(repr),
    st.floats(-1e4, 1e4).map("{:.6f}".format),
    st.integers(-(10**20), 10**20).map(str),
    st.sampled_from(
        ["0", "-0.0", "1.", ".5", "+3e-5", "1e400", "4.9e-324", "0.1000000000000000055511151231257827"]
    ),
)
ODD = st.sampled_from(
    [
        "",
        " ",
        "nan",
        "NaN",
        "-nan",
        "NA",
        " n/a ",
        "null",
        "inf",
        "OK",
        "a b",
        "12:30",
        "1,5",
        '"2,5"',
        '"3"',
        '" 4',
        "---",
        "#",
        "x,y",
        "1 # seen",
        "läuft",
        "5\N{NO-BREAK SPACE}",
        "\N{ARABIC-INDIC DIGIT FIVE}",
        "-normal",
        "\f6",
    ]
)
LINES = st.sampled_from(
    [
        "",
        "  ",
        "\t",
        "# remark",
        " # ä",
        "time,force,status",
        "s,N,-",
        "---,---",
        "1,2",
        "12:00",
        "5\t6",
        "7;8;9",
        ",",
        "\N{NO-BREAK SPACE}",
        "1,2,3,4,5,6,7",
        "NA,NA",
    ]
)
TEXTS = st.sampled_from([None, None, "OK", '"a;b"', "12:30:00", "on", "läuft", "Öl an", "a,b"])


@st.composite
def tables(draw: st.DrawFn) -> bytes:
    """Tables that are regular, or nearly."""
    delimiter = draw(st.sampled_from([",", ";", "\t", " ", ", "]))
    n_columns = draw(st.integers(2, 4))
    n_rows = draw(st.integers(0, 45))
    with_texts = draw(TEXTS)
    cells = [[draw(NUMBERS) for _ in range(n_columns)] for _ in range(n_rows)]
    if with_texts is not None:
        cells = [[*row, with_texts] for row in cells]
    for _ in range(draw(st.integers(0, 3)) if cells else 0):
        row = draw(st.integers(0, n_rows - 1))
        cells[row][draw(st.integers(0, len(cells[row]) - 1))] = draw(ODD)
    if draw(st.booleans()):
        cells = [[*row, *[""] * draw(st.sampled_from([1, 1, 2, 0]))] for row in cells]
    lines = [delimiter.join(row) for row in cells]
    if draw(st.booleans()):
        lines = [line.replace(".", ",") for line in lines]
    if draw(st.booleans()):
        lines = ['"' + line.replace(delimiter, f'"{delimiter}"') + '"' for line in lines]
    for _ in range(draw(st.sampled_from([0, 0, 0, 1, 2, 9])) if lines else 0):
        lines.insert(draw(st.integers(0, len(lines))), draw(LINES))
    header = draw(
        st.sampled_from(
            [[], ["Test of a damper", "Rate,100"], ["limits", *["1,2,3"] * 12], ["nan,nan"], ["# a,b,c"]]
        )
    )
    names = ["time_s", "force_n", "displacement_mm", "current_a", "status"][
        : n_columns + (with_texts is not None)
    ]
    named = draw(
        st.sampled_from(
            [[], [delimiter.join(names)], [delimiter.join(names), delimiter.join(["s", "N", "mm"])]]
        )
    )
    end = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    text = end.join([*header, *named, *lines]) + end * draw(st.integers(0, 2))
    return draw(st.sampled_from([b"", b"", b"\xef\xbb\xbf"])) + text.encode(
        draw(st.sampled_from(["utf-8", "latin-1"])), errors="replace"
    )


def line_by_line(data: bytes, source: str) -> ColumnTable:
    lines = decode_text(data).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return DelimitedTable(source=source, sha256="", lines=lines)


def told(table: ColumnTable, wanted: tuple[str, ...]) -> list[object]:
    try:
        found = table.read(wanted)
    except (MrworkError, ValueError) as error:
        return [str(error)]
    return [(name, column.tobytes()) for name, column in found.items()]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("regular")


@examples(150)
@given(data=tables())
def test_both_readers_tell_the_same_of_any_table(folder: Path, data: bytes) -> None:
    path = folder / "table.csv"
    path.write_bytes(data)
    try:
        expected: ColumnTable | str = line_by_line(data, str(path))
    except MrworkError as error:
        expected = str(error)
    try:
        found: ColumnTable | str = open_delimited(path)
    except MrworkError as error:
        found = str(error)
    if isinstance(expected, str) or isinstance(found, str):
        # An empty file is refused before its lines are.
        assert found == expected or "is empty" in str(found)
        return
    assert (found.names, found.units) == (expected.names, expected.units)
    wanted = [found.names, found.names[:1], found.names[:2], found.names[-2:]]
    for names in wanted:
        assert told(found, tuple(names)) == told(expected, tuple(names))
    # No row is asked for where none can be read.
    readable = any(not isinstance(told(expected, (name,))[0], str) for name in expected.names)
    for row in (0, 1, 20, 30, 40, 100) if readable else ():
        assert found.locate(row) == expected.locate(row)


ROWS = "\n".join(f"{0.01 * row:.2f},{np.sin(row):.6f},{row % 7}" for row in range(40))
HEADER = "time_s,force_n,current_a\n"


@pytest.mark.parametrize(
    "text",
    [
        HEADER + ROWS,
        "Test of a damper\n\ntime,force,current\ns,N,A\n" + ROWS + "\n\n",
        HEADER + ROWS.replace("\n", "\r\n"),
        (HEADER + ROWS).replace(",", "\t"),
        (HEADER + ROWS).replace(",", "  "),
        (HEADER + ROWS).replace(",", ";").replace(".", ","),
        (HEADER + ROWS).replace("\n", ",\n") + ",",
        HEADER + ROWS.replace(",0.000000,", ",,").replace("0.39,", ","),
        (HEADER + ROWS).replace("\n", ",OK\n") + ",OK",
        (HEADER + ROWS).replace("\n", ',"12:30:00.1, by hand"\n') + ",x",
    ],
    ids=["plain", "units", "ends", "tabs", "blanks", "commas", "trailing", "gaps", "status", "quoted"],
)
def test_the_tables_of_rigs_are_read_at_once(text: str, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text(text, encoding="utf-8", newline="")
    table = open_delimited(path)
    assert isinstance(table, RegularTable)
    expected = line_by_line(path.read_bytes(), str(path))
    assert told(table, table.names[:3]) == told(expected, table.names[:3])


LARGE = [f"{0.001 * row:.3f},{np.sin(row):.6f},{row % 7}" for row in range(9000)]


def large(changed: Mapping[int, str]) -> str:
    """A table of several blocks of which some lines, by row, are others."""
    return HEADER + "\n".join(changed.get(row, line) for row, line in enumerate(LARGE))


STATES = {row: f"{line},läuft" for row, line in enumerate(LARGE)}


CHANGED = {
    "plain": large({}),
    "empty_lines": large({100: "# remark", 8000: "# 1,2,3", 8500: "", 8501: " \t", 8999: ""}),
    "gaps": large({8000: "1,,2", 8001: "nan,NA, n/a ", 8002: ",,"}),
    "texts": large({8000: "1, OL,2", 8700: "1,x,y", 8999: "OL,2,3"}),
    "widths": large({8000: "1,x,2", 8700: "", 8500: "1,2", 8600: "1,2,3,4"}),
    "short": large({8999: "1"}),
    "umlaut": large({8000: "# läuft", 8700: "1,2,µ"}),
    "remarks": large({8000: "1,2,3 # seen", 8700: "1,2,x # seen"}),
    "column": large(STATES).replace("current_a", "current_a,Zustand"),
    "in_column": large({**STATES, 8700: "1,2,x,läuft"}).replace("current_a", "current_a,Zustand"),
    "commas": large({8000: "", 8700: "1,x,2"}).replace(",", ";").replace(".", ","),
}
ENCODED = [("\n", "utf-8"), ("\r\n", "utf-8-sig"), ("\r", "latin-1")]
# In one encoding after the other, and in all of them where one is told from another.
CHANGED_ENCODED = [
    pytest.param(text, *ENCODED[place], id=f"{name}-{ENCODED[place][1]}")
    for number, (name, text) in enumerate(CHANGED.items())
    for place in ([number % 3] if text.isascii() else range(3))
]


@pytest.mark.parametrize(("text", "end", "encoding"), CHANGED_ENCODED)
def test_a_large_table_is_told_as_line_by_line_though_some_rows_differ(
    text: str, end: str, encoding: str, tmp_path: Path
) -> None:
    path = tmp_path / "table.csv"
    path.write_bytes(text.replace("\n", end).encode(encoding))
    table = open_delimited(path)
    assert isinstance(table, RegularTable)
    expected = line_by_line(path.read_bytes(), str(path))
    assert table.names == expected.names
    for names in (table.names, table.names[:2], table.names[::-2]):
        assert told(table, names) == told(expected, names)
    for row in (0, 99, 100, 7998, 8500, 8980):
        assert table.locate(row) == expected.locate(row)


@pytest.mark.parametrize(
    "changed",
    [
        {8000: HEADER[:-1]},
        {8000: "---,---,---"},
        {8000: "1,2", 8900: HEADER[:-1]},
        {8000: '1,"2\n3",4'},
        {8700: "1,+nan,2", 8701: "x,1,2"},
        {8700: "1,\N{ARABIC-INDIC DIGIT FIVE},2"},
    ],
    ids=["header", "rule", "header_after_width", "quoted", "signed", "digit"],
)
def test_a_table_in_which_more_than_cells_differ_is_left_to_the_reader_line_by_line(
    changed: Mapping[int, str], tmp_path: Path
) -> None:
    path = tmp_path / "table.csv"
    path.write_text(large(changed), encoding="utf-8")
    table = open_delimited(path)
    assert not isinstance(table, RegularTable)
    assert told(table, table.names) == told(line_by_line(path.read_bytes(), str(path)), table.names)


def test_a_quote_after_a_blank_hides_the_next_delimiter_from_both_readers(
    tmp_path: Path, refused: Refused
) -> None:
    rows = [f"{0.01 * row:.2f}; {row % 7}; on" for row in range(40)]
    rows[5] = '0.05; "5; on'
    path = tmp_path / "table.csv"
    path.write_text("\n".join(["time_s; force_n; state", *rows]))
    refused(open_delimited(path).read, ["time_s"])


def test_the_first_text_in_any_requested_column_is_refused_after_all_widths(
    tmp_path: Path, refused: Refused
) -> None:
    path = tmp_path / "table.csv"
    path.write_text(large({8000: "1,2,x", 8001: "OL,2,3"}))
    table = open_delimited(path)
    assert table.read(["force_n"])["force_n"].size == len(LARGE)
    refused(table.read, ["time_s", "current_a"])
    path.write_text(large({8000: "1,2,x", 8999: "1,2"}))
    refused(open_delimited(path).read, ["force_n"])
