"""A model run freely on one test, and how it compares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.spec import DamperSpec
from mrwork.identification.fit import ErrorNorms, FitQuality
from mrwork.identification.nuisance import NONE, Nuisance, NuisanceName
from mrwork.identification.residual import ObservedTest
from mrwork.records import DamperTest


def judge(
    spec: DamperSpec,
    theta: NDArray[np.float64],
    test: DamperTest,
    *,
    nuisances: tuple[NuisanceName, ...] = (),
    substep_factor: int = 1,
) -> tuple[NDArray[np.float64], FitQuality]:
    """Free-run a model on a test: its force as recorded [N], shape (n_time,), and how it compares.

    Parameters
    ----------
    nuisances
        What is estimated from the test itself before the comparison.

    Raises
    ------
    SimulationError
        Where the simulation diverges or cannot be resolved.
    """
    observed = ObservedTest.of(spec, test, nuisances)
    force, nuisance, substeps = observed.predicted(theta, substep_factor=substep_factor)
    return force, fit_quality(test, force, substeps=substeps, nuisance=nuisance)


def fit_quality(
    test: DamperTest, force: NDArray[np.float64], *, substeps: int, nuisance: Nuisance = NONE
) -> FitQuality:
    """Compare a free-run force [N], shape (n_time,), as the rig would have recorded it, with the measured one.

    `E_t = e_t/s_F` and likewise `E_x`, `E_v`, with `e_t^2 = int r^2 dt`, `e_x^2 = int r^2 |x'| dt`,
    `e_v^2 = int r^2 |v'| dt` and `s_F^2 = int (F - mean F)^2 dt` (Spencer et al. 1997, eqs. 13-16);
    `fit % = 100 (1 - |r|/|F - mean F|)`, `NRMSE = rms(r)/std(F)`.
    """
    counted = test.counted
    residual = (force - test.force)[counted]
    deviation = test.force[counted] - test.force[counted].mean()
    velocity = test.velocity[counted]
    acceleration = np.gradient(test.velocity, test.dt)[counted]
    s_F = np.trapezoid(deviation**2)
    norms = (np.trapezoid(residual**2 * weight) / s_F for weight in (1.0, abs(velocity), abs(acceleration)))
    e_t, e_x, e_v = (float(np.sqrt(norm)) for norm in norms)
    rmse = float(np.sqrt(np.mean(residual**2)))
    nrmse = rmse / float(np.std(test.force[counted]))
    return FitQuality(
        test=test.name,
        fit_percent=100.0 * (1.0 - nrmse),
        nrmse=nrmse,
        rmse_n=rmse,
        error_norms=ErrorNorms(time=e_t, displacement=e_x, velocity=e_v),
        residual_autocorrelation=_lag_one(residual),
        n_time=residual.size,
        settle_seconds=test.n_settle * test.dt,
        substeps=substeps,
        observation=test.observation,
        nuisance=nuisance,
    )


def _lag_one(residual: NDArray[np.float64]) -> float:
    """Correlation of the residual with itself one sample later."""
    centred = residual - residual.mean()
    power = float(centred @ centred)
    return float(centred[1:] @ centred[:-1]) / power if power > 0.0 else 0.0
