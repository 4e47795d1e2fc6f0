"""Course of a study: where it stands, and how long it will take, by the cost of its runs and the rate of those done."""

from __future__ import annotations

import math
import os
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mrwork.base.numbers import duration_in_words
from mrwork.base.progress import ProgressReport
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.user_law import UserLaw
from mrwork.control.laws.control_law import ControlLaw
from mrwork.motions import GroundMotion
from mrwork.study.study import Arrangement, commands_force
from mrwork.workers.engine import by_whom

Kind = Literal["without dampers", "core", "rollout", "Python", "JAX"]
"""What a row is simulated by: runs of one kind have one rate."""

_CORE: Kind = "core"


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyProgress(ProgressReport):
    """Progress of a study: the label of the present runs, those done and in total, elapsed time [s].

    `left` is the time that is left [s], `None` where it is not known, as before the first runs of a kind are done.
    """

    label: str
    done: int = 0
    total: int = 0
    seconds: float = 0.0
    left: float | None = None

    @property
    def in_words(self) -> str:
        """Progress in one line: completed runs, the next ones, the remaining time."""
        runs = [f"{self.done} of {self.total} runs"] if self.total else []
        left = [] if self.left is None else [f"about {duration_in_words(self.left)} left"]
        return ", ".join([*runs, self.label, duration_in_words(self.seconds), *left])

    @property
    def share(self) -> float | None:
        """Share of the time that has passed; `None` if unknown."""
        return None if self.left is None else self.seconds / max(self.seconds + self.left, 1e-9)


class Course:
    """Reports of runs in progress, of which `costs` are the sums by kind; recalled runs do not count for a rate."""

    def __init__(
        self,
        on_progress: Callable[[StudyProgress], bool | None] | None = None,
        costs: Mapping[Kind, float] | None = None,
        total: int = 0,
    ) -> None:
        self._on_progress, self._total, self._left = on_progress, total, Counter(costs)
        self._seconds, self._simulated = Counter[Kind](), Counter[Kind]()
        # Of the present runs: kind, cost and the share that has been simulated, label, and runs before them.
        self._kind, self._cost, self._share, self._label, self._done = _CORE, 0.0, 0.0, "", 0
        self._began = self._part_began = time.perf_counter()

    def begin(self, label: str, kind: Kind = _CORE, cost: float = 0.0, done: int = 0) -> None:
        """Report that runs of a kind begin, before which so many were done; the runs before end."""
        self._left, self._seconds, self._simulated = self._standing(1.0)
        self._kind, self._cost, self._share, self._label, self._done = kind, cost, 0.0, label, done
        self._part_began = time.perf_counter()
        self.advance(0, 1)

    def advance(self, done: int, total: int) -> None:
        """Report how many of the present runs have been simulated."""
        self._share = done / total
        if self._on_progress is None or done == total:
            return
        within = f" {done:,} of {total:,}" if done else ""
        self._on_progress(
            StudyProgress(
                done=self._done,
                total=self._total,
                label=f"{self._label}{within}{by_whom()}",
                seconds=time.perf_counter() - self._began,
                left=self._time_left(),
            )
        )

    def _standing(self, gone: float) -> tuple[Counter[Kind], ...]:
        """By kind: cost that is left where this share of the present runs is gone, seconds and what they simulated."""
        passed = time.perf_counter() - self._part_began if self._share else 0.0
        parts = (gone * self._cost, passed, self._share * self._cost)
        left, seconds, simulated = (Counter({self._kind: part}) for part in parts)
        return self._left - left, self._seconds + seconds, self._simulated + simulated

    def _time_left(self) -> float | None:
        left, seconds, simulated = self._standing(self._share)
        if not self._total:
            return None
        rates = {kind: seconds[kind] / cost for kind, cost in simulated.items()}
        if _CORE in rates:
            rates.setdefault("rollout", rates[_CORE])
        return sum(left[kind] * rates[kind] for kind in left) if left.keys() <= rates.keys() else None


# Runs that one thread does at once where there are as many, with any law and with a rollout.
_LANES, _LANES_OF_ROLLOUT = 32, 16
# What a step of all trials of a rollout costs, in steps of the loop.
_TRIALS = 4.0
# Steps per second of the model of a rollout, where its law says none.
_MODEL_STEPS = 400.0


def kind_of(arrangement: Arrangement) -> Kind:
    """What the runs of an arrangement are simulated by."""
    law = arrangement.law
    if not arrangement.devices:
        return "without dampers"
    if isinstance(law, UserLaw):
        return "Python"
    if any(device.spec.own is not None for device in arrangement.devices) and not commands_force(law):
        return "JAX"
    return "core" if law is None or not law.spec.needs_model else "rollout"


def cost_of(
    arrangement: Arrangement,
    motions: Sequence[GroundMotion],
    hardware: Hardware,
    n_each: int,
    threads: int = 0,
) -> float:
    """Integration steps times coordinates of runs, `n_each` under each motion, where lanes and threads are full."""
    law, lanes = arrangement.law, _LANES
    steps = hardware.steps / hardware.sample_time
    if isinstance(law, ControlLaw) and law.spec.needs_model:
        lanes = _LANES_OF_ROLLOUT
        decision, step, *_ = np.ravel(law.tables["timing"]).tolist()
        steps += (
            _TRIALS * float(np.max(law.gains["horizon"])) * (1.0 / step if step else _MODEL_STEPS) / decision
        )
    rounds = math.ceil(n_each * len(motions) / lanes / (threads or os.cpu_count() or 1))
    seconds = sum(motion.duration for motion in motions) / max(len(motions), 1)
    return steps * seconds * rounds * arrangement.building.n_coordinates
