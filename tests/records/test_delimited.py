"""A table of numbers reads back to the same numbers, however a program has written it, or is refused by its line."""

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from examples import examples
from hypothesis import given
from numpy.typing import NDArray
from refusals import refusal

from mrwork.errors import RecordError
from mrwork.files.delimited import open_delimited
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
        table_of_file = open_delimited(path)
        found = numbers_of(table_of_file)
    except RecordError as refusal:
        # Where every comma stands before three digits, they may separate thousands.
        if not (dialect.comma and "or a comma between thousands" in str(refusal)):
            raise
        return
    assert list(table_of_file.names) == names
    np.testing.assert_array_equal(found, [[float(cell) for cell in row] for row in table])


HEADER = "time_s,force_n,current_a"
# More than are read at once.
ROWS = [f"{0.001 * row:.3f},{np.sin(row):.6f},{row % 7}" for row in range(4500)]
NUMBERS_OF_ROWS = np.array([row.split(",") for row in ROWS], dtype=float)


def opened(folder: Path, rows: Sequence[str], more: str = "") -> ColumnTable:
    path = folder / "table.csv"
    path.write_text("\n".join([HEADER + more, *rows]))
    return open_delimited(path)


def numbers_of(table: ColumnTable) -> NDArray[np.float64]:
    return np.stack(list(table.read(table.names).values()), axis=1)


@pytest.mark.parametrize("line", ["", "  ", "# 1,2,3", HEADER, "---,---,---"])
def test_lines_among_the_rows_count_as_lines_only(tmp_path: Path, line: str) -> None:
    table = opened(tmp_path, [*ROWS[:100], line, *ROWS[100:4300], line, *ROWS[4300:]])
    np.testing.assert_array_equal(numbers_of(table), NUMBERS_OF_ROWS)
    assert [table.locate(row) for row in (99, 100, 4300)] == ["line 101", "line 103", "line 4304"]


@pytest.mark.parametrize(
    ("more", "ending"), [("", ""), ("", ","), ("", " # seen"), (",Zustand,note", ',läuft,"by hand, 12:30"')]
)
def test_missing_numbers_are_nan_and_ends_of_rows_do_not_matter(
    tmp_path: Path, more: str, ending: str
) -> None:
    gaps = {4000: "1,,2", 4001: "nan,NA, n/a ", 4300: '"3", "4",-nan', 4499: ",null,2"}
    rows = [gaps.get(row, line) + ending for row, line in enumerate(ROWS)]
    expected = NUMBERS_OF_ROWS.copy()
    nan = np.nan
    expected[list(gaps)] = [[1, nan, 2], [nan, nan, nan], [3, 4, nan], [nan, nan, 2]]
    columns = opened(tmp_path, rows, more).read(HEADER.split(","))
    np.testing.assert_array_equal(np.stack(list(columns.values()), axis=1), expected)


@pytest.mark.parametrize(
    ("changed", "wanted", "word"),
    [
        ({4000: "1,x,2", 4300: "1,2,y"}, ["force_n", "current_a"], "line 4002, column 'force_n' holds 'x'"),
        ({4000: "1,x,2", 4300: "1,2,y"}, ["current_a"], "line 4302, column 'current_a' holds 'y'"),
        ({4300: "1,2"}, ["time_s"], "line 4302 has 2 fields where the header names 3"),
        ({4300: "1,2,3,4"}, ["time_s"], "line 4302 has 4 fields .* decimal commas between commas"),
    ],
)
def test_the_first_wrong_cell_of_a_wanted_column_is_named(
    tmp_path: Path, changed: dict[int, str], wanted: list[str], word: str
) -> None:
    table = opened(tmp_path, [changed.get(row, line) for row, line in enumerate(ROWS)])
    refusal(table.read, wanted, match=word)


def test_dates_with_points_stand_beside_decimal_commas(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    rows = [f"01.05.2024 12:00:{row:02d},5;{row},25;" for row in range(20)]
    path.write_text("\n".join(["Zeit;Kraft [N];Weg [mm]", *rows[:10], ";7,25;", *rows[10:]]))
    table = open_delimited(path)
    columns = table.read(["Zeit", "Kraft [N]"])
    np.testing.assert_array_equal(columns["Zeit"][[0, 9, 10, 11]], [0.0, 9.0, np.nan, 10.0])
    np.testing.assert_array_equal(columns["Kraft [N]"][[0, 10, 20]], [0.25, 7.25, 19.25])
