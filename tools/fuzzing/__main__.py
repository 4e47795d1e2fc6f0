"""Read mutants of every file that the package reads; exit status 1 where one leads to more than a sentence."""

from __future__ import annotations

import argparse
import gc
import os
import shutil
import signal
import sys
from pathlib import Path

from tools.fuzzing.harness import Harness
from tools.fuzzing.readers import all_readers

ROOT = Path(__file__).parents[2]


def main() -> int:
    """Run the harness as its options say."""
    parser = argparse.ArgumentParser(prog="fuzzing", description=__doc__)
    parser.add_argument(
        "--mutants", type=int, default=1_000_000, help="of all readers together (default 1000000)"
    )
    parser.add_argument(
        "--processes", type=int, default=os.cpu_count() or 1, help="at a time (default: the cores)"
    )
    parser.add_argument(
        "--first", type=int, default=0, help="number of the first mutant of each seed (default 0)"
    )
    parser.add_argument("--reader", default="", help="only readers whose name contains this")
    parser.add_argument(
        "--out", type=Path, default=ROOT / "out" / "faults", help="folder for failures (default out/faults)"
    )
    options = parser.parse_args()
    # A background job of a shell ignores Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    shutil.rmtree(options.out, ignore_errors=True)
    readers = [reader for reader in all_readers() if options.reader in reader.name]
    for reader in readers:
        reader.check()
    # What is there now, no process that is forked looks through for garbage: that would copy all of it.
    gc.collect()
    gc.freeze()
    harness = Harness(
        readers, options.mutants, n_processes=options.processes, kept=options.out, first=options.first
    )
    status = 0
    try:
        harness.run(lambda line: print(line, file=sys.stderr, flush=True))
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        status = 130
    print(harness.table())
    for line in harness.causes():
        print(line)
    if harness.n_failures:
        print(f"failures are in {options.out}")
        return 1
    return status


if __name__ == "__main__":
    sys.exit(main())
