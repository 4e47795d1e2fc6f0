"""What verbs print, and the page of a run, which they renew."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from mrwork.errors import MrworkError
from mrwork.store.codec import json_document
from mrwork.summary import Summarised, aligned


def note(sentence: str) -> None:
    """Print on stderr what is not a result."""
    print(f"mrwork: {sentence}", file=sys.stderr)


def print_json(document: object) -> None:
    """Print one object in one line; numbers that are not finite become null, as in the files."""
    print(json.dumps(json.loads(json_document(document))))


def table_lines(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows of cells, the first with the headings, as aligned and indented lines."""
    return [f"  {line}" for line in aligned(rows)]


def result_lines(result: Summarised) -> list[str]:
    """The table that a result shows of itself, with all its rows."""
    summary = result._summary()
    return table_lines([summary.columns, *summary.rows])


def renew_page(folder: Path) -> None:
    """Write the page of a run again; where its tests are gone, a note says why the page is as it was."""
    # Matplotlib is slow to load.
    from mrwork.report.fit.page import rewrite_page

    try:
        rewrite_page(folder)
    except MrworkError as reason:
        note(f"the page of {folder} is as it was: {reason}")
