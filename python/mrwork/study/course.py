"""Course of a study: where it stands, and how long it will take, by trials of a small part of what it simulates.

A part of the runs under a part of each motion costs a known share of the whole, with the same integration steps where
the trial moves the building as far. Runs that are done correct what the trials have promised.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from mrwork.base.numbers import duration_in_words, of_unit
from mrwork.base.progress import ProgressReport
from mrwork.base.summary import list_names
from mrwork.buildings import Building
from mrwork.buildings.matrices import Device
from mrwork.closed_loop.hardware import Hardware
from mrwork.dampers.coordinates import Box, bound_at
from mrwork.errors import MrworkError
from mrwork.motions.ground_motion import GroundMotion, replace_samples
from mrwork.motions.spectrum import response_spectrum
from mrwork.workers.engine import by_whom

Kind = Literal["settings", "levels", "runs", "half", "realisations"]
PartKey = tuple[int, Kind]
"""Row, and what is simulated of it: candidates from which a law's settings are taken (numbers of laws, not of rows),
constant commands to choose from, its runs, the same with half the step, its realisations."""

# Share of a part that its trials may cost, and the longest of them [s].
_COST, _LONGEST = 0.02, 1.0
# Steps of a sample from which on that share is larger, since a short excerpt wants half the steps of a motion.
_STIFF, _STIFF_COST = 16, 0.08
# A part that takes less needs no further trial [s].
_SHORT = 0.3
_FIRST_SHARE, _GROWTH = 1e-3, 16.0
# Finished parts that took less do not correct what is expected of others [s].
_TELLING = 0.3
# Samples of a motion that are compared with those of its excerpt; the largest factor of an excerpt.
_COMPARED, _LARGEST_FACTOR = 10_000, 4.0


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyProgress(ProgressReport):
    """Progress of a study: runs done and in total, the label of the present ones, elapsed time [s].

    `left` is the time that is left [s], `None` where it is not known. `reasons` say, in every report that has it, why
    a study takes long. `recalled` is the share of the runs that a journal had.
    """

    done: int
    total: int
    label: str
    seconds: float
    left: float | None = None
    reasons: tuple[str, ...] = ()
    recalled: float = 0.0

    @property
    def in_words(self) -> str:
        """Progress in one line: completed runs, the next ones, the remaining time."""
        parts = [f"{self.done} of {self.total} runs", self.label, duration_in_words(self.seconds)]
        if self.left is not None:
            parts.append(f"about {duration_in_words(self.left)} left")
        return ", ".join(parts)

    @property
    def share(self) -> float | None:
        """Share that was recalled, and of the time for the rest the part that has passed; `None` if unknown."""
        if self.left is None:
            return None
        return self.recalled + (1.0 - self.recalled) * self.seconds / max(self.seconds + self.left, 1e-9)

    def later(self, seconds: float) -> StudyProgress:
        """The same after some time without a report [s]; what takes longer than expected has no time left to tell."""
        left = None if self.left is None or self.left <= seconds else self.left - seconds
        return replace(self, seconds=self.seconds + seconds, left=left)


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """Runs that are simulated one after the other: of `n_runs`, a trial simulates one in `repeats`.

    `prepare` does what the runs of the study need once. `trial` takes the share of each motion that is simulated, and
    returns the one that was and the integration steps of a sample. The part takes `times` as long as its trial says.
    """

    n_runs: int
    trial: Callable[[float], tuple[float, int]]
    prepare: Callable[[], object] = lambda: None
    repeats: float = 1.0
    times: float = 1.0


class Course:
    """Reports of a study in progress; without `on_progress` nothing is tried or reported."""

    def __init__(
        self,
        parts: Mapping[PartKey, Part],
        on_progress: Callable[[StudyProgress], None] | None,
        *,
        total: int,
        reasons: Callable[[int, int], tuple[str, ...]],
    ) -> None:
        self._parts, self._on_progress, self._total, self._reasons = parts, on_progress, total, reasons
        self._began = self._part_began = time.perf_counter()
        self._expected: dict[PartKey, float] | None = None
        self._why: tuple[str, ...] = ()
        self._present: PartKey | None = None
        # Number of parts that have begun.
        self._begun = 0
        self._label, self._done, self._recalled = "", 0, 0.0
        # Of the finished parts: what they took, and what was expected [s].
        self._took = self._promised = 0.0

    def begin(self, key: PartKey | None, label: str, done: int, *, recalling: bool = False) -> None:
        """Report that a part begins, `None` for one that is not expected, with `done` runs of the study before it."""
        if self._on_progress is None:
            return
        self._end_part()
        self._label, self._done, self._present = label, done, key
        if key is not None:
            self._begun = [*self._parts].index(key) + 1
        if self._expected is None and key is not None and not recalling:
            self._recalled = done / self._total
            self._report(None)
            self._why = self._try_parts()
        self._part_began = time.perf_counter()
        self._report(self._left(0.0))

    def advance(self, done: int, total: int) -> None:
        """Report how many runs of the present part are done."""
        if self._on_progress is not None and done < total:
            self._report(self._left(done / total), within=f" {done:,} of {total:,}")

    def _report(self, left: float | None, *, within: str = "") -> None:
        assert self._on_progress is not None
        self._on_progress(
            StudyProgress(
                done=self._done,
                total=self._total,
                label=f"{self._label}{within}{by_whom()}",
                seconds=time.perf_counter() - self._began,
                left=left,
                reasons=() if left is None else self._why,
                recalled=self._recalled,
            )
        )

    def _end_part(self) -> None:
        promised = (self._expected or {}).get(self._present, 0.0) if self._present is not None else 0.0
        if promised:
            self._took += time.perf_counter() - self._part_began
            self._promised += promised

    def _left(self, share: float) -> float | None:
        """Time that is left [s] where this share of the present part is done."""
        if self._expected is None:
            return None
        later = sum(self._expected[key] for key in [*self._parts][self._begun :])
        own = 0.0 if self._present is None else self._expected[self._present]
        factor = self._took / self._promised if self._promised > _TELLING else 1.0
        passed = time.perf_counter() - self._part_began
        present = passed * (1.0 - share) / share if share > 0.0 else max(factor * own - passed, 0.0)
        return present + factor * later

    def _try_parts(self) -> tuple[str, ...]:
        """Expect what the present part and those after it take; why that is long."""
        expected, steps, n_runs = dict.fromkeys(self._parts, 0.0), 0, 0
        for key in [*self._parts][self._begun - 1 :]:
            part = self._parts[key]
            expected[key], own_steps = _seconds_of(part)
            steps, n_runs = max(steps, own_steps), n_runs + part.n_runs
        self._expected = expected
        return self._reasons(n_runs, steps)


def _seconds_of(part: Part) -> tuple[float, int]:
    """Seconds that a part will take, by trials, and its integration steps of a sample; 0 where it cannot be tried."""

    def time_trial(share: float) -> tuple[float, float, int]:
        began = time.perf_counter()
        tried, steps = part.trial(share)
        return time.perf_counter() - began, tried, steps

    try:
        part.prepare()
        # What a trial warns of, the simulation itself says.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            before, least, _ = min(time_trial(0.0), time_trial(0.0))
            share = _FIRST_SHARE
            while True:
                taken, tried, steps = time_trial(share)
                rate = max(taken - before, 0.0) / max(tried - least, least)
                once = before + rate * (1.0 - least)
                seconds = part.times * part.repeats * once
                cost = _COST if steps < _STIFF else _STIFF_COST
                most = min(cost * part.repeats, _LONGEST / max(once, 1e-9), 1.0)
                if share >= most or tried >= 1.0 or (seconds < _SHORT and share >= 0.5 * most):
                    return seconds, steps
                share = min(_GROWTH * share, most)
    except MrworkError:
        # The simulation says so where it comes to that.
        return 0.0, 0


def excerpts_of(
    grounds: Sequence[GroundMotion], share: float, sample_time: float, building: Building
) -> tuple[list[GroundMotion], float]:
    """Excerpt of each motion, which moves the building as far, and the share of their total duration."""
    frequency = float(building.frequencies[0])
    period = 1.0 / frequency if frequency > 0.0 else 1.0
    every = max(grounds, key=lambda ground: ground.peak)
    factor = factor_of(every, excerpt_of(every, share, sample_time), period)
    cut = [excerpt_of(ground, share, sample_time, factor) for ground in grounds]
    return cut, sum(ground.duration for ground in cut) / sum(ground.duration for ground in grounds)


def stiffness_in_words(devices: Sequence[Device], building: Building, hardware: Hardware, steps: int) -> str:
    """Why a sample takes so many steps, and what takes fewer; empty where it takes hardly more than asked."""
    if steps <= 2 * hardware.steps:
        return ""
    specs = {device.spec.name: device.spec for device in devices}
    takes = f"{list_names([*specs]) or building.name} takes {steps} integration steps per sample"
    asked = f"and the hardware asks for {hardware.steps}"
    if not any(spec.n_states for spec in specs.values()):
        return f"{takes}, {asked}"
    at_bound = [
        f"{parameter.name} = {of_unit(value, parameter.unit)}"
        for device in devices
        for index, (parameter, value) in enumerate(
            zip(device.spec.parameters, device.draws[0].tolist(), strict=True)
        )
        if parameter.coefficient is None and bound_at(Box.of(device.spec), index, value)
    ]
    causes = f", with {list_names(list(dict.fromkeys(at_bound)))} on a bound of the model" if at_bound else ""
    return f"{takes}{causes}, {asked}: a model without states that fits as well takes fewer"


def excerpt_of(ground: GroundMotion, share: float, sample_time: float, factor: float = 1.0) -> GroundMotion:
    """The part of a motion with the most energy, of a share of its duration and a few control samples at least."""
    window = min(max(share * ground.duration, 4.0 * sample_time), ground.duration)
    if window >= ground.duration:
        return ground
    count = max(round(window / ground.dt), 1)
    energy = np.cumsum(np.square(ground.acceleration))
    start = ground.dt * int(np.argmax(energy[count:] - energy[:-count]))
    dt = min(ground.dt, window / 4.0)
    at = min(start, ground.duration - window) + dt * np.arange(int(window / dt) + 1)
    return replace_samples(ground, factor * np.interp(at, ground.time, ground.acceleration), dt, "excerpt")


def factor_of(ground: GroundMotion, excerpt: GroundMotion, period: float) -> float:
    """Factor with which an excerpt moves an oscillator of this period [s] from rest as far as the motion does."""
    first = max(int(np.argmax(np.abs(ground.acceleration))) - _COMPARED // 2, 0)
    whole = replace_samples(ground, ground.acceleration[first : first + _COMPARED], ground.dt, "excerpt")
    far, near = (
        float(response_spectrum(each, [period], damping=0.1).displacement[0]) for each in (whole, excerpt)
    )
    return min(max(far / near, 1.0), _LARGEST_FACTOR) if near > 0.0 else 1.0
