"""Chapter 2 of the thesis: every family of devices on one frame under the same motions, and closed forms.

python studies/chapter_2/study.py [--quick] [--json] [--threads N] [--out DIRECTORY]
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

# The frame and its records are those of chapter 6.
sys.path.append(str(Path(__file__).parents[1] / "chapter_6"))

from chapter_2_findings import chapter_of
from chapter_2_tables import tables
from mrwork.report import departures

ROOT = Path(__file__).parents[2]


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="few settings, one short motion")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")
    parser.add_argument("--threads", type=int, default=0, help="threads of the simulations, 0 for all")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "chapter_2", help="where the page goes")
    options = parser.parse_args()
    began = time.perf_counter()

    def say(what: str) -> None:
        print(f"{time.perf_counter() - began:6.0f} s  {what}", file=sys.stderr, flush=True)

    chapter = chapter_of(quick=options.quick, threads=options.threads, say=say)
    wrong = departures(chapter.found, Path(__file__).parent / "expected.toml")
    if not options.quick:
        from chapter_2_page import write_page

        write_page(chapter, options.out / "report.html")
    if options.json:
        print(json.dumps({**chapter.found, "departures": wrong}))
    else:
        print("\n".join(table.markdown() for section in tables(chapter.found).values() for table in section))
        print("\n".join(wrong) or "Every figure agrees with expected.toml.")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
