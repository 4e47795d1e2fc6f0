"""The default search of a plain model: descents from the best of many starts, until the best find is found again.

Where the misfit is smooth, as that of a hysteresis model is but for a few kinks, a descent of two hundred simulations
ends in a minimum that a population of thousands only comes near. What it lacks is knowing whether its minimum is the
lowest; so several start at once, and more follow until the lowest has been reached more than once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.errors import Interrupted, SettingError
from mrwork.identification.levenberg_marquardt import Minima, descend_all
from mrwork.identification.objective import Objective
from mrwork.search.unit_cube import Streams, latin_hypercube

_CLOSE = 0.01
_ELSEWHERE = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Multistart:
    """Settings of the search.

    Parameters
    ----------
    samples
        Points of the Latin hypercube per free parameter; the best of them are started from.
    starts
        Descents of a round, which run side by side.
    most_rounds
        Rounds at most.
    found
        The search ends after the round in which so many descents have reached the least misfit.
    closeness
        Misfits that differ by less than this share are the same minimum.
    most_iterations
        Of a descent.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class MultistartResult:
    """Minima, best first, shape (n_minima, n_params), with their misfits (n_minima,), and why the search ended.

    `evaluations`, `best` and `median` (n_iterations,) tell its course: simulations so far, least misfit, and the
    median of the descents under way.
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
    """Descend inside `box` from starts spread over the narrower box `searched`.

    Parameters
    ----------
    rng
        Seed; the same seed gives the same bits on any number of threads.
    mirrored
        Parameters whose signs can be changed together with little effect, but through a barrier that no descent
        crosses; the best minimum is tried again from its mirror image.
    on_iteration
        Called after every iteration with what was found so far and the share of the allowance that is used up.

    Raises
    ------
    Interrupted
        On Ctrl-C once a candidate was simulated, carrying what was `MultistartResult`.
    """
    n_free = len(searched.free)
    streams = Streams(rng=rng, replicate=np.zeros(1, dtype=np.int64), generation=np.zeros(1, dtype=np.int64))
    sample = latin_hypercube(streams, settings.samples * n_free, n_free)[0]
    starts = np.asarray(searched.theta_from_unit(sample))
    misfit = objective(starts)
    order = np.argsort(misfit, kind="stable")
    order = order[np.isfinite(misfit[order])]
    descents = _Descents(objective, starts[order], misfit[order])
    most = settings.most_rounds * settings.most_iterations

    def descend(chosen: NDArray[np.float64]) -> None:
        def tell(minima: Minima) -> None:
            descents.go_on(minima)
            if on_iteration is not None:
                on_iteration(descents.found(""), min(len(descents.best) / most, 1.0))

        descents.end(
            descend_all(objective, box, chosen, max_iterations=settings.most_iterations, on_iteration=tell)
        )

    reason = "max_rounds"
    try:
        for first in range(0, min(order.size, settings.most_rounds * settings.starts), settings.starts):
            descend(starts[order[first : first + settings.starts]])
            if descents.n_at_best(settings.closeness) >= settings.found:
                reason = "found_again"
                break
        if mirrored and order.size:
            image = descents.found("").theta[:1].copy()
            image[:, list(mirrored)] *= -1.0
            descend(image)
    except KeyboardInterrupt as interrupt:
        raise Interrupted(descents.found("interrupted"), "search") from interrupt
    return descents.found(reason)


def distinct_minima(box: Box, theta: NDArray[np.float64], misfit: NDArray[np.float64]) -> NDArray[np.float64]:
    """The best minimum, and another if one is as good within 1 % and lies elsewhere; one or two rows.

    Parameters
    ----------
    theta, misfit
        Minima, best first, shape (n_minima, n_params) and (n_minima,).
    """
    unit = np.asarray(box.unit_from_theta(theta))
    elsewhere = np.abs(unit - unit[0]).max(axis=1) > _ELSEWHERE
    others = np.flatnonzero(elsewhere & (misfit <= (1.0 + _CLOSE) * misfit[0]))
    return theta[[0, *others[:1]]]


class _Descents:
    """What has been found so far: the samples, the minima where descents ended, those under way."""

    def __init__(self, objective: Objective, theta: NDArray[np.float64], misfit: NDArray[np.float64]) -> None:
        self.objective = objective
        self.sampled = (theta[:1], misfit[:1])
        self.ended: list[Minima] = []
        self.running: Minima | None = None
        self.evaluations = [objective.tally.simulations]
        self.best = [float(misfit[0]) if misfit.size else math.inf]
        self.median = [float(np.median(misfit)) if misfit.size else math.inf]

    def go_on(self, minima: Minima) -> None:
        self.running = minima
        self.evaluations.append(self.objective.tally.simulations)
        self.best.append(min(self.best[-1], float(minima.misfit.min())))
        self.median.append(float(np.median(minima.misfit)))

    def end(self, minima: Minima) -> None:
        self.running = None
        self.ended.append(minima)

    def n_at_best(self, closeness: float) -> int:
        """How many descents ended at the least misfit."""
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
