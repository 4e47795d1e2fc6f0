"""A model run freely on one test, and how it compares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SimulationError
from mrwork.identification.fit import FitQuality
from mrwork.identification.nuisance import NuisanceName, nuisance_of
from mrwork.identification.quality import fit_quality
from mrwork.records import DamperTest
from mrwork.records.observation import delayed
from mrwork.simulate import Outcome, loading_of, simulate_forces


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
    result = simulate_forces(
        spec, theta[None], loading_of(test, spec).history(), substep_factor=substep_factor
    )
    outcome = Outcome(result.outcome[0])
    if outcome is not Outcome.FINISHED:
        raise SimulationError(f"{spec.name} on {test.name} ended as {outcome.name.lower()}: {outcome.remedy}")
    force = test.observation.observe(result.force[0], test.dt)
    nuisance = nuisance_of(force[test.counted], test.force[test.counted], test.dt, nuisances)
    if nuisances:
        force = nuisance.level * delayed(force, nuisance.delay / test.dt) + nuisance.offset
    return force, fit_quality(test, force, substeps=int(result.substeps[0]), nuisance=nuisance)
