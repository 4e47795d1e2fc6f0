"""Chapter 7 of the thesis: a virtual shake table, the frame and its damper identified on it, control, and predictions.

python studies/chapter_7/study.py [--quick] [--json] [--threads N] [--out DIRECTORY]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from studies.chapter_7.findings import chapter_of
from studies.chapter_7.page import write_page
from studies.chapter_7.tables import tables
from studies.former.command import run_chapter

if __name__ == "__main__":
    quick = "one synthetic motion, fewer sine tests and settings"
    sys.exit(
        run_chapter(
            __file__, __doc__, quick=quick, chapter_of=chapter_of, write_page=write_page, tables=tables
        )
    )
