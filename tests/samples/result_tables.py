"""What every study promises of its tables and its page."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Protocol


class Table(Protocol):
    """A table of text."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def assert_filled(tables: Iterable[Table]) -> None:
    """Each row has a name, and a text below each heading."""
    for table in tables:
        assert table.rows, table.title
        assert {len(row) for row in table.rows} == {len(table.columns)}, table.title
        assert all(row[0] for row in table.rows), table.title


def assert_alone(page: Path, *, pictures: int) -> None:
    """The page has more pictures than that, and needs no other file."""
    text = page.read_text(encoding="utf-8")
    assert text.count("<svg") > pictures
    for outside in ('src="', "url(http", "<link", "<script"):
        assert outside not in text
