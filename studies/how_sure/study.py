"""How much of a test that the fit has not seen lies inside its 90 % band.

python studies/how_sure/study.py [single] [joint] [synthetic] [--replicates N] [--seed N] [--threads N] [--json]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import json
import time
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from studies.common.command import Command
from studies.common.records import absent, damper_tests
from studies.how_sure import joint_model, single_test, synthetic_calibration
from studies.how_sure.scores import BandScore, lines, table

PARTS = ("single", "joint", "synthetic")


def measured(options: Namespace, part: str) -> dict[str, Sequence[BandScore]]:
    if part == "single":
        return {
            "A fit to 10 mm, 1 Hz, asked for the five other motions at its current": single_test.all_outcomes(
                rng=options.seed, threads=options.threads
            )
        }
    result = {}
    for fold, what in (("motion", "a motion"), ("command", "a current")):
        found = joint_model.left_out(fold, rng=options.seed, threads=options.threads)
        outcomes = list(joint_model.outcomes_of(found, rng=options.seed))
        result[f"A joint model, asked for {what} that it was identified without"] = outcomes
    return result


def main() -> int:
    parser = Command(__file__, __doc__, threads=True, seed=(0, "of the synthetic cases and the draws")).parser
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; default all")
    parser.add_argument("--replicates", type=int, default=100, help="of each synthetic case")
    options = parser.parse_args()
    for part in options.parts:
        if part not in PARTS:
            parser.error(f"there is no part {part!r}; give {', '.join(PARTS)}")
    document: dict[str, Any] = {}
    for part in options.parts or PARTS:
        begun = time.perf_counter()
        if part == "synthetic":
            document[part] = []
            print(synthetic_calibration.HEAD, flush=True)
            for case in synthetic_calibration.cases(
                options.replicates, rng=options.seed, threads=options.threads
            ):
                document[part].append(asdict(case))
                print(synthetic_calibration.line(case), flush=True)
        elif reason := absent(f"skipped {part}: the records are", damper_tests()):
            print(reason)
            continue
        else:
            for title, outcomes in measured(options, part).items():
                document[title] = [asdict(each) for each in outcomes]
                print(lines(title, table(outcomes)), flush=True)
        print(f"({part}: {time.perf_counter() - begun:.0f} s)", flush=True)
    if options.json:
        print(json.dumps(document))
    return 0


if __name__ == "__main__":
    sys.exit(main())
