"""Tables whose rows are all alike, read by NumPy at once; `delimited.py` reads every other table line by line.

The layout is found in the first lines and in some from the middle of the file. That it is the layout of all lines
follows from what NumPy has read: as many rows as there are lines, with one number in every field.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.records.formats.labview import is_labview
from mrwork.records.formats.layout import (
    MISSING,
    SURELY_DECIMAL,
    Layout,
    is_data,
    is_number,
    sampled_layout,
    split,
)
from mrwork.records.table import ColumnTable

_HEAD: Final = 65536
# Lines from the middle of the file that are looked at.
_WINDOW: Final = 20
# What occurs in numbers, in words for a missing one, and between fields.
_OF_NUMBERS: Final = b"0123456789+-.,eE" + b"infityaulo/INFITYAULO" + b' \t;"'
_SIGNED_NAN: Final = (b"-n", b"-N", b"+n", b"+N")


class RegularTable(ColumnTable):
    """A text table whose rows have been read.

    `columns` have their place among `names` as the key; columns of texts are missing. `line` is the index of the first
    row's line. The reader of `careful` is asked for columns of texts, and where decimal commas are in doubt because none
    of the columns is among `decided`.
    """

    def __init__(
        self,
        *,
        layout: Layout,
        sha256: str,
        columns: dict[int, NDArray[np.float64]],
        line: int,
        decided: frozenset[int],
        careful: Callable[[], ColumnTable],
    ) -> None:
        self.names = layout.names
        self.units = dict(zip(layout.names, layout.units, strict=False))
        self.sha256 = sha256
        self._columns = columns
        self._line = line
        self._decided = decided
        self._careful = careful

    def read(self, wanted: Sequence[str]) -> dict[str, NDArray[np.float64]]:
        """The requested columns, each of shape (n_time,)."""
        places = [self.names.index(name) for name in wanted]
        if not self._decided.intersection(places) or not self._columns.keys() >= set(places):
            return self._careful().read(wanted)
        return {name: self._columns[place].copy() for name, place in zip(wanted, places, strict=True)}

    def locate(self, row: int) -> str:
        """Line of a row."""
        n_rows = next(iter(self._columns.values())).size
        return f"line {self._line + row + 1}" if row < n_rows else f"row {row + 1}"


def regular_table(
    data: bytes, decoded: Callable[[bytes], str], *, sha256: str, careful: Callable[[], ColumnTable]
) -> RegularTable | None:
    """Read the bytes of a table; `None` where its lines must be looked at one by one, which `careful` does."""
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n")
    if b"\r" in data:
        return None
    head = data[: data.rfind(b"\n", 0, _HEAD) + 1] if len(data) > _HEAD else data
    lines = decoded(head).split("\n")
    if is_labview(lines):
        return None
    sampled = sampled_layout(lines, _middle(lines, data, len(head)))
    if sampled is None:
        return None
    layout, with_texts = sampled
    line = layout.data[0]
    rows = data[sum(len(each) + 1 for each in head.split(b"\n", line)[:line]) :].rstrip(b"\n")
    fields = [split(lines[index], layout.delimiter) for index in layout.data]
    form = _Form.of(fields, layout, with_texts)
    columns = form.columns(rows)
    if columns is None or any(map(_reads_as_number, layout.names)):
        return None
    return RegularTable(
        layout=layout, sha256=sha256, columns=columns, line=line, decided=form.decided, careful=careful
    )
