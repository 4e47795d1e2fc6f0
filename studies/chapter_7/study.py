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
from studies.chapter_7.page import write_page
from studies.chapter_7.tables import tables
from studies.common.command import Command, Findings, Say, Work


def find(options: Namespace, say: Say) -> Findings:
    chapter = chapter_of(Work.of(options, say))
    if not options.quick:
        write_page(chapter, options.out / "report.html")
    return Findings(numbers=chapter.found, text=chain(*tables(chapter.found).values()))


if __name__ == "__main__":
    quick = "one synthetic motion, fewer sine tests and settings"
    sys.exit(Command(__file__, __doc__, quick=quick, threads=True, out=True).run(find))
