"""Forces that the parameters could also give: of draws of the posterior, or of the Fisher ellipsoid without one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError, SimulationError
from mrwork.identification.fit import Fit
from mrwork.identification.problem import Problem
from mrwork.identification.residual import ObservedTest
from mrwork.records import DamperTest
from mrwork.uncertainty.bands.band import simulate_draws
from mrwork.uncertainty.noise import noise_model
from mrwork.uncertainty.posterior.draws_file import StoredDraws
from mrwork.uncertainty.posterior.laplace import first_walkers
from mrwork.uncertainty.posterior.target import Target

Array = NDArray[np.float64]

_DRAWS = 200


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ParameterDraws:
    """Parameters `theta`, shape (n_draws, n_params), and in words where they come from."""

    theta: Array
    origin: str


def parameter_draws(
    fit: Fit, tests: Sequence[DamperTest], stored: StoredDraws | None
) -> ParameterDraws | None:
    """Draws of the parameters of a fit; `None` where its tests say too little for an ellipsoid."""
    if stored is not None:
        theta = stored.theta(fit.spec.names)
        chosen = np.linspace(0, len(theta) - 1, min(_DRAWS, len(theta))).astype(int)
        return ParameterDraws(theta=theta[chosen], origin="the posterior")
    problem = Problem.of_fit(fit, tuple(tests))
    form, start = problem.form, problem.inside(fit.theta)
    try:
        target = Target.of(
            form, problem.objective, noise_model("iid"), start=start, priors={}, tempering=None
        )
        position = first_walkers(target, start, _DRAWS, np.random.default_rng(0))
    except (SettingError, np.linalg.LinAlgError):
        return None
    values = np.asarray(target.space.values(position)[0])[:, : target.space.n_params]
    return ParameterDraws(theta=np.asarray(form.back(values)), origin="the Fisher ellipsoid about the fit")


def drawn_forces(fit: Fit, draws: ParameterDraws, test: DamperTest) -> Array | None:
    """Forces of the draws on a test [N], shape (n_draws, n_time), relieved of nuisances as in the fit.

    `None` where too many of them cannot be simulated.
    """
    try:
        forces = simulate_draws(fit.spec, draws.theta, test)
    except SimulationError:
        return None
    if not fit.nuisances:
        return forces
    observed = ObservedTest.of(fit.spec, test, fit.nuisances)
    return np.array([observed.relieved(force)[0] for force in forces])
