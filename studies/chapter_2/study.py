"""Chapter 2 of the thesis: every family of devices on one frame under the same motions, and closed forms.

python studies/chapter_2/study.py [--quick] [--json] [--threads N] [--out DIRECTORY]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from argparse import Namespace
from itertools import chain

from studies.chapter_2.findings import chapter_of
from studies.chapter_2.page import write_page
from studies.chapter_2.tables import tables
from studies.common.command import Command, Findings, Say, Work


def find(options: Namespace, say: Say) -> Findings:
    chapter = chapter_of(Work.of(options, say))
    if not options.quick:
        write_page(chapter, options.out / "report.html")
    return Findings(numbers=chapter.found, text=chain(*tables(chapter.found).values()))


if __name__ == "__main__":
    command = Command(__file__, __doc__, quick="few settings, one short motion", threads=True, out=True)
    sys.exit(command.run(find))
