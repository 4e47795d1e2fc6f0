"""How much of a test that the fit has not seen lies inside its 90 % band.

python studies/how_sure/study.py [single] [joint] [synthetic] [--replicates N] [--seed N] [--threads N] [--json]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from argparse import Namespace
from dataclasses import asdict
from typing import Any

from mrwork.report import Table
from studies.former.command import Command, Findings, Say
from studies.former.records import absent, damper_tests
from studies.how_sure import joint_model, single_test, synthetic_calibration
from studies.how_sure.scores import score_table

PARTS = ("single", "joint", "synthetic")


def find(options: Namespace, say: Say) -> Findings:
    for part in options.parts:
        if part not in PARTS:
            command.parser.error(f"there is no part {part!r}; give {', '.join(PARTS)}")
    numbers: dict[str, Any] = {}
    text: list[str | Table] = []
    ways = {"rng": options.seed, "threads": options.threads, "say": say}
    for part in options.parts or PARTS:
        if part == "synthetic":
            cases = list(synthetic_calibration.cases(options.replicates, **ways))
            numbers[part] = [asdict(case) for case in cases]
            text.append(synthetic_calibration.table(cases))
        elif reason := absent(f"skipped {part}: the records are", damper_tests()):
            text.append(reason)
        else:
            module = single_test if part == "single" else joint_model
            for title, scores in module.scores_by_title(**ways):
                numbers[title] = [asdict(score) for score in scores]
                text.append(score_table(title, scores))
    return Findings(numbers=numbers, text=text, judged={}, agreement="")


if __name__ == "__main__":
    command = Command(__file__, __doc__, threads=True, seed=(0, "of the synthetic cases and the draws"))
    command.parser.add_argument(
        "parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; default all"
    )
    command.parser.add_argument("--replicates", type=int, default=100, help="of each synthetic case")
    sys.exit(command.run(find))
