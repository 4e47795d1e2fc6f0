"""Arguments of `write_page`, apart from it as the help of the command line draws no page."""

from __future__ import annotations

from typing import Annotated

from mrwork.base.hints import Says

Summary = Annotated[
    bool,
    Says(
        "write the front of the page alone, one screen or sheet of paper, as summary.html beside report.html"
    ),
]
EveryTest = Annotated[
    bool,
    Says(
        "of a fit: draw every test in full; by default up to four tests, of more the best, the median and the worst fit"
    ),
]
