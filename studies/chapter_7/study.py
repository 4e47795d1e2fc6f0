"""Chapter 7 of the thesis: a virtual shake table, the frame and its damper identified on it, control, and predictions.

python studies/chapter_7/study.py [--quick] [--json] [--threads N] [--out DIRECTORY]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from argparse import Namespace
from itertools import chain

from studies.chapter_7.findings import chapter_of
from studies.chapter_7.tables import tables
from studies.common.command import Command, Findings, Say
from studies.common.records import ground_motions


def find(options: Namespace, say: Say) -> Findings:
    records = ground_motions() if ground_motions().is_dir() else None
    chapter = chapter_of(quick=options.quick, records=records, threads=options.threads, say=say)
    if not options.quick:
        from studies.chapter_7.page import write_page

        write_page(chapter, options.out / "report.html")
    return Findings(numbers=chapter.found, text=chain(*tables(chapter.found).values()))


if __name__ == "__main__":
    quick = "one synthetic motion, fewer sine tests and settings"
    sys.exit(Command(__file__, __doc__, quick=quick, threads=True, out=True).run(find))
