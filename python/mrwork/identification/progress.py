"""Progress of an identification, and who is told of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mrwork.identification.objective import Tally
from mrwork.store import Journal

Stage = Literal["search", "screening", "refinement"]
Unit = Literal["simulations", "%", "steps"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """Where an identification stands; `share` is the part of the stage's allowance that is used up.

    `generation` of the search with the `median_percent` of its population's fits; 0 and NaN outside a search.
    `evaluations` and time `steps` were simulated so far.
    """

    stage: Stage
    count: int
    unit: Unit
    fit_percent: float
    share: float
    seconds: float
    generation: int
    median_percent: float
    evaluations: int
    steps: int


class Stopped(KeyboardInterrupt):
    """The callback wants no more: a run ends the way Ctrl-C ends it, but with a result."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """The clock of an identification that `began` [s] then, its tally, and the callback that is told, if any.

    Nothing is told of what is recalled from a journal.
    """

    began: float
    tally: Tally
    on_progress: Callable[[Progress], bool | None] | None
    journal: Journal | None

    @property
    def seconds(self) -> float:
        """Since the identification began [s]."""
        return time.perf_counter() - self.began

    def tell(
        self,
        stage: Stage,
        count: int,
        unit: Unit,
        misfit: float,
        share: float,
        *,
        generation: int = 0,
        median: float = np.nan,
    ) -> None:
        """Call the callback.

        Raises
        ------
        Stopped
            Where it returns true.
        """
        if self.on_progress is None or (self.journal is not None and self.journal.recalling):
            return
        progress = Progress(
            stage=stage,
            count=count,
            unit=unit,
            fit_percent=100.0 * (1.0 - misfit),
            share=share,
            seconds=self.seconds,
            generation=generation,
            median_percent=100.0 * (1.0 - median),
            evaluations=self.tally.simulations,
            steps=self.tally.steps,
        )
        if self.on_progress(progress):
            raise Stopped
