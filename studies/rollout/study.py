"""The predictive rollout beside other laws on motions that chose nothing; in wrong loops; without its parts; its cost.

python studies/rollout/study.py [--level "0.1 g"] [--clairvoyants N] [--resume] [--quick] [--json] [--threads N]
                                [--workers N | --cluster ADDRESS]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import json
from argparse import Namespace
from functools import partial

import mrwork as mr
from studies.former.command import Findings, Say, levels_command
from studies.former.records import ROOT, absent, ground_motions
from studies.rollout.findings import cost_found, kept_in, level_found
from studies.rollout.loop import bench_of, shortened
from studies.rollout.tables import tables

HERE = Path(__file__).parent
LEVELS = {"0.1 g": HERE / "chosen_01.toml", "0.3 g": HERE / "chosen_03.toml"}
OUT = ROOT / "out" / "rollout"
# Test motions with a clairvoyant, the shortest first.
CLAIRVOYANTS = ("PFT135", "el_centro_1940_ns")


def find(options: Namespace, say: Say) -> Findings | int:
    if missing := absent("nothing can be judged: the measured motions are", ground_motions() / "real"):
        say(missing)
        return 2
    kept = kept_in(OUT / ("quick.json" if options.quick else "runs.json"), resume=options.resume)
    found: dict[str, object] = {}
    levels = options.level or (["0.1 g"] if options.quick else list(LEVELS))
    for level in levels:
        bench = bench_of(mr.read_study(LEVELS[level]), threads=options.threads)
        if options.quick:
            bench = shortened(bench)
        with mr.on_workers(options):
            found[level] = level_found(
                level,
                bench,
                kept,
                quick=options.quick,
                clairvoyants=() if options.quick else CLAIRVOYANTS[: options.clairvoyants],
                say=say,
            )
    # Of this process.
    say("cost")
    figures = {"levels": found, "cost": kept.once("cost", partial(cost_found, bench))}
    if not options.quick:
        from studies.rollout.page import write_page

        write_page(figures, OUT / "report.html")
        (OUT / "found.json").write_text(json.dumps(figures, indent=1), encoding="utf-8")
    return Findings(numbers=figures, text=tables(figures), judged={} if options.quick else figures)


if __name__ == "__main__":
    command = levels_command(
        __file__,
        __doc__,
        LEVELS,
        quick="the first seconds of two motions at 0.1 g, two wrong loops and parts, no clairvoyant",
        clairvoyants=len(CLAIRVOYANTS),
        resume="continue a study that was ended",
    )
    sys.exit(command.run(find))
