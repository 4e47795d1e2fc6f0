"""Grey-box identification of the Bouc-Wen benchmark of Noel and Schoukens, from force to displacement.

python studies/boucwen_benchmark/study.py [--json] [--out DIRECTORY] [--seed N]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import json
from argparse import Namespace

from studies.boucwen_benchmark.assessment import run, summary
from studies.boucwen_benchmark.error_report import write_report
from studies.former.command import Command, Findings, Say
from studies.former.records import absent, data


def find(options: Namespace, say: Say) -> Findings | int:
    record = data() / "benchmarks" / "boucwen" / "train_multisine.csv"
    if reason := absent("skipped: the benchmark's record is", record):
        print(json.dumps({"skipped": reason}) if options.json else reason)
        return 0
    study = run(record, options.seed)
    figures = summary(study)
    text = write_report(study, options.out)
    return Findings(
        numbers={
            "noise": study.noise,
            "starts": study.minima,
            "seconds_starts": study.seconds,
            "interpolations": figures,
        },
        judged=figures,
        text=(text, f"Report: {options.out / 'report.md'}"),
    )


if __name__ == "__main__":
    command = Command(__file__, __doc__, out=True, seed=(1, "of the random starts and the unseen multisine"))
    sys.exit(command.run(find))
