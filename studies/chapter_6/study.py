"""Chapter 6: buildings with MR dampers under earthquakes, every control law beside honest baselines.

python studies/chapter_6/study.py [--tune [LAW ...] [--near]] [--level LEVEL ...] [--quick] [--json] [--out DIRECTORY]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import time
from argparse import Namespace
from itertools import chain

from studies.chapter_6.loop_findings import ACTIVE, TUNED_LAWS, found_by, tune
from studies.chapter_6.page import write_page
from studies.chapter_6.tables import remarks, tables
from studies.chapter_6.thesis_tables import thesis_tables
from studies.chapter_6.tuning import keep
from studies.former.command import Command, Findings, Say, Work
from studies.former.frame import LEVELS, bench, level_name
from studies.former.records import absent, ground_motions


def find(options: Namespace, say: Say) -> Findings:
    began = time.perf_counter()
    if missing := absent("the records are", ground_motions()):
        command.parser.error(missing)
    work = Work.of(options, say)
    if options.tune is not None:
        keep(tune(bench(work.records), options.tune or (*TUNED_LAWS, *ACTIVE), say, near=options.near))
    found = found_by(work)
    found["seconds"] = time.perf_counter() - began
    if not options.quick:
        say("page")
        write_page(found, options.out / "report.html", levels=options.level, records=work.records)
    floors = chain(*thesis_tables(found, options.level).values())
    return Findings(numbers=found, text=(*tables(found), *floors, *remarks(found)))


if __name__ == "__main__":
    command = Command(
        __file__, __doc__, quick="a few laws, no conditions, no million runs", threads=False, out=True
    )
    add = command.parser.add_argument
    add(
        "--tune",
        nargs="*",
        choices=(*TUNED_LAWS, *ACTIVE),
        metavar="LAW",
        help="search the settings of these laws anew, of all where none is named, and write tuned.toml",
    )
    add("--near", action="store_true", help="search about the settings of tuned.toml instead of a grid")
    add(
        "--level",
        nargs="+",
        choices=[level_name(level) for level in LEVELS],
        default=[level_name(LEVELS[0])],
        help="levels whose sheets and tables of every floor are shown",
    )
    sys.exit(command.run(find))
