"""Laws tuned on synthetic motions and judged on measured ones; what uncertainty does to them, and what is left.

python studies/robust_control/study.py [--level "0.1 g"] [--clairvoyants N] [--json] [--threads N] [--out DIRECTORY]
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

from mrwork.report import departures
from robust_damper import identified
from robust_findings import LEVELS, found_by
from robust_tables import tables

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
# Where the files of the levels name the motions.
MEASURED = ROOT.parent / "shared" / "data" / "records" / "real"


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--level", action="append", choices=LEVELS, help="one level of the motions; repeat for more"
    )
    parser.add_argument(
        "--clairvoyants",
        type=int,
        default=4,
        help="test motions with a clairvoyant, minutes each; 0 for none",
    )
    parser.add_argument("--quick", action="store_true", help="a few candidates of two laws, no clairvoyant")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")
    parser.add_argument("--threads", type=int, default=0, help="threads of the simulations, 0 for all")
    parser.add_argument(
        "--out", type=Path, default=ROOT / "out" / "robust_control", help="where the page goes"
    )
    options = parser.parse_args()
    began = time.perf_counter()

    def say(what: str) -> None:
        print(f"{time.perf_counter() - began:6.0f} s  {what}", file=sys.stderr, flush=True)

    if not MEASURED.is_dir():
        say(f"no measured motions at {MEASURED}, so nothing can be judged; put them there")
        return 2
    # The files of the levels name this folder.
    identified(ROOT / "out" / "robust_control", say)
    found = found_by(
        options.level or list(LEVELS),
        clairvoyants=0 if options.quick else options.clairvoyants,
        threads=options.threads,
        quick=options.quick,
        say=say,
    )
    wrong = [] if options.quick else departures(found, HERE / "expected.toml")
    if not options.quick:
        from robust_page import write_page

        write_page(found, options.out / "report.html")
        (options.out / "found.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
    if options.json:
        print(json.dumps({**found, "departures": wrong}))
    else:
        print("\n".join(table.markdown() for table in tables(found)))
        print("\n".join(wrong) or "Every figure agrees with expected.toml.")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
