"""LQR weights from limits and a budget of force: what the program finds, and what it is worth in the true loop.

python studies/controller_weights/study.py [--quick] [--json] [--threads N] [--out DIRECTORY]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from argparse import Namespace
from typing import Any

from studies.controller_weights.designs import extensions, inverses, sizes, unreachable
from studies.controller_weights.loop import scanned
from studies.controller_weights.tables import tables
from studies.former.command import Command, Findings, Say
from studies.former.frame import LEVELS
from studies.former.records import absent, ground_motions


def find(options: Namespace, say: Say) -> Findings:
    if missing := absent("the true loop is left out: the records are", ground_motions()):
        say(missing)
    found = found_by(quick=options.quick, records=ground_motions(), threads=options.threads, say=say)
    if not options.quick:
        from studies.controller_weights.page import write_page

        write_page(found, options.out / "report.html")
    words = (f"{name}: {' '.join(wish['words'])}\n" for name, wish in found["unreachable"].items())
    return Findings(numbers=found, text=(*tables(found), *words))


def found_by(*, quick: bool, records: Path, threads: int, say: Say) -> dict[str, Any]:
    """Every figure, as nested dictionaries; the true loop where the records are at hand."""
    say("program and Riccati equations")
    found: dict[str, Any] = {"sizes": dict(sizes(quick=quick))}
    say("extensions")
    found["extensions"] = dict(extensions(quick=quick))
    say("inverse")
    found["inverses"] = dict(inverses(quick=quick))
    found["unreachable"] = unreachable()
    if records.is_dir():
        # The quick form scans less, under one record: its scores are others.
        loop = found["quick_loop" if quick else "true_loop"] = {}
        for level in LEVELS[:1] if quick else LEVELS:
            say(f"true loop, {level:g} g")
            loop[f"{level:g}"] = scanned(level, records, quick=quick, threads=threads)
    return found


if __name__ == "__main__":
    quick = "two frames, two extensions, one record"
    sys.exit(Command(__file__, __doc__, quick=quick, threads=True, out=True).run(find))
