"""Non-causal optimum of the command history under one ground motion: how much is left for any control law.

The commands are those of the lowest score for a motion that is known in advance. Gradients run through the twin of the
loop, on a smooth form of the score; every score that is reported belongs to a run of the loop itself. The search is
that of L-BFGS-B within the range of the command, from several starts.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from mrwork.base.arguments import Threads, Within, checked
from mrwork.base.keys import key, positive
from mrwork.base.numbers import format_rounded
from mrwork.base.progress import ProgressReport
from mrwork.base.summary import Summarised, Summary
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.matrices import Building, Device
from mrwork.closed_loop.evaluation import SCORE, criterion
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.prescribed import PrescribedCommands, samples_of, simulate_prescribed
from mrwork.closed_loop.responses import Responses, axis_of
from mrwork.closed_loop.simulate import simulate_loop
from mrwork.control.laws.control_law import ControlLaw
from mrwork.errors import Interrupted, SettingError
from mrwork.motions.ground_motion import GroundMotion

if TYPE_CHECKING:
    from mrwork.twins.loop_derivatives import PrescribedLoop


# Longest step of the twin [s], and the difference of its criteria from those of the loop above which it is halved.
_LONGEST_STEP = 2e-3
_AGREEMENT = 2e-3


@array_dataclass()
class ClairvoyantProblem:
    """Score of commands over intervals [s], for a building with devices under one motion.

    `floors` and `storeys` are the indices of those that count in the score; all by default.
    """

    building: Building
    devices: tuple[Device, ...]
    motion: GroundMotion
    hardware: Hardware
    interval: float
    floors: tuple[int, ...] | None = None
    storeys: tuple[int, ...] | None = None
    threads: int = 0
    _at_rest: Floats = field(init=False, repr=False)
    _steps: int = field(init=False, repr=False)
    _twin: PrescribedLoop | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        samples_of(self.interval, self.hardware.sample_time)
        if self.building.nonlinear:
            raise SettingError(
                f"{self.building.name} has {self.building.nonlinear}, and the gradients of a clairvoyant are those of "
                "a building of its matrices alone; leave the clairvoyant out, or the other"
            )
        for device in self.devices:
            if not device.spec.follows_command:
                raise SettingError(
                    f"{device.name}: no parameter of {device.spec.name} depends on the command, so there is no command "
                    "to be chosen; give a damper with current laws"
                )
            if len(device.draws) > 1:
                raise SettingError(
                    f"{device.name} has {len(device.draws)} draws of its parameters; give one, as their mean"
                )
        # Nothing is measured.
        object.__setattr__(
            self,
            "hardware",
            Hardware(
                sample_time=self.hardware.sample_time,
                step=self.hardware.step,
                delay=self.hardware.delay,
                command_rate=self.hardware.command_rate,
                faults=tuple(fault for fault in self.hardware.faults if fault.channel == "command"),
            ),
        )
        passive = self._constants(np.zeros(1))
        object.__setattr__(self, "_at_rest", self._criteria(passive)[0])
        if not (np.isfinite(self._at_rest).all() and (self._at_rest > 0.0).all()):
            raise SettingError(
                f"{self.motion.name}: the run at i = 0 did not finish or has no response, so there is no score"
            )
        object.__setattr__(self, "_steps", int(passive.steps[0]))

    @property
    def largest(self) -> Floats:
        """Largest command of each device, shape (n_devices,)."""
        return np.array([device.largest_command for device in self.devices])

    @property
    def n_intervals(self) -> int:
        """Number of commands of each device."""
        return max(1, math.ceil(self.motion.duration / self.interval * (1.0 - 1e-9)))

    @property
    def twin(self) -> PrescribedLoop:
        """The loop in JAX, with the longest step at which its criteria are those of the loop within 0.2 %."""
        if self._twin is None:
            object.__setattr__(self, "_twin", self._agreeing_twin())
        assert self._twin is not None
        return self._twin

    def constant(self, share: float) -> Floats:
        """A constant share of the largest command, shape (n_intervals, n_devices)."""
        return np.tile(share * self.largest, (self.n_intervals, 1))

    def adapt_commands(self, commands: PrescribedCommands) -> Floats:
        """Commands resampled to the intervals of this problem and clipped to the range of the devices."""
        if abs(commands.interval - self.interval) > 1e-9 or commands.command.shape[1] != len(self.devices):
            raise SettingError(
                f"a start has commands of {commands.interval:g} s for {commands.command.shape[1]} devices; give "
                f"{self.interval:g} s and {len(self.devices)} devices"
            )
        missing = max(0, self.n_intervals - len(commands.command))
        held = np.pad(commands.command, ((0, missing), (0, 0)), mode="edge")[: self.n_intervals]
        return np.clip(held, 0.0, self.largest)

    def simulate(self, commands: Floats, *, histories: bool = False, step_factor: int = 1) -> Responses:
        """The run of the loop with these commands."""
        return simulate_prescribed(
            self.building,
            self.devices,
            PrescribedCommands(interval=self.interval, command=commands),
            self.motion,
            self.hardware,
            histories=histories,
            step_factor=step_factor,
            threads=self.threads,
        )

    def criteria_of(self, run: Responses) -> Floats:
        """Criteria of the score, in its order, shape (4,)."""
        return np.asarray(self._criteria(run)[0])

    def ratios_of(self, run: Responses) -> Floats:
        """Criteria of the score over their values at i = 0, shape (4,)."""
        return np.asarray(self.criteria_of(run) / self._at_rest)

    def score(self, commands: Floats) -> float:
        """Score of commands in the loop; infinite if the run does not finish."""
        return float(self.ratios_of(self.simulate(commands)).mean())

    def constant_scores(self, shares: Floats) -> Floats:
        """Scores of constant shares of the largest command, shape (n_shares,)."""
        return np.asarray((self._criteria(self._constants(shares)) / self._at_rest).mean(axis=1))

    def _constants(self, shares: Floats) -> Responses:
        law = ControlLaw(name="passive", gains={"command": np.outer(shares, self.largest)})
        hardware = replace(self.hardware, faults=())
        return simulate_loop(self.building, self.devices, law, [self.motion], hardware, threads=self.threads)

    def _criteria(self, run: Responses) -> Floats:
        """Criteria of the score of each run, shape (n_runs, 4)."""
        counted = {"floor": self.floors, "storey": self.storeys}
        columns = []
        for name in SCORE:
            quantity = criterion(name).quantity
            values, places = np.asarray(getattr(run, quantity)), counted[axis_of(quantity)]
            columns.append((values if places is None else values[:, list(places)]).max(axis=1))
        return np.stack(columns, axis=-1)

    def _agreeing_twin(self) -> PrescribedLoop:
        """The twin with the longest step at which it agrees with the loop; at least the step of the loop."""
        tried = self.constant(0.5)
        expected = self.ratios_of(self._constants(np.array([0.5])))
        shortest = self.hardware.sample_time / self._steps
        count = math.ceil(self.interval / _LONGEST_STEP * (1.0 - 1e-9))
        # A command arrives at a step.
        while (
            self.interval / count > shortest
            and abs(math.remainder(self.hardware.delay, self.interval / count)) > 1e-9
        ):
            count += 1
        while True:
            twin = self._twin_of(self.interval / count)
            worst = float(np.max(np.abs(twin.ratios(tried) / expected - 1.0)))
            if worst < _AGREEMENT:
                return twin
            if self.interval / count <= shortest * (1.0 + 1e-9):
                raise SettingError(
                    f"{self.motion.name}: the criteria of the twin differ from those of the loop by "
                    f"{100.0 * worst:.2g} % at the step of the loop; give the hardware a shorter `step`"
                )
            count *= 2

    def _twin_of(self, step: float) -> PrescribedLoop:
        # JAX takes a second to load, and no verb needs it unless a clairvoyant is asked for.
        from mrwork.twins.loop_derivatives import CriteriaAtRest, prescribed_loop

        return prescribed_loop(
            matrices={
                name: np.asarray(getattr(self.building, name), dtype=np.float64)
                for name in ("mass", "damping", "stiffness", "influence")
            }
            | {
                "floors": _rows(self.building.floors, self.floors),
                "storeys": _rows(self.building.storeys, self.storeys),
            },
            dampers=self.devices,
            acceleration=self.motion.acceleration,
            dt=self.motion.dt,
            duration=self.motion.duration,
            step_time=step,
            interval=self.interval,
            delay=self.hardware.delay,
            scales=CriteriaAtRest(*map(float, self._at_rest)),
        )


def _rows(rows: Floats, chosen: tuple[int, ...] | None) -> Floats:
    commands = np.asarray(rows, dtype=np.float64)
    return commands if chosen is None else commands[list(chosen)]


# Constant commands that are tried, from zero to the largest.
_LEVELS = 9
# Random commands are held this long [s]: shorter ones have no effect on a building.
_RANDOM_HOLD = 0.25
# Exponents of the norm in place of a maximum: a smooth one to explore, a sharp one to finish.
_EXPLORING, _FINISHING = 16.0, 64.0
# Pairs of differences that L-BFGS-B keeps.
_MEMORY = 20


@checked
class ClairvoyantSettings:
    """Settings of the search for the non-causal optimum; the seed is that of the random starts."""

    _made_by: ClassVar[str] = "mr.closed_loop.ClairvoyantSettings(interval=...)"

    interval: float = positive(
        "interval over which a command is held, a whole number of samples", unit="s", default=0.01
    )
    explore: int = key("iterations from every start", default=25, least=1)
    finish: int = key("iterations from the best of them", default=75, least=0)
    random_starts: int = key("random starts, besides constant commands and the best law", default=1, least=0)
    seed: Annotated[int, Within(least=0)] = 0


@array_dataclass(repr=False)
class ClairvoyantStart(Summarised):
    """A start of the search: its score, and the commands and score that were reached from it.

    `evaluations` counts the gradients, `step_time` is the integration step of the twin [s], `seconds` the elapsed time.
    Scores are those of the loop, not of the twin.
    """

    _units: ClassVar[Mapping[str, str]] = {"commands": "A or V", "step_time": "s", "seconds": "s"}

    name: str
    start_score: float
    score: float
    commands: Floats
    evaluations: int
    step_time: float
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ClairvoyantProgress(ProgressReport):
    """Progress of a search: start, iteration and their number, smooth score, elapsed time [s]."""

    start: str
    iteration: int
    iterations: int
    smooth_score: float
    seconds: float

    @property
    def in_words(self) -> str:
        """Progress in one line: the start, its iterations, the smooth score."""
        return f"{self.start}, iteration {self.iteration} of {self.iterations}, score about {self.smooth_score:.3f}"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Clairvoyant(Summarised):
    """Non-causal optimum of the command history under one motion: local, of several starts, not certified.

    `criteria` are those of the score by name, of the run of the loop with these commands, `ratios` the same over their
    values at i = 0, and the score is their mean. The last of the `starts` finishes the best of them.
    """

    motion: str
    commands: PrescribedCommands
    score: float
    criteria: Mapping[str, float]
    ratios: Mapping[str, float]
    starts: tuple[ClairvoyantStart, ...]

    @property
    def statement(self) -> str:
        """Statement of what the result proves and what it does not."""
        count = len({start.name for start in self.starts if start.name != FINISH})
        starts = "one start" if count == 1 else f"{count} starts"
        return (
            f"local optimum of the command history found with {starts}, not certified: a lower score may exist, and "
            "no causal law is known to reach this one"
        )

    @property
    def seconds(self) -> float:
        """Elapsed time of the search [s]."""
        return math.fsum(start.seconds for start in self.starts)

    def _summary(self) -> Summary:
        return Summary(
            title=f"Non-causal optimum under {self.motion}, score {self.score:.3f}",
            facts=(
                *(
                    (name.replace("_", " "), f"{format_rounded(each)} of i = 0")
                    for name, each in self.ratios.items()
                ),
                ("commands", f"{len(self.commands.command)} of {self.commands.interval:g} s"),
                ("time", f"{self.seconds:.0f} s"),
            ),
            columns=("start", "its score", "reached", "gradients"),
            rows=[
                (
                    each.name,
                    format_rounded(each.start_score),
                    format_rounded(each.score),
                    str(each.evaluations),
                )
                for each in self.starts
            ],
            notes=[self.statement],
        )


FINISH = "best of these, finished"
"""Name of the last search, from the best of the others."""

Recall = Callable[[str, Floats, Callable[[], ClairvoyantStart]], ClairvoyantStart]
"""Does a search, given its name and the commands it starts from, or recalls it from a journal."""


@checked
def clairvoyant(
    building: Building,
    devices: Sequence[Device],
    motion: GroundMotion,
    hardware: Hardware | None = None,
    *,
    settings: ClairvoyantSettings | None = None,
    starts: Mapping[str, PrescribedCommands] = MappingProxyType({}),
    floors: tuple[Annotated[int, Within(least=0)], ...] | None = None,
    storeys: tuple[Annotated[int, Within(least=0)], ...] | None = None,
    on_progress: Callable[[ClairvoyantProgress], None] = lambda progress: None,
    recall: Recall = lambda name, start, search: search(),
    threads: Threads = 0,
) -> Clairvoyant:
    """Find commands with a low score for a motion that is known in advance.

    The score is the mean of peak drift, peak absolute acceleration, rms drift and rms absolute acceleration over their
    values at i = 0, as in a study. The result is a local optimum; it shows what the devices can do at least, if their
    commands are chosen well, and bounds nothing.

    Parameters
    ----------
    hardware
        Sampling, delay and step; sensors do not matter, since nothing is measured.
    starts
        Further starts by name, as the commands of the best law: `PrescribedCommands.of_history`.
    floors, storeys
        Indices of the floors and storeys that count in the score; all by default.
    recall
        Does each search, or recalls it from a journal.

    Raises
    ------
    SettingError
        If the devices follow no command, have several draws, or the hardware limits the rate of the command.
    Interrupted
        On Ctrl-C, with the `Clairvoyant` of the searches that are done, `None` before the first.

    Examples
    --------
    >>> import mrwork as mr
    >>> found = mr.closed_loop.clairvoyant(frame, [damper], motion)  # doctest: +SKIP
    >>> found.score, found.statement  # doctest: +SKIP
    """
    for noun, places, count in (
        ("floors", floors, len(building.floors)),
        ("storeys", storeys, len(building.storeys)),
    ):
        if places is not None and not (places and len(set(places)) == len(places) and max(places) < count):
            raise SettingError(
                f"`{noun}` is {places}; give one or more of the {count} {noun} of {building.name}, each once, from 0"
            )
    settings = ClairvoyantSettings() if settings is None else settings
    problem = ClairvoyantProblem(
        building=building,
        devices=tuple(devices),
        motion=motion,
        hardware=Hardware() if hardware is None else hardware,
        interval=settings.interval,
        floors=floors,
        storeys=storeys,
        threads=threads,
    )
    done: list[ClairvoyantStart] = []
    try:
        for name, start in _starts(problem, settings, starts):
            search = partial(_search, problem, name, start, _EXPLORING, settings.explore, on_progress)
            done.append(recall(name, start, search))
        best = min(done, key=lambda each: each.score)
        if settings.finish:
            search = partial(
                _search, problem, FINISH, best.commands, _FINISHING, settings.finish, on_progress
            )
            done.append(recall(FINISH, best.commands, search))
    except KeyboardInterrupt:
        raise Interrupted(_result(problem, done) if done else None, "clairvoyant") from None
    return _result(problem, done)


def _result(problem: ClairvoyantProblem, done: Sequence[ClairvoyantStart]) -> Clairvoyant:
    best = min(done, key=lambda each: each.score)
    commands = PrescribedCommands(interval=problem.interval, command=best.commands)
    run = problem.simulate(best.commands)
    return Clairvoyant(
        motion=problem.motion.name,
        commands=commands,
        score=best.score,
        criteria=dict(zip(SCORE, map(float, problem.criteria_of(run)), strict=True)),
        ratios=dict(zip(SCORE, map(float, problem.ratios_of(run)), strict=True)),
        starts=tuple(done),
    )


def _starts(
    problem: ClairvoyantProblem, settings: ClairvoyantSettings, given: Mapping[str, PrescribedCommands]
) -> Iterator[tuple[str, Floats]]:
    fitted = {name: problem.adapt_commands(commands) for name, commands in given.items()}
    shares = np.linspace(0.0, 1.0, _LEVELS)
    scores = problem.constant_scores(shares)
    best = float(shares[int(np.nanargmin(scores))])
    yield f"best constant command, {best:g} of the largest", problem.constant(best)
    if best != 0.5:
        yield "half of the largest command", problem.constant(0.5)
    yield from fitted.items()
    rng = np.random.default_rng(settings.seed)
    held = max(1, round(_RANDOM_HOLD / settings.interval))
    for number in range(settings.random_starts):
        levels = rng.uniform(size=(-(-problem.n_intervals // held), len(problem.devices)))
        shares = np.repeat(levels, held, axis=0)[: problem.n_intervals]
        yield f"random commands {number + 1}", shares * problem.largest


def _search(
    problem: ClairvoyantProblem,
    name: str,
    start: Floats,
    power: float,
    iterations: int,
    on_progress: Callable[[ClairvoyantProgress], None],
) -> ClairvoyantStart:
    """L-BFGS-B from one start; the result is never worse than it."""
    from scipy.optimize import OptimizeResult, minimize

    began = time.perf_counter()
    largest = problem.largest
    shape = start.shape
    count = 0

    def objective(shares: Floats) -> tuple[float, Floats]:
        commands = shares.reshape(shape) * largest
        score, gradient = problem.twin.score_and_gradient(commands, power)
        return score, (gradient * largest).ravel()

    def report(intermediate_result: OptimizeResult) -> None:
        nonlocal count
        count += 1
        on_progress(
            ClairvoyantProgress(
                start=name,
                iteration=count,
                iterations=iterations,
                smooth_score=float(intermediate_result.fun),
                seconds=time.perf_counter() - began,
            )
        )

    optimum = minimize(
        objective,
        (start / largest).ravel(),
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0, 1.0)] * start.size,
        callback=report,
        options={"maxiter": iterations, "maxcor": _MEMORY},
    )
    reached = np.clip(optimum.x, 0.0, 1.0).reshape(shape) * largest
    start_score, score = problem.score(start), problem.score(reached)
    better = score < start_score
    return ClairvoyantStart(
        name=name,
        start_score=start_score,
        score=score if better else start_score,
        commands=reached if better else start,
        evaluations=int(optimum.nfev),
        step_time=problem.twin.step_time,
        seconds=time.perf_counter() - began,
    )
