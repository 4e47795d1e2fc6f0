"""LQR weights from limits and a budget of force: what the program finds, and what it is worth in the true loop.

python studies/controller_weights/study.py [--quick] [--json] [--threads N] [--out DIRECTORY]
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path

from mrwork.report import departures
from weight_findings import found_by
from weight_tables import tables

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("MRWORK_DATA", ROOT.parent / "shared" / "data"))
RECORDS = DATA / "records"


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="two frames, two extensions, one record")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")
    parser.add_argument("--threads", type=int, default=0, help="threads of the simulations, 0 for all")
    parser.add_argument(
        "--out", type=Path, default=ROOT / "out" / "controller_weights", help="where the page goes"
    )
    options = parser.parse_args()
    began = time.perf_counter()

    def say(what: str) -> None:
        print(f"{time.perf_counter() - began:6.0f} s  {what}", file=sys.stderr, flush=True)

    if not RECORDS.is_dir():
        say(f"no records at {RECORDS}: the true loop is left out; point MRWORK_DATA at the data")
    found = found_by(quick=options.quick, records=RECORDS, threads=options.threads, say=say)
    wrong = departures(found, Path(__file__).parent / "expected.toml")
    if not options.quick:
        from weight_page import write_page

        options.out.mkdir(parents=True, exist_ok=True)
        write_page(found, options.out / "report.html")
    if options.json:
        print(json.dumps({**found, "departures": wrong}))
    else:
        print("\n".join(table.markdown() for table in tables(found)))
        for name, wish in found["unreachable"].items():
            print(f"{name}: {' '.join(wish['words'])}\n")
        print("\n".join(wrong) or "Every figure agrees with expected.toml.")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
