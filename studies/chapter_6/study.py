"""Chapter 6: buildings with MR dampers under earthquakes, every control law beside honest baselines.

python studies/chapter_6/study.py [--tune [LAW ...] [--near]] [--level LEVEL ...] [--quick] [--json] [--out DIRECTORY]
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path

from chapter_6_page import write_page
from chapter_6_tables import remarks, tables
from frame_runs import LEVELS, bench, level_name
from kept_settings import keep
from loop_findings import ACTIVE, TUNED_LAWS, found_by, tune
from mrwork.report import departures
from thesis_tables import thesis_tables

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
DATA = Path(os.environ.get("MRWORK_DATA", ROOT.parent / "shared" / "data"))
RECORDS = DATA / "records"


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--tune",
        nargs="*",
        choices=(*TUNED_LAWS, *ACTIVE),
        metavar="LAW",
        help="search the settings of these laws anew, of all where none is named, and write tuned.toml",
    )
    parser.add_argument(
        "--near", action="store_true", help="search about the settings of tuned.toml instead of a grid"
    )
    parser.add_argument(
        "--level",
        nargs="+",
        choices=[level_name(level) for level in LEVELS],
        default=[level_name(LEVELS[0])],
        help="levels whose sheets and tables of every floor are shown",
    )
    parser.add_argument("--quick", action="store_true", help="a few laws, no conditions, no million runs")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "chapter_6", help="where the page goes")
    options = parser.parse_args()
    if not RECORDS.is_dir():
        parser.error(f"the records are not at {RECORDS}; point MRWORK_DATA at the data")
    began = time.perf_counter()

    def on_progress(doing: str) -> None:
        print(f"{time.perf_counter() - began:6.0f} s  {doing}", file=sys.stderr, flush=True)

    if options.tune is not None:
        keep(tune(bench(RECORDS), options.tune or (*TUNED_LAWS, *ACTIVE), on_progress, near=options.near))
    found = found_by(quick=options.quick, records=RECORDS, on_progress=on_progress)
    found["seconds"] = time.perf_counter() - began
    wrong = departures(found, HERE / "expected.toml")
    page = options.out / "report.html"
    if not options.quick:
        on_progress("page")
        write_page(found, page, levels=options.level, records=RECORDS)
    if options.json:
        print(json.dumps({**found, "departures": wrong}))
    else:
        shown = thesis_tables(found, options.level)
        for table in (*tables(found), *(each for section in shown.values() for each in section)):
            print(table.markdown())
        print("\n".join(remarks(found)))
        print("\n".join(wrong) or "Every figure agrees with expected.toml.")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
