"""Numbers in prose that stand in a stored table of a study: checked, and written anew with `--write`.

A page quotes by a name of `quoted.toml` between two comments: `<!--=NAME-->0.90<!--/-->`. The name leads to a cell of
the whole form of `studies/TABLE.csv`, or by how many per cent it is `below` the cell of another row.
"""

from __future__ import annotations

import csv
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

_DOCS = Path(__file__).resolve().parent
_QUOTED = re.compile(r"<!--=([a-z0-9_]+)-->(.*?)<!--/-->", flags=re.DOTALL)


def cell(table: str, row: str, column: str) -> float:
    """The number of a table's whole form; a range is no number and is not quoted."""
    path = _DOCS.parent / "studies" / f"{table}.csv"
    if not path.is_file():
        raise LookupError(f"studies/{table}.csv is not there")
    with path.open(newline="", encoding="utf-8") as file:
        lines = {line["row"]: line for line in csv.DictReader(file) if line["form"] in ("full", "both")}
    if row not in lines:
        raise LookupError(f"studies/{table}.csv has no row {row!r} of the whole form, but {', '.join(lines)}")
    if column not in lines[row]:
        raise LookupError(f"studies/{table}.csv has no column {column!r}")
    return float(lines[row][column])


def number(given: Mapping[str, str]) -> str:
    """The number of an entry of `quoted.toml` as it is shown."""
    value = cell(given["table"], given["row"], given["column"])
    if "below" in given:
        value = 100.0 * (1.0 - value / cell(given["table"], given["below"], given["column"]))
    return format(value, given["format"])


def findings(page: Path, entries: Mapping[str, Mapping[str, str]]) -> Iterator[str]:
    """Sentences on quoted numbers that their tables do not have."""
    text = page.read_text(encoding="utf-8")
    for quoted in _QUOTED.finditer(text):
        place = f"{page}, line {1 + text.count(chr(10), 0, quoted.start())}"
        if quoted[1] not in entries:
            yield f"{place}: quoted.toml has no {quoted[1]}"
        elif quoted[2] != (right := number(entries[quoted[1]])):
            yield (
                f"{place}: {quoted[2]} is quoted for {quoted[1]}, and the table has {right}; read the sentence again, "
                "then run python docs/quoted.py --write"
            )


def written(text: str, entries: Mapping[str, Mapping[str, str]]) -> str:
    """A page with the numbers that its tables have."""
    return _QUOTED.sub(lambda quoted: f"<!--={quoted[1]}-->{number(entries[quoted[1]])}<!--/-->", text)


def pages() -> list[Path]:
    """README and the pages of the documentation that people write."""
    made = _DOCS / "reference" / "_generated"
    return [
        _DOCS.parent / "README.md",
        *(page for page in sorted(_DOCS.rglob("*.md")) if made not in page.parents),
    ]


def main() -> int:
    """Print which numbers are wrong, or write them anew; the exit status is 1 where some are wrong."""
    entries = tomllib.loads((_DOCS / "quoted.toml").read_text(encoding="utf-8"))
    if sys.argv[1:] == ["--write"]:
        for page in pages():
            page.write_text(written(page.read_text(encoding="utf-8"), entries), encoding="utf-8")
    found = [sentence for page in pages() for sentence in findings(page, entries)]
    quoted = sum(len(_QUOTED.findall(page.read_text(encoding="utf-8"))) for page in pages())
    print("\n".join(found) if found else f"{quoted} quoted numbers are those of their tables")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
