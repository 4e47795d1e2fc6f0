"""Multistart least squares, the default search of a plain model.

Local minimisations (Levenberg-Marquardt) start from the best of many samples, in rounds, until several of them have
reached the least misfit. The misfit of a hysteresis model is smooth except for a few kinks, so a local minimisation of
two hundred simulations reaches a minimum that a population-based search only approaches in thousands. Only repeated
local minimisations show whether that minimum is the global one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.errors import Interrupted, SettingError
from mrwork.identification.levenberg_marquardt import LocalMinima, find_minima
from mrwork.identification.objective import Objective
from mrwork.search.unit_cube import Streams, latin_hypercube
from mrwork.summary import Summarised

# A second minimum is fitted too if its misfit is larger by this share at most, and a unit coordinate differs by more
# than `_DISTANT`.
_CLOSE = 0.01
_DISTANT = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Multistart:
    """Settings of the search.

    Parameters
    ----------
    samples
        Points of the Latin hypercube per free parameter; local minimisations start from the best of them.
    starts
        Local minimisations of a round, which run in one batch.
    most_rounds
        Largest number of rounds.
    found
        The search ends after the round in which this number of minimisations has reached the least misfit.
    closeness
        Misfits that differ by less than this share belong to the same minimum.
    most_iterations
        Largest number of iterations of a local minimisation.
    """

    samples: int = 20
    starts: int = 8
    most_rounds: int = 5
    found: int = 3
    closeness: float = 1e-3
    most_iterations: int = 60

    def __post_init__(self) -> None:
        for name in ("samples", "starts", "most_rounds", "found", "most_iterations"):
            if getattr(self, name) < 1:
                raise SettingError(f"`{name}` is at least 1, got {getattr(self, name)}")
        if not 0.0 < self.closeness < 1.0:
            raise SettingError(f"`closeness` lies between 0 and 1, got {self.closeness}")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class MultistartResult(Summarised):
    """Minima, best first, shape (n_minima, n_params), with their misfits (n_minima,), and why the search ended.

    The trace of the search has one entry per iteration: `evaluations` so far, `best` misfit so far, and `median` misfit
    of the present round.
    """

    theta: NDArray[np.float64]
    misfit: NDArray[np.float64]
    stop_reason: str
    evaluations: tuple[int, ...]
    best: tuple[float, ...]
    median: tuple[float, ...]


def search_starts(
    objective: Objective,
    box: Box,
    searched: Box,
    settings: Multistart,
    *,
    rng: int,
    mirrored: tuple[int, ...] = (),
    on_iteration: Callable[[MultistartResult, float], None] | None = None,
) -> MultistartResult:
    """Run local minimisations inside `box` from starts that are sampled in the narrower box `searched`.

    Parameters
    ----------
    rng
        Seed; the same seed gives the same bits on any number of threads.
    mirrored
        Parameters whose signs can be changed together with little effect, but across a barrier that no local
        minimisation crosses; a further one starts from the mirror image of the best minimum.
    on_iteration
        Called after every iteration with the result so far and the share of the allowed iterations that is used up.

    Raises
    ------
    Interrupted
        On Ctrl-C once a candidate was simulated, carrying the `MultistartResult` so far.
    """
    n_free = len(searched.free)
    streams = Streams(rng=rng, replicate=np.zeros(1, dtype=np.int64), generation=np.zeros(1, dtype=np.int64))
    sample = latin_hypercube(streams, settings.samples * n_free, n_free)[0]
    starts = np.asarray(searched.theta_from_unit(sample))
    misfit = objective(starts)
    order = np.argsort(misfit, kind="stable")
    order = order[np.isfinite(misfit[order])]
    rounds = _Rounds(objective, starts[order], misfit[order])
    most = settings.most_rounds * settings.most_iterations

    def run_round(starts: NDArray[np.float64]) -> None:
        def advance(minima: LocalMinima) -> None:
            rounds.advance(minima)
            if on_iteration is not None:
                on_iteration(rounds.found(""), min(len(rounds.best) / most, 1.0))

        rounds.end(
            find_minima(objective, box, starts, max_iterations=settings.most_iterations, on_iteration=advance)
        )

    reason = "max_rounds"
    try:
        for first in range(0, min(order.size, settings.most_rounds * settings.starts), settings.starts):
            run_round(starts[order[first : first + settings.starts]])
            if rounds.n_at_best(settings.closeness) >= settings.found:
                reason = "found_again"
                break
        if mirrored and order.size:
            image = rounds.found("").theta[:1].copy()
            image[:, list(mirrored)] *= -1.0
            run_round(image)
    except KeyboardInterrupt as interrupt:
        raise Interrupted(rounds.found("interrupted"), "search") from interrupt
    return rounds.found(reason)


def distinct_minima(box: Box, theta: NDArray[np.float64], misfit: NDArray[np.float64]) -> NDArray[np.float64]:
    """The best minimum, and a distant one if its misfit is as good within 1 %; one or two rows.

    Parameters
    ----------
    theta, misfit
        Minima, best first, shape (n_minima, n_params) and (n_minima,).
    """
    unit = np.asarray(box.unit_from_theta(theta))
    distant = np.abs(unit - unit[0]).max(axis=1) > _DISTANT
    others = np.flatnonzero(distant & (misfit <= (1.0 + _CLOSE) * misfit[0]))
    return theta[[0, *others[:1]]]


class _Rounds:
    """State of the search: the best sample, the minima of the rounds that have ended, those of the present round."""

    def __init__(self, objective: Objective, theta: NDArray[np.float64], misfit: NDArray[np.float64]) -> None:
        self.objective = objective
        self.sampled = (theta[:1], misfit[:1])
        self.ended: list[LocalMinima] = []
        self.running: LocalMinima | None = None
        self.evaluations = [objective.tally.simulations]
        self.best = [float(misfit[0]) if misfit.size else math.inf]
        self.median = [float(np.median(misfit)) if misfit.size else math.inf]

    def advance(self, minima: LocalMinima) -> None:
        self.running = minima
        self.evaluations.append(self.objective.tally.simulations)
        self.best.append(min(self.best[-1], float(minima.misfit.min())))
        self.median.append(float(np.median(minima.misfit)))

    def end(self, minima: LocalMinima) -> None:
        self.running = None
        self.ended.append(minima)

    def n_at_best(self, closeness: float) -> int:
        """Number of local minimisations that ended at the least misfit."""
        misfit = np.concatenate([minima.misfit for minima in self.ended])
        return int(np.count_nonzero(misfit <= (1.0 + closeness) * misfit.min()))

    def found(self, stop_reason: str) -> MultistartResult:
        groups = [(minima.theta, minima.misfit) for minima in self.ended]
        if self.running is not None:
            groups.append((self.running.theta, self.running.misfit))
        theta, misfit = (np.concatenate(parts) for parts in zip(*(groups or [self.sampled]), strict=True))
        order = np.argsort(misfit, kind="stable")
        return MultistartResult(
            theta=theta[order],
            misfit=misfit[order],
            stop_reason=stop_reason,
            evaluations=tuple(self.evaluations),
            best=tuple(self.best),
            median=tuple(self.median),
        )
