"""The laws on the frame of the study where it yields; the rollout with softer models, and on the elastic frame.

python studies/rollout/yields.py [--resume] [--quick] [--json] [--threads N]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from argparse import Namespace
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

import mrwork as mr
from mrwork.closed_loop import SCORE
from mrwork.control import RolloutSettings
from mrwork.report import Table
from studies.former.arrays import Floats
from studies.former.command import Command, Findings, Say
from studies.former.records import ROOT, absent, ground_motions
from studies.former.scores import PEAKS, constant_commands, criteria
from studies.former.table import Cell, table_of
from studies.rollout.cases import LAW
from studies.rollout.findings import Kept, kept_in
from studies.rollout.loop import (
    CLEARLY,
    CONSTANTS,
    SIXTEEN,
    TRAINING,
    UNSEEN,
    Bench,
    Plant,
    bench_of,
    shortened,
)

HERE = Path(__file__).parent
WEAK, STRONG, ELASTIC = "0.1 g", "0.5 g", "0.5 g, frame that stays elastic"
_JUDGED, _BEST = (SIXTEEN, UNSEEN), "Best constant command of these motions"
# Laws of the study that are tried on this frame.
_TRIED = ("Predictive", "Passive-on", "Optimal", "Equal", "Clipped", "Network")
# Of the stiffness, in softer models of the rollout.
_SHARES = (0.8, 0.6)


def settings_on(bench: Bench) -> RolloutSettings:
    """The best constant command of the training motions, and the mean peaks under it."""
    best = bench.best_constant(TRAINING)
    peaks = bench.constants(TRAINING, Plant())[best].mean(axis=0)
    drift, acceleration = (float(peaks[SCORE.index(name)]) for name in PEAKS)
    return RolloutSettings(base=float(CONSTANTS[best]), drift=drift, acceleration=acceleration)


def rollout(bench: Bench, settings: RolloutSettings, softer: Floats | float = 1.0) -> mr.ControlLaw:
    """The rollout with an elastic model, each storey of which has this share of its stiffness."""
    problem, real = bench.study.problem, bench.study.building
    assert problem is not None
    stiffness = mr.buildings.chain(real.storeys, (softer * real.storey_stiffnesses).tolist())
    model = replace(problem, building=replace(real, stiffness=stiffness, elements=()))
    return mr.control.design_law(LAW, model, settings)


def secants(bench: Bench) -> Floats:
    """Secant over elastic stiffness of each storey, at its mean peak under the best constant training command."""
    study, frame = bench.study, bench.study.building
    law, motions = constant_commands(settings_on(bench).base), bench.motions[TRAINING]
    runs = mr.simulate_loop(frame, study.devices, law, motions, study.hardware, threads=bench.threads)
    ductility = np.maximum(runs.peak_drift.mean(axis=0) / frame.yield_drifts, 1.0)
    after = frame.storey_springs / frame.storey_stiffnesses
    return np.asarray((1.0 + after * (ductility - 1.0)) / ductility)


def row_of(
    bench: Bench, laws: Mapping[str, mr.ControlLaw], devices: Sequence[mr.Device], yield_drift: float
) -> dict[str, Any]:
    """The law of each group of test motions, beside the constant command that is best under the same."""
    study, found = bench.study, {}
    for group, law in laws.items():
        loop = study.building, devices, law, bench.motions[group], study.hardware
        own = criteria(*loop, threads=bench.threads, names=(*SCORE, "residual_drift_ratio"))[0]
        over = own[:, :-1] / bench.constants(group, Plant())[bench.best_constant(group)]
        ductility = own[:, SCORE.index("peak_drift")] / yield_drift
        found[group] = {
            **bench.judge(own[:, :-1], group, Plant()),
            **{name: float(over[:, SCORE.index(name)].mean()) for name in PEAKS},
            **{"ductility": float(ductility.mean()), "largest_ductility": float(ductility.max())},
            "residual": float(100.0 * own[:, -1].mean()),
        }
    return found


def yields_found(weak: Bench, strong: Bench, kept: Kept, say: Say) -> dict[str, Any]:
    """Rows of the levels with the best constant commands of their motions, and secants of the storeys."""
    frame = strong.study.building
    levels = {WEAK: (weak, frame), STRONG: (strong, frame), ELASTIC: (strong, replace(frame, elements=()))}
    benches = {
        name: replace(bench, study=replace(bench.study, building=building), constants_by_plant={})
        for name, (bench, building) in levels.items()
    }
    say("constant commands")
    bench, softer = benches[STRONG], secants(benches[STRONG])
    ours, believed = settings_on(bench), settings_on(benches[ELASTIC])
    rollouts: dict[str, dict[str, mr.ControlLaw]] = {
        WEAK: {},
        STRONG: {
            "Rollout, peaks of the elastic frame": rollout(bench, believed),
            **{f"Rollout, stiffness of its model x {each:g}": rollout(bench, ours, each) for each in _SHARES},
            "Rollout, model of secant stiffness": rollout(bench, ours, softer),
        },
        # In the place of that with the peaks of the frame that yields.
        ELASTIC: {"Predictive rollout": rollout(bench, believed)},
    }
    found: dict[str, Any] = {"secants": softer.tolist(), "levels": {}}
    for level, each in benches.items():
        laws, devices = {"Passive-off": constant_commands(0.0)}, {}
        for arrangement in each.study.arrangements:
            if (label := arrangement.row.label).startswith(_TRIED):
                laws[label] = arrangement.law or constant_commands(settings_on(each).base)
                devices[label] = arrangement.devices
        best = {group: float(CONSTANTS[each.best_constant(group)]) for group in _JUDGED}
        of_groups = {label: dict.fromkeys(_JUDGED, law) for label, law in {**laws, **rollouts[level]}.items()}
        of_groups[_BEST] = {group: constant_commands(command) for group, command in best.items()}
        rows = {}
        for label, law_of in of_groups.items():
            say(step := f"{level}: {label}")
            loop = each, law_of, devices.get(label, each.study.devices), float(frame.yield_drifts.max())
            rows[label] = kept.once(step, partial(row_of, *loop))
        found["levels"][level] = {"best": best, "laws": rows}
    return found


_COLUMNS: Mapping[str, str] = {
    "larger ratio": "{larger:.3f}",
    "peak drift": "{peak_drift:.3f}",
    "peak acc.": "{peak_acceleration:.3f}",
    f"both by {CLEARLY:.0%}": "{clearly} of {motions}",
    "ductility": "{ductility:.2f}",
    "its largest": "{largest_ductility:.2f}",
    "residual [%]": "{residual:.2f}",
}


def tables(found: Mapping[str, Any]) -> Iterator[Table]:
    """A table for each level."""
    columns: dict[str, Cell] = {
        f"{group}: {title}": lambda row, group=group, cell=cell: cell.format_map(row[group])
        for group in _JUDGED
        for title, cell in _COLUMNS.items()
    }
    for level, figures in found["levels"].items():
        best = ", ".join(f"{command:.3g} A of the {group}" for group, command in figures["best"].items())
        yield table_of(level, "law", figures["laws"], columns, note=f"Best constant commands: {best}.")


def find(options: Namespace, say: Say) -> Findings | int:
    if missing := absent("nothing can be judged: the measured motions are", ground_motions() / "real"):
        say(missing)
        return 2
    files = (HERE / name for name in ("chosen_01.toml", "yields.toml"))
    benches = [bench_of(mr.read_study(file), threads=options.threads) for file in files]
    weak, strong = map(shortened, benches) if options.quick else benches
    kept = kept_in(ROOT / "out" / "rollout" / f"yields{'_quick' * options.quick}.json", resume=options.resume)
    found = {"yields": yields_found(weak, strong, kept, say)}
    return Findings(numbers=found, text=tables(found["yields"]), judged={} if options.quick else found)


if __name__ == "__main__":
    command = Command(__file__, __doc__, quick="the first seconds of two motions of each group", threads=True)
    command.parser.add_argument("--resume", action="store_true", help="continue a run that was ended")
    sys.exit(command.run(find))
