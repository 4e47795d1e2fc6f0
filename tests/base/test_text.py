"""Tables of text in each medium, and characters that a reader cannot see as escapes."""

import ast
import re
import sys
import unicodedata
from collections import Counter
from dataclasses import replace
from operator import itemgetter
from pathlib import Path

import pytest

import mrwork
from mrwork.base.numbers import format_rate
from mrwork.base.remark import RemarkKind
from mrwork.base.summary import Summary
from mrwork.base.table import Column, Table, as_json, csv_text
from mrwork.errors import MrworkWarning, RecordError, escape_text, escaped_lines

COLUMNS = (
    Column("", "test", of=itemgetter(0)),
    Column("", "peak force", "N", of=itemgetter(1)),
    Column("", "remark", of=itemgetter(2)),
)
ITEMS = (("k_w <1>", "12.5", ""), ("slow", "3", "at 5 %"))


def test_a_rate_has_three_digits_and_the_next_prefix_from_a_thousand_on() -> None:
    rates = (0.5, 950.0, 1000.0, 1250.0, 1e6, 3.1e6, 2e9)
    assert [format_rate(rate) for rate in rates] == ["0.5", "950", "1k", "1.25k", "1M", "3.1M", "2G"]


def test_the_unit_of_a_column_is_in_the_headings_of_every_medium() -> None:
    table = Table.of(COLUMNS, ITEMS)
    assert re.split(" {2,}", table.lines()[0]) == ["test", "peak force [N]", "remark"]
    assert re.findall(">([^<>]+)</th>", table.html())[:3] == ["Test", "Peak force (N)", "Remark"]


def test_a_table_leaves_out_what_is_empty_in_every_row() -> None:
    table = Table.of(COLUMNS, [("a", "1", ""), ("b", "2", "–")])
    assert (table.columns, table.units) == (("test", "peak force"), ("", "N"))
    assert replace(table, foot=("all", "3")).filled.foot == ("all", "3")


def test_a_column_takes_its_value_by_its_key_and_shows_its_digits() -> None:
    columns = (Column("real", "x", "m", shown=3), Column("imag", words="y"), Column("", "z", of=abs, shown=2))
    assert Table.of(columns, [3.14159 + 4.0j]).rows == (("3.14", "5.1"),)
    assert as_json(columns, 1.5 + 2.0j) == {"real": 1.5, "imag": 2.0}
    assert Table.of([Column("real", "x")], [1.234e-9 + 0j]).lines()[1] == "1.234e-09"


def test_lines_are_aligned_with_numbers_to_the_right() -> None:
    assert Table.of(COLUMNS, ITEMS).lines("  ") == [
        "  test     peak force [N]  remark",
        "  k_w <1>            12.5",
        "  slow                  3  at 5 %",
    ]


def test_a_page_escapes_its_cells_and_names_the_table_for_screen_readers() -> None:
    html = Table.of(COLUMNS, ITEMS, label="Tests & more", note="see `mrwork plan`").html()
    assert 'aria-label="Tests &amp; more"' in html
    assert "k_<wbr>w &lt;1&gt;" in html
    assert "<code>mrwork plan</code>" in html
    assert len(re.findall("<t[dh][ >]", html)) == 9
    assert html.count('class="number"') == 3


def test_cells_in_bold_are_bold_on_a_page() -> None:
    table = Table(
        title="Errors", columns=("law", "a", "b"), rows=(("x", "1", "2"),), strong=frozenset({(0, 2)})
    )
    assert '<td class="number">1</td><td class="number strong">2</td>' in table.html()
    assert f"{table.__html__()}" == table.html()


def test_a_summary_has_remarks_before_notes_and_every_table_in_each_medium() -> None:
    summary = Summary(
        title="Result",
        facts=[("error", "3 N"), ("none", "")],
        remarks=[RemarkKind("doubtful", "{0}", warns=True).remark("do not trust it")],
        tables=[Table.of(COLUMNS, ITEMS), Table(title="Marks", columns=("a", "b"), rows=[("x", "–")])],
        notes=["it is synthetic"],
    )
    text = summary.text(whole=True).splitlines()
    assert text[:2] == ["Result", "  error  3 N"]
    assert text[-2:] == ["  warning: do not trust it", "  it is synthetic"]
    # A column without an entry is left out, whatever stands for none.
    assert [text[7], text[8], text[9]] == ["  Marks", "  a", "  x"]
    for words in ("3 N", "Peak force", "Marks", "warning: do not trust it"):
        assert words in summary.html()


def test_a_field_of_a_csv_file_with_a_comma_is_quoted() -> None:
    assert csv_text([("a", "b"), ("1,5", "2")]) == 'a,b\n"1,5",2\n'


# Controls, formats, private use, halves of characters, ends of lines and of paragraphs.
UNSEEN = {"Cc", "Cf", "Co", "Cs", "Zl", "Zp"}


def test_what_has_no_shape_is_escaped_and_all_else_is_kept() -> None:
    for number in range(sys.maxunicode + 1):
        character = chr(number)
        kind = unicodedata.category(character)
        if kind in UNSEEN:
            assert escape_text(character) != character, hex(number)
        elif kind != "Cn":
            assert escape_text(character) == character, hex(number)
    assert escaped_lines("a\nb\r") == "a\nb\\r"


@pytest.mark.parametrize("kind", [RecordError, MrworkWarning])
def test_a_sentence_is_one_line_whatever_it_quotes(kind: type[Exception]) -> None:
    assert (
        str(kind("rig.csv: has no column 'a\nb\x1b'; name one"))
        == r"rig.csv: has no column 'a\nb\x1b'; name one"
    )
    long = str(kind(f"rig.csv: has no column '{'a' * 100_000}'; name one"))
    assert len(long) <= 2000
    assert long.startswith("rig.csv: has no column 'aaa")
    assert long.endswith("aaa'; name one")


def test_every_code_of_a_remark_is_declared_once() -> None:
    codes = Counter(
        ast.unparse(call.args[0])
        for file in Path(mrwork.__file__).parent.rglob("*.py")
        for call in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(call, ast.Call) and ast.unparse(call.func) == "RemarkKind"
    )
    assert len(codes) > 100
    assert [code for code, count in codes.items() if count > 1] == []
