"""Chapter 7 of the thesis: a virtual shake table, the frame and its damper identified on it, control, and predictions.

python studies/chapter_7/study.py [--quick] [--json] [--threads N] [--out DIRECTORY]
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path

from chapter_7_findings import chapter_of
from chapter_7_tables import tables
from mrwork.report import departures

ROOT = Path(__file__).parents[2]
RECORDS = Path(os.environ.get("MRWORK_DATA", ROOT.parent / "shared" / "data")) / "records"


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick", action="store_true", help="one synthetic motion, fewer sine tests and settings"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")
    parser.add_argument("--threads", type=int, default=0, help="threads of the simulations, 0 for all")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "chapter_7", help="where the page goes")
    options = parser.parse_args()
    began = time.perf_counter()

    def say(what: str) -> None:
        print(f"{time.perf_counter() - began:6.0f} s  {what}", file=sys.stderr, flush=True)

    records = RECORDS if RECORDS.is_dir() else None
    chapter = chapter_of(quick=options.quick, records=records, threads=options.threads, say=say)
    wrong = departures(chapter.found, Path(__file__).parent / "expected.toml")
    if not options.quick:
        from chapter_7_page import write_page

        write_page(chapter, options.out / "report.html")
    if options.json:
        print(json.dumps({**chapter.found, "departures": wrong}))
    else:
        print("\n".join(table.markdown() for section in tables(chapter.found).values() for table in section))
        print("\n".join(wrong) or "Every figure agrees with expected.toml.")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
