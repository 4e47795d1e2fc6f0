"""Output that verbs share: messages, JSON, tables, and the page of a run, which is written again."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from mrwork.errors import MrworkError
from mrwork.store.codec import json_document
from mrwork.summary import Summarised, aligned


def note(sentence: str) -> None:
    """Print a message on stderr."""
    print(f"mrwork: {sentence}", file=sys.stderr)


def print_json(document: object) -> None:
    """Print an object in one line; numbers that are not finite become null, as in the files."""
    print(json.dumps(json.loads(json_document(document))))


def table_lines(rows: Sequence[Sequence[str]]) -> list[str]:
    """Aligned and indented lines of a table; the first row has the headings."""
    return [f"  {line}" for line in aligned(rows)]


def result_lines(result: Summarised) -> list[str]:
    """The table of a result's summary, with all rows."""
    summary = result._summary()
    return table_lines([summary.columns, *summary.rows])


def renew_page(folder: Path) -> None:
    """Write the page of a run again; where that fails, for example because a test is missing, print the reason."""
    # Matplotlib is slow to load.
    from mrwork.report.fit.page import rewrite_page

    try:
        rewrite_page(folder)
    except MrworkError as reason:
        note(f"the page of {folder} was not updated: {reason}")
