"""Proposal of one generation, and progress of every replicate of a search."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import AnyNumbers, Seed, Within, checked
from mrwork.errors import SettingError
from mrwork.search.rules import EliteRule, StopRules, distinct_best, reason_of
from mrwork.search.unit_cube import Streams
from mrwork.summary import Summarised
from mrwork.values import holds_arrays


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Proposal(Summarised):
    """One generation of the running replicates, to be simulated in one call.

    `population` (n_running, n_population, n_params) with `known` misfits (n_running, n_population). Only the `changed`
    members are simulated; `known` is `inf` for these. A misfit at or above its `limit` (n_running, n_population) counts
    as a failure, so its simulation may stop there. `number` (n_running,) are the numbers of the replicates.
    """

    _made_by: ClassVar[str] = "optimiser.ask(state)"

    number: NDArray[np.int64]
    population: NDArray[np.float64]
    known: NDArray[np.float64]
    changed: NDArray[np.bool_]
    limit: NDArray[np.float64]

    @property
    def unit(self) -> NDArray[np.float64]:
        """Candidates to simulate, shape (n_ask, n_params), replicate by replicate."""
        return self.population[self.changed]

    @property
    def replicate(self) -> NDArray[np.int64]:
        """Number of the replicate of each row of `unit`, shape (n_ask,)."""
        return np.repeat(self.number, np.count_nonzero(self.changed, axis=1))

    @property
    def threshold(self) -> NDArray[np.float64]:
        """Misfit at which the simulation of a row may stop, shape (n_ask,); `inf` where it may not."""
        return self.limit[self.changed]

    @checked
    def accepted(self, misfit: AnyNumbers) -> NDArray[np.float64]:
        """Misfits for the optimiser, shape (n_ask,): `inf` at or above the threshold.

        They do not depend on whether a simulation stopped at its threshold.

        Parameters
        ----------
        misfit
            Shape (n_ask,), not negative; `inf` marks a failed or stopped simulation.

        Raises
        ------
        SettingError
            Where there is not one misfit per row, or one is negative or NaN.
        """
        misfit = np.asarray(misfit, dtype=np.float64)
        n_ask = np.count_nonzero(self.changed)
        if misfit.shape != (n_ask,):
            raise SettingError(
                f"`misfit` has shape {misfit.shape}, the proposal has {n_ask} candidates; "
                "give one misfit per row of the proposal's `unit`, in its order"
            )
        if not np.all(misfit >= 0.0):
            row = int(np.argmin(misfit >= 0.0))
            raise SettingError(
                f"a misfit is a number >= 0 or inf, row {row} has {misfit[row]}; "
                "mark a failed simulation with inf"
            )
        return np.where(misfit >= self.threshold, math.inf, misfit)

    @checked
    def member_misfits(self, misfit: AnyNumbers) -> NDArray[np.float64]:
        """Accepted misfits of all members, shape (n_running, n_population), `inf` for those not simulated."""
        members = np.full(self.known.shape, math.inf)
        members[self.changed] = self.accepted(misfit)
        return members


Dimension = Annotated[int, Within(least=1, most=10_000)]
Replicate = Annotated[int, Within(least=0, most=2**63 - 1)]
ScalarT = TypeVar("ScalarT", bound=np.generic)


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Trace(Summarised):
    """Progress, one entry per generation, each of shape (n_replicates, n_generations).

    Number of `evaluations` so far, `best` misfit so far, `median` misfit of the population (`inf` while half of it
    fails). The last entries of a replicate that has ended are repeated.
    """

    _made_by: ClassVar[str] = "optimiser.start(n_params, rng).course.trace"

    evaluations: NDArray[np.int64]
    best: NDArray[np.float64]
    median: NDArray[np.float64]


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Course(Summarised):
    """Progress of `n` replicates, the part of the state that all optimisers share.

    `replicate` (n,) are the numbers of the replicates, which determine their random numbers together with the seed
    `rng`. `generation` (n,) and `evaluations` (n,) are counts so far. `ended` (n,) is the code of the rule that ended a
    replicate, 0 while it runs. `best_unit` (n, n_params) has `best_misfit` (n,), `inf` while every simulation has
    failed. `elite_unit` (n, n_elite, n_params) are the best mutually distant points of the whole run with
    `elite_misfit` (n, n_elite), best first, padded with zeros of misfit `inf`.
    """

    _made_by: ClassVar[str] = "optimiser.start(n_params, rng).course"

    rng: int
    replicate: NDArray[np.int64]
    generation: NDArray[np.int64]
    evaluations: NDArray[np.int64]
    ended: NDArray[np.int8]
    best_unit: NDArray[np.float64]
    best_misfit: NDArray[np.float64]
    elite_unit: NDArray[np.float64]
    elite_misfit: NDArray[np.float64]
    trace: Trace

    @classmethod
    @checked
    def begun(
        cls, n_params: Dimension, rng: Seed, replicates: Sequence[Replicate], elite: EliteRule
    ) -> Course:
        """Progress before the first simulation.

        Raises
        ------
        SettingError
            Where the seed, the dimension or the numbers of the replicates are impossible.
        """
        number = np.asarray(replicates, dtype=np.int64)
        n = number.size
        if n < 1 or np.unique(number).size < n:
            raise SettingError(
                f"`replicates` are different whole numbers >= 0, at least one, got {list(replicates)}"
            )
        return cls(
            rng=rng,
            replicate=number,
            generation=np.zeros(n, np.int64),
            evaluations=np.zeros(n, np.int64),
            ended=np.zeros(n, np.int8),
            best_unit=np.zeros((n, n_params)),
            best_misfit=np.full(n, math.inf),
            elite_unit=np.zeros((n, elite.count, n_params)),
            elite_misfit=np.full((n, elite.count), math.inf),
            trace=Trace(
                evaluations=np.empty((n, 0), np.int64), best=np.empty((n, 0)), median=np.empty((n, 0))
            ),
        )

    @property
    def running(self) -> NDArray[np.int64]:
        """Rows of the replicates that have not ended, shape (n_running,)."""
        return np.flatnonzero(self.ended == 0)

    @property
    def is_first(self) -> bool:
        """Whether the first generation has not been simulated yet."""
        return bool(self.trace.best.shape[1] == 0)

    @property
    def stop_reasons(self) -> tuple[str | None, ...]:
        """The rule that ended each replicate, `None` while it runs."""
        return tuple(reason_of(int(code)) for code in self.ended)

    @property
    def streams(self) -> Streams:
        """Random numbers of the next generation of the running replicates."""
        rows = self.running
        return Streams(rng=self.rng, replicate=self.replicate[rows], generation=self.generation[rows])

    @checked
    def after(
        self,
        proposal: Proposal,
        simulated: AnyNumbers,
        *,
        population: NDArray[np.float64],
        misfit: AnyNumbers,
        elite: EliteRule,
        stop: StopRules,
    ) -> Course:
        """Progress after one more generation of the running replicates.

        Parameters
        ----------
        proposal
            The candidates that were simulated.
        simulated
            Result of `Proposal.member_misfits`, shape (n_running, n_population).
        population, misfit
            The resulting generation, (n_running, n_population, n_params) and (n_running, n_population).
        elite, stop
            Which points are kept, and when replicates end.
        """
        rows = self.running
        among = np.arange(rows.size)
        leader = np.argmin(misfit, axis=1)
        least = misfit[among, leader]
        # A strict inequality keeps the first of equal points. The first generation has a best even where all failed.
        better = (least < self.best_misfit[rows]) | (self.generation[rows] == 0)
        best_misfit = np.where(better, least, self.best_misfit[rows])
        best_unit = np.where(better[:, None], population[among, leader], self.best_unit[rows])
        found_unit = np.concatenate([self.elite_unit[rows], proposal.population], axis=1)
        found_misfit = np.concatenate([self.elite_misfit[rows], simulated], axis=1)
        kept = distinct_best(found_unit, found_misfit, elite)
        evaluations = self.evaluations[rows] + np.count_nonzero(proposal.changed, axis=1)
        grown = replace(
            self,
            generation=with_rows(self.generation, rows, self.generation[rows] + 1),
            evaluations=with_rows(self.evaluations, rows, evaluations),
            best_unit=with_rows(self.best_unit, rows, best_unit),
            best_misfit=with_rows(self.best_misfit, rows, best_misfit),
            elite_unit=with_rows(
                self.elite_unit, rows, np.where(kept[..., None] < 0, 0.0, found_unit[among[:, None], kept])
            ),
            elite_misfit=with_rows(
                self.elite_misfit, rows, np.where(kept < 0, math.inf, found_misfit[among[:, None], kept])
            ),
            trace=Trace(
                evaluations=_extend_trace(self.trace.evaluations, rows, evaluations),
                best=_extend_trace(self.trace.best, rows, best_misfit),
                median=_extend_trace(self.trace.median, rows, np.median(misfit, axis=1)),
            ),
        )
        ended = stop.ended(
            trace=grown.trace.best[rows], evaluations=evaluations, population=population, best_unit=best_unit
        )
        return replace(grown, ended=with_rows(self.ended, rows, ended))


def with_rows(old: NDArray[ScalarT], rows: NDArray[np.int64], new: NDArray[ScalarT]) -> NDArray[ScalarT]:
    """A copy of `old` with these rows replaced."""
    if rows.size == len(old):
        return new
    copy = old.copy()
    copy[rows] = new
    return copy


def _extend_trace(
    old: NDArray[ScalarT], rows: NDArray[np.int64], entry: NDArray[ScalarT]
) -> NDArray[ScalarT]:
    """A trace with one more column; rows that are not in `rows` repeat their last entry."""
    grown = np.concatenate([old, old[:, -1:]], axis=1) if old.shape[1] else np.empty((len(old), 1), old.dtype)
    grown[rows, -1] = entry
    return grown
