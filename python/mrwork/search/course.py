"""One generation as an optimiser proposes it, and the progress of every replicate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError
from mrwork.search.rules import EliteRule, StopRules, distinct_best, reason_of
from mrwork.search.unit_cube import Streams


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Proposal:
    """One generation of the replicates that run, to be simulated in one call.

    `population` (n_running, n_population, n_params) with `known` misfits (n_running, n_population). Those `changed` are
    asked, `known` is `inf` there. A misfit at or above its `limit` (n_running, n_population) counts as a failure,
    whatever it is exactly: a simulation may stop as soon as it gets there. `number` (n_running,) names the replicates.
    """

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
        """Number of the replicate that asks each row, shape (n_ask,)."""
        return np.repeat(self.number, np.count_nonzero(self.changed, axis=1))

    @property
    def threshold(self) -> NDArray[np.float64]:
        """Misfit from which on a row's exact value does not matter, shape (n_ask,); `inf` where it always does."""
        return self.limit[self.changed]

    def accepted(self, misfit: NDArray[np.float64]) -> NDArray[np.float64]:
        """Misfits as the optimiser takes them, shape (n_ask,): `inf` at or above the threshold.

        They are the same whether a simulation went on to its end or stopped at its threshold.

        Parameters
        ----------
        misfit
            Shape (n_ask,), not negative; `inf` marks a failed or stopped simulation.

        Raises
        ------
        SettingError
            Where there is not one misfit per row, or one is no misfit.
        """
        misfit = np.asarray(misfit, dtype=np.float64)
        n_ask = np.count_nonzero(self.changed)
        if misfit.shape != (n_ask,):
            raise SettingError(
                f"`misfit` has shape {misfit.shape}, {n_ask} candidates were asked; "
                "give one misfit per row of the proposal's `unit`, in its order"
            )
        if not np.all(misfit >= 0.0):
            row = int(np.argmin(misfit >= 0.0))
            raise SettingError(
                f"a misfit is a number >= 0 or inf, row {row} has {misfit[row]}; "
                "mark a failed simulation with inf"
            )
        return np.where(misfit >= self.threshold, math.inf, misfit)

    def told(self, misfit: NDArray[np.float64]) -> NDArray[np.float64]:
        """Accepted misfits in their places, shape (n_running, n_population), `inf` where nothing was asked."""
        told = np.full(self.known.shape, math.inf)
        told[self.changed] = self.accepted(misfit)
        return told


ScalarT = TypeVar("ScalarT", bound=np.generic)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trace:
    """Progress, one entry per generation, each of shape (n_replicates, n_generations).

    `evaluations` simulations so far, `best` misfit so far, `median` misfit of the population
    (`inf` while half of it fails). The entries of a replicate that has ended repeat its last.
    """

    evaluations: NDArray[np.int64]
    best: NDArray[np.float64]
    median: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """What every replicate remembers, whichever optimiser drives it; `n` replicates march together.

    `replicate` (n,) are their numbers, which with the seed `rng` fix their random numbers. `generation` (n,) and
    `evaluations` (n,) were told so far. `ended` (n,) is the code of the rule that ended a replicate, 0 while it runs.
    `best_unit` (n, n_params) has `best_misfit` (n,), `inf` while every simulation has failed. `elite_unit`
    (n, n_elite, n_params) are the good and mutually distant finds of the whole run with `elite_misfit`
    (n, n_elite), best first; where there are fewer, zeros with a misfit of `inf` follow.
    """

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
    def begun(cls, n_params: int, rng: int, replicates: Sequence[int], elite: EliteRule) -> Course:
        """Nothing simulated yet.

        Raises
        ------
        SettingError
            Where the seed, the dimension or the numbers of the replicates are impossible.
        """
        if n_params < 1 or not 0 <= rng < 2**64:
            raise SettingError(
                f"`n_params` is at least 1 and `rng` in [0, 2^64), got n_params={n_params} and rng={rng}"
            )
        number = np.asarray(replicates, dtype=np.int64)
        n = number.size
        if n < 1 or number.min() < 0 or np.unique(number).size < n:
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
        """Whether nothing has been told yet."""
        return bool(self.trace.best.shape[1] == 0)

    @property
    def stop_reasons(self) -> tuple[str | None, ...]:
        """The rule that ended each replicate, `None` while it runs."""
        return tuple(reason_of(int(code)) for code in self.ended)

    @property
    def streams(self) -> Streams:
        """Random numbers of the next generation of the replicates that run."""
        rows = self.running
        return Streams(rng=self.rng, replicate=self.replicate[rows], generation=self.generation[rows])

    def after(
        self,
        proposal: Proposal,
        told: NDArray[np.float64],
        *,
        population: NDArray[np.float64],
        misfit: NDArray[np.float64],
        elite: EliteRule,
        stop: StopRules,
    ) -> Course:
        """Longer by one generation of the replicates that run.

        Parameters
        ----------
        proposal
            What was asked.
        told
            Misfits that were simulated, shape (n_running, n_population), `inf` elsewhere and where dropped.
        population, misfit
            Of the generation that resulted, (n_running, n_population, n_params) and (n_running, n_population).
        elite, stop
            The rules that hold.
        """
        rows = self.running
        among = np.arange(rows.size)
        leader = np.argmin(misfit, axis=1)
        least = misfit[among, leader]
        # Strictly: what was found first stays. The very first leader counts even where all failed.
        better = (least < self.best_misfit[rows]) | (self.generation[rows] == 0)
        best_misfit = np.where(better, least, self.best_misfit[rows])
        best_unit = np.where(better[:, None], population[among, leader], self.best_unit[rows])
        found_unit = np.concatenate([self.elite_unit[rows], proposal.population], axis=1)
        found_misfit = np.concatenate([self.elite_misfit[rows], told], axis=1)
        kept = distinct_best(found_unit, found_misfit, elite)
        evaluations = self.evaluations[rows] + np.count_nonzero(proposal.changed, axis=1)
        grown = replace(
            self,
            generation=put(self.generation, rows, self.generation[rows] + 1),
            evaluations=put(self.evaluations, rows, evaluations),
            best_unit=put(self.best_unit, rows, best_unit),
            best_misfit=put(self.best_misfit, rows, best_misfit),
            elite_unit=put(
                self.elite_unit, rows, np.where(kept[..., None] < 0, 0.0, found_unit[among[:, None], kept])
            ),
            elite_misfit=put(
                self.elite_misfit, rows, np.where(kept < 0, math.inf, found_misfit[among[:, None], kept])
            ),
            trace=Trace(
                evaluations=_longer(self.trace.evaluations, rows, evaluations),
                best=_longer(self.trace.best, rows, best_misfit),
                median=_longer(self.trace.median, rows, np.median(misfit, axis=1)),
            ),
        )
        ended = stop.judge(
            trace=grown.trace.best[rows], evaluations=evaluations, population=population, best_unit=best_unit
        )
        return replace(grown, ended=put(self.ended, rows, ended))


def put(old: NDArray[ScalarT], rows: NDArray[np.int64], new: NDArray[ScalarT]) -> NDArray[ScalarT]:
    """A copy of `old` with these rows replaced."""
    if rows.size == len(old):
        return new
    copy = old.copy()
    copy[rows] = new
    return copy


def _longer(old: NDArray[ScalarT], rows: NDArray[np.int64], entry: NDArray[ScalarT]) -> NDArray[ScalarT]:
    """A trace with one more column; a row that has ended repeats its last."""
    grown = np.concatenate([old, old[:, -1:]], axis=1) if old.shape[1] else np.empty((len(old), 1), old.dtype)
    grown[rows, -1] = entry
    return grown
