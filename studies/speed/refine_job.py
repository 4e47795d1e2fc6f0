"""The problems of `study.py refine`: starting points as a global search leaves them, and the minimum to be reached.

One record: the normalised Bouc-Wen model on the reference test of `study.py identify`, 7 free parameters. Joint:
the same model with k_w cubic and c linear in the current on all sinusoids of the rig, 11 free parameters. A start
is the result of a short local minimisation, each parameter times e^N(0, 0.2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrwork.dampers import Box, DamperSpec, LawName, damper
from mrwork.identification import LevelFit, Objective, find_minima, joint_starts, levels_of, search_box
from mrwork.search import Streams, latin_hypercube
from studies.former.arrays import Floats
from studies.former.rig import sinusoids, thinned
from studies.speed.search_job import REFERENCE, record

MODEL = "normalised_bouc_wen"
LAWS: dict[str, LawName] = {"k_w": "cubic", "c": "linear"}
_SAMPLES = 20
_FIRST_ITERATIONS = 6
_SPREAD = 0.2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RefineJob:
    """A model, its tests and starts, shape (n_starts, n_params), inside the box."""

    name: str
    objective: Objective
    box: Box
    starts: Floats

    @property
    def spec(self) -> DamperSpec:
        """The model."""
        return self.objective.spec

    @property
    def synthetic(self) -> bool:
        """Whether an embedded test stands in for the measured ones."""
        return any(test.synthetic for test in self.objective.tests)


def reference_job(seeds: int, threads: int) -> RefineJob:
    """One record."""
    spec = damper(MODEL)
    test = record(REFERENCE)
    box = Box.of(spec)
    objective = Objective.of(spec, (test,), threads=threads)
    searched = search_box(spec, box, (test,))
    find = _find(objective, box, searched)
    spread = np.exp(_SPREAD * np.random.default_rng(0).standard_normal((seeds, len(find))))
    starts = np.clip(find * spread, box.lower, box.upper)
    return RefineJob(name="reference", objective=objective, box=box, starts=starts)


def joint_job(seeds: int, threads: int) -> RefineJob | None:
    """All sinusoids of the rig at once; `None` where the measured records are absent."""
    tests = tuple(map(thinned, sinusoids()))
    if not tests:
        return None
    plain = damper(MODEL)
    levels = []
    for command, group in levels_of(plain.with_current_laws(LAWS), tests).items():
        objective = Objective.of(plain, group, threads=threads)
        searched = search_box(plain, Box.of(plain), group)
        find = _find(objective, Box.of(plain), searched)
        levels.append(LevelFit(command=command, minima=find[None]))
    spec = plain.with_current_laws(LAWS)
    box = Box.of(spec)
    through = joint_starts(spec, levels, 1, rng=0)[0]
    spread = np.exp(_SPREAD * np.random.default_rng(1).standard_normal((seeds, len(through))))
    return RefineJob(
        name="joint",
        objective=Objective.of(spec, tests, threads=threads),
        box=box,
        starts=np.clip(through * spread, box.lower, box.upper),
    )


def _find(objective: Objective, box: Box, searched: Box) -> Floats:
    """The best of a Latin hypercube after a short local minimisation from each of its best few, shape (n_params,)."""
    n_free = len(searched.free)
    streams = Streams(rng=0, replicate=np.zeros(1, dtype=np.int64), generation=np.zeros(1, dtype=np.int64))
    sample = np.asarray(searched.theta_from_unit(latin_hypercube(streams, _SAMPLES * n_free, n_free)[0]))
    best = sample[np.argsort(objective(sample), kind="stable")[:8]]
    minima = find_minima(objective, box, best, max_iterations=_FIRST_ITERATIONS)
    return np.asarray(minima.theta[np.argmin(minima.misfit)])
