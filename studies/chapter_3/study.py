"""Chapter 3 of the thesis: fluids, flow, a published damper, dampers sized for a frame, four models on one test.

python studies/chapter_3/study.py [--quick] [--json] [--threads N] [--out DIRECTORY]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from studies.chapter_3.findings import chapter_of
from studies.chapter_3.page import write_page
from studies.chapter_3.tables import tables
from studies.former.command import run_chapter

if __name__ == "__main__":
    quick = "one sized damper, one motion, three models"
    sys.exit(
        run_chapter(
            __file__, __doc__, quick=quick, chapter_of=chapter_of, write_page=write_page, tables=tables
        )
    )
