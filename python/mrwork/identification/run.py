"""An identification under way: where it stands, and the result that can be made of it at any time."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.spec import DamperSpec
from mrwork.identification.equivalent import Form
from mrwork.identification.estimate import estimates_of
from mrwork.identification.fit import Engine, ErrorNorms, Fit, FitStatus, SearchTrace
from mrwork.identification.free_run import judge
from mrwork.identification.multistart import Multistart
from mrwork.identification.objective import Objective
from mrwork.identification.provenance import provenance_of
from mrwork.search import EfficientGA

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What stays the same from the first candidate to the result."""

    spec: DamperSpec
    form: Form
    objective: Objective
    search: Multistart | EfficientGA
    bounds: dict[str, tuple[float, float]]
    starts: tuple[dict[str, float], ...]
    engine: Engine
    rng: int
    began: float

    def progress(
        self,
        stage: Stage,
        count: int,
        unit: Unit,
        misfit: float,
        share: float,
        *,
        generation: int,
        median: float,
    ) -> Progress:
        """Where it stands, for who watches."""
        return Progress(
            stage=stage,
            count=count,
            unit=unit,
            fit_percent=100.0 * (1.0 - misfit),
            share=share,
            seconds=time.perf_counter() - self.began,
            generation=generation,
            median_percent=100.0 * (1.0 - median),
            evaluations=self.objective.tally.simulations,
            steps=self.objective.tally.steps,
        )

    def fit(
        self,
        theta: NDArray[np.float64],
        errors: NDArray[np.float64] | None,
        trace: SearchTrace,
        steps: int,
        status: FitStatus,
    ) -> Fit:
        """The result at `theta`, shape (n_params,), with standard errors (n_params,) where they are known."""
        values = np.asarray(self.form.back(theta))
        tests = self.objective.tests
        nuisances = self.objective.nuisances
        quality = tuple(judge(self.spec, values, test, nuisances=nuisances)[1] for test in tests)
        nrmse = _rms([each.nrmse for each in quality])
        return Fit(
            model=self.spec.name,
            estimates=estimates_of(self.spec, self.form, theta, errors, self.bounds),
            status=status,
            stop_reason=trace.stop_reason,
            nrmse=nrmse,
            fit_percent=100.0 * (1.0 - nrmse),
            rmse_n=_rms([each.rmse_n for each in quality]),
            error_norms=ErrorNorms(
                time=_rms([each.error_norms.time for each in quality]),
                displacement=_rms([each.error_norms.displacement for each in quality]),
                velocity=_rms([each.error_norms.velocity for each in quality]),
            ),
            quality=quality,
            trace=trace,
            evaluations=self.objective.tally.simulations,
            refinement_steps=steps,
            seconds=time.perf_counter() - self.began,
            n_time=sum(each.n_time for each in quality),
            provenance=provenance_of(
                tests,
                search=self.search,
                bounds=self.bounds,
                starts=self.starts,
                power=self.objective.power,
                engine=self.engine,
                rng=self.rng,
            ),
            current=self.spec.current,
            nuisances=nuisances,
        )


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
