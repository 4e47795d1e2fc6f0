"""Chapter 3 of the thesis: fluids, flow, a published damper, dampers sized for a frame, four models on one test.

python studies/chapter_3/study.py [--quick] [--json] [--threads N] [--out DIRECTORY]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from argparse import Namespace
from itertools import chain

from studies.chapter_3.findings import chapter_of
from studies.chapter_3.page import write_page
from studies.chapter_3.tables import tables
from studies.common.command import Command, Findings, Say, Work
from studies.common.records import absent, ground_motions


def find(options: Namespace, say: Say) -> Findings:
    skipped = absent("Skipped: the records are", ground_motions())
    chapter = chapter_of(Work.of(options, say))
    if not options.quick:
        write_page(chapter, options.out / "report.html", skipped=skipped)
    return Findings(
        numbers={**chapter.found, "skipped": skipped},
        judged=chapter.found,
        text=chain(*tables(chapter.found).values()),
        remark=skipped,
    )


if __name__ == "__main__":
    quick = "one sized damper, one motion, three models"
    sys.exit(Command(__file__, __doc__, quick=quick, threads=True, out=True).run(find))
