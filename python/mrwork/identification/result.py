"""The result of an identification at a minimum."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mrwork.identification.estimate import estimates_of
from mrwork.identification.fit import ErrorNorms, Fit, FitStatus, SearchTrace
from mrwork.identification.free_run import judge
from mrwork.identification.problem import Problem
from mrwork.identification.provenance import provenance_of


def fit_at(
    problem: Problem,
    theta: NDArray[np.float64],
    *,
    errors: NDArray[np.float64] | None,
    trace: SearchTrace,
    steps: int,
    status: FitStatus,
    seconds: float,
) -> Fit:
    """The fit at `theta` of the problem's form, shape (n_params,).

    Parameters
    ----------
    errors
        Standard errors, shape (n_params,), of the model asked for, where they are known.
    steps
        Of the last descent.
    """
    spec, objective = problem.spec, problem.objective
    values = np.asarray(problem.form.back(theta))
    runs = [judge(spec, values, test, nuisances=objective.nuisances) for test in objective.tests]
    quality = tuple(each for _, each in runs)
    nrmse = _rms([each.nrmse for each in quality])
    return Fit(
        model=spec.name,
        estimates=estimates_of(spec, problem.form, theta, errors, problem.settings.bounds),
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
        evaluations=objective.tally.simulations,
        refinement_steps=steps,
        seconds=seconds,
        n_time=sum(each.n_time for each in quality),
        provenance=provenance_of(problem),
        current=spec.current,
        nuisances=objective.nuisances,
        forces=tuple(force for force, _ in runs),
    )


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
