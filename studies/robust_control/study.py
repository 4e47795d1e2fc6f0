"""Laws tuned on synthetic motions and judged on measured ones; what uncertainty does to them, and what is left.

python studies/robust_control/study.py [--level "0.1 g"] [--clairvoyants N] [--resume] [--quick] [--json] [--threads N]
                                       [--workers N | --cluster ADDRESS]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import json
from argparse import Namespace

import mrwork as mr
from studies.former.command import Findings, Say, levels_command
from studies.former.records import ROOT
from studies.robust_control.findings import level_found
from studies.robust_control.runs import identified, tuned
from studies.robust_control.tables import tables

HERE = Path(__file__).parent
LEVELS = {"0.1 g": HERE / "level_01.toml", "0.3 g": HERE / "level_03.toml"}
# Where these files name the damper and the motions.
OUT = ROOT / "out" / "robust_control"
MEASURED = ROOT.parent / "shared" / "data" / "records" / "real"


def find(options: Namespace, say: Say) -> Findings | int:
    if not MEASURED.is_dir():
        say(f"no measured motions at {MEASURED}, so nothing can be judged; put them there")
        return 2
    identified(OUT, say)
    computation = ["--threads", str(options.threads), "--workers", str(options.workers)]
    if options.cluster is not None:
        computation += ["--cluster", options.cluster]
    found = {}
    for level in options.level or LEVELS:
        file = LEVELS[level]
        say(f"laws at {level}")
        results = tuned(
            file,
            OUT / (f"{file.stem}_quick" if options.quick else file.stem),
            computation=computation,
            quick=options.quick,
            resume=options.resume,
        )
        with mr.on_workers(options):
            found[level] = level_found(
                mr.read_study(file),
                results,
                clairvoyants=0 if options.quick else options.clairvoyants,
                threads=options.threads,
                say=say,
            )
    if not options.quick:
        from studies.robust_control.page import write_page

        write_page(found, OUT / "report.html")
        (OUT / "found.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
    return Findings(numbers=found, text=tables(found), judged={} if options.quick else found)


if __name__ == "__main__":
    command = levels_command(
        __file__,
        __doc__,
        LEVELS,
        quick="a few candidates of one law, no clairvoyant",
        clairvoyants=4,
        resume="continue tunings that were begun, or read them",
    )
    sys.exit(command.run(find))
