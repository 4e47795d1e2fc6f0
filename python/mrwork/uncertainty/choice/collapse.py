"""Families of models that collapse: a simpler family of the same comparison has the same fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.identification.covariance import effective_samples
from mrwork.identification.fit import Fit
from mrwork.identification.verdicts import scales_of
from mrwork.records import DamperTest
from mrwork.uncertainty.noise import NOISES
from mrwork.uncertainty.posterior.target import target_of

# Residuals of each test, in deviations of its force, shape (n_counted,).
Residuals = Sequence[Floats]

# Gain in the log-likelihood ratio, for each further parameter, that is not more than chance (Akaike's criterion).
_CHANCE = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Collapse:
    """The simpler family, `model`, that gives the same force, and the reason in words."""

    model: str
    reason: str


def residuals_of(fit: Fit, tests: tuple[DamperTest, ...]) -> tuple[Floats, ...]:
    """Residuals of a fit, test by test, in deviations of the test's measured force, shape (n_counted,)."""
    target, theta = target_of(fit, tests, NOISES["iid"], tempering=1.0)
    return tuple(residual[0] for residual, _ in target.residuals(theta[None]))


def find_collapses(
    fits: Mapping[str, Fit],
    residuals: Mapping[str, Residuals],
    n_params: Mapping[str, int],
    tests: tuple[DamperTest, ...],
) -> dict[str, Collapse]:
    """Families, by model, with the simplest family that has the same fit.

    The forces are the same up to chance: the mean square of the difference of the residuals, and the gain in the
    log-likelihood, `n_eff ln(S_simpler/S)`, are at most 2 for each further parameter (Akaike's criterion), with the
    effective samples of the best fit. And more of its parameters are on a bound or undetermined, that is with a
    standard error above their value or half their range.
    """
    n_effective = effective_samples(residuals[min(fits, key=lambda model: fits[model].nrmse)])
    doubtful = {model: _doubtful_parameters(fit, tests) for model, fit in fits.items()}
    n_doubtful = {model: sum(map(len, states.values())) for model, states in doubtful.items()}
    joined = {model: np.concatenate(residuals[model]) for model in fits}
    collapses: dict[str, Collapse] = {}
    for model in fits:
        simpler = sorted(
            (fit for fit in fits if n_params[fit] < n_params[model]), key=lambda fit: n_params[fit]
        )
        for other in simpler:
            chance = _CHANCE * (n_params[model] - n_params[other]) / n_effective
            squared, theirs = (float(np.mean(joined[name] ** 2)) for name in (model, other))
            difference = float(np.mean((joined[model] - joined[other]) ** 2))
            same = difference <= chance * theirs and theirs <= squared * np.exp(chance)
            if same and n_doubtful[model] > n_doubtful[other]:
                states = [
                    f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} {state}"
                    for state, names in doubtful[model].items()
                    if names
                ]
                collapses[model] = Collapse(
                    model=other,
                    reason=f"its force is that of {fits[other].spec.title} to {100.0 * np.sqrt(difference):.2g} % of "
                    f"the force's deviation, and {' and '.join(states)}",
                )
                break
    return collapses


def _doubtful_parameters(fit: Fit, tests: tuple[DamperTest, ...]) -> dict[str, list[str]]:
    """Free parameters on a bound, and those with a standard error above their value or half their range, or none."""
    spec, theta = fit.spec, np.array(fit.theta)
    scales = scales_of(spec, Box.of(spec).with_bounds(fit.settings.bounds), tests, theta)
    free = [(index, estimate) for index, estimate in enumerate(fit.estimates) if estimate.is_free]
    return {
        "on a bound": [estimate.name for _, estimate in free if estimate.at_bound],
        "undetermined": [
            estimate.name
            for index, estimate in free
            if estimate.verdict == "not identifiable"
            or (estimate.standard_error is not None and estimate.standard_error > scales[index].size)
        ],
    }
