"""Chapter 2 of the thesis: every family of devices on one frame under the same motions, and closed forms.

python studies/chapter_2/study.py [--quick] [--json] [--threads N] [--out DIRECTORY]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from studies.chapter_2.findings import chapter_of
from studies.chapter_2.page import write_page
from studies.chapter_2.tables import tables
from studies.former.command import run_chapter

if __name__ == "__main__":
    quick = "few settings, one short motion"
    sys.exit(
        run_chapter(
            __file__, __doc__, quick=quick, chapter_of=chapter_of, write_page=write_page, tables=tables
        )
    )
