"""Chapter 3 of the thesis: fluids, flow, a published damper, dampers sized for a frame, four models on one test.

python studies/chapter_3/study.py [--quick] [--json] [--threads N] [--out DIRECTORY]
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path

# The frame and its records are those of chapter 6.
sys.path.append(str(Path(__file__).parents[1] / "chapter_6"))

from chapter_3_findings import chapter_of
from chapter_3_tables import tables
from mrwork.report import departures

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("MRWORK_DATA", ROOT.parent / "shared" / "data"))
RECORDS = DATA / "records"


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="one sized damper, one motion, three models")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")
    parser.add_argument("--threads", type=int, default=0, help="threads of the simulations, 0 for all")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "chapter_3", help="where the page goes")
    options = parser.parse_args()
    began = time.perf_counter()

    def say(what: str) -> None:
        print(f"{time.perf_counter() - began:6.0f} s  {what}", file=sys.stderr, flush=True)

    records = RECORDS if RECORDS.is_dir() else None
    skipped = "" if records else f"Skipped: the records are not at {RECORDS}; point MRWORK_DATA at the data."
    chapter = chapter_of(records=records, quick=options.quick, threads=options.threads, say=say)
    wrong = departures(chapter.found, Path(__file__).parent / "expected.toml")
    if not options.quick:
        from chapter_3_page import write_page

        write_page(chapter, options.out / "report.html", skipped=skipped)
    if options.json:
        print(json.dumps({**chapter.found, "skipped": skipped, "departures": wrong}))
    else:
        print("\n".join(table.markdown() for section in tables(chapter.found).values() for table in section))
        if skipped:
            print(skipped)
        print("\n".join(wrong) or "Every figure agrees with expected.toml.")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
