"""Laws tuned on synthetic motions and judged on measured ones; what uncertainty does to them, and what is left.

python studies/robust_control/study.py [--level "0.1 g"] [--clairvoyants N] [--resume] [--quick] [--json] [--threads N]
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import mrwork as mr
from mrwork.report import departures
from robust_findings import level_found
from robust_runs import identified, tuned
from robust_tables import tables

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
LEVELS = {"0.1 g": HERE / "level_01.toml", "0.3 g": HERE / "level_03.toml"}
# Where these files name the damper and the motions.
OUT = ROOT / "out" / "robust_control"
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
    parser.add_argument(
        "--resume", action="store_true", help="continue tunings that were begun, or read them"
    )
    parser.add_argument("--quick", action="store_true", help="a few candidates of one law, no clairvoyant")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")
    parser.add_argument("--threads", type=int, default=0, help="threads of the simulations, 0 for all")
    options = parser.parse_args()
    began = time.perf_counter()

    def say(what: str) -> None:
        print(f"{time.perf_counter() - began:6.0f} s  {what}", file=sys.stderr, flush=True)

    if not MEASURED.is_dir():
        say(f"no measured motions at {MEASURED}, so nothing can be judged; put them there")
        return 2
    identified(OUT, say)
    found = {}
    for level in options.level or LEVELS:
        file = LEVELS[level]
        say(f"laws at {level}")
        results = tuned(
            file,
            OUT / (f"{file.stem}_quick" if options.quick else file.stem),
            threads=options.threads,
            quick=options.quick,
            resume=options.resume,
        )
        found[level] = level_found(
            mr.read_study(file),
            results,
            clairvoyants=0 if options.quick else options.clairvoyants,
            threads=options.threads,
            say=say,
        )
    wrong = [] if options.quick else departures(found, HERE / "expected.toml")
    if not options.quick:
        from robust_page import write_page

        write_page(found, OUT / "report.html")
        (OUT / "found.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
    if options.json:
        print(json.dumps({**found, "departures": wrong}))
    else:
        print("\n".join(table.markdown() for table in tables(found)))
        print("\n".join(wrong) or "Every figure agrees with expected.toml.")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
