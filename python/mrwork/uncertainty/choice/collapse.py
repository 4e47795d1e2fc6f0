"""Families of models that collapse: a simpler family of the same comparison has the same fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.identification.covariance import effective_samples
from mrwork.identification.fit import Fit
from mrwork.identification.verdicts import parameter_scales
from mrwork.records import DamperTest
from mrwork.uncertainty.bands.prediction import predictions_of
from mrwork.uncertainty.choice.ranking import Standing

# Gain in the log-likelihood ratio, for each further parameter, that is not more than chance (Akaike's criterion).
_CHANCE = 2.0


def with_collapses(
    rows: Sequence[Standing], fits: Mapping[str, Fit], tests: tuple[DamperTest, ...]
) -> list[Standing]:
    """The rows, of which those that collapse name the simplest family that has the same fit, and the reason.

    The forces are the same up to chance: the mean square of the difference of the residuals, and the gain in the
    log-likelihood, `n_eff ln(S_simpler/S)`, are at most 2 for each further parameter (Akaike's criterion), with the
    effective samples of the best fit. And more of its parameters are on a bound or undetermined, that is with a
    standard error above their value or half their range.
    """
    if not fits:
        return [*rows]
    residuals = {model: _residuals_of(fit, tests) for model, fit in fits.items()}
    n_effective = effective_samples(residuals[min(fits, key=lambda model: fits[model].nrmse)])
    joined = {model: np.concatenate(parts) for model, parts in residuals.items()}
    doubtful = {model: _doubtful_parameters(fit, tests) for model, fit in fits.items()}
    by_size = sorted((standing for standing in rows if standing.model in fits), key=attrgetter("n_params"))

    def reason_for(standing: Standing, simpler: Standing) -> str:
        """Why a family counts as a simpler one; empty where it does not."""
        model, other = standing.model, simpler.model
        chance = _CHANCE * (standing.n_params - simpler.n_params) / n_effective
        squared, theirs = (float(np.mean(joined[name] ** 2)) for name in (model, other))
        difference = float(np.mean((joined[model] - joined[other]) ** 2))
        same = difference <= chance * theirs and theirs <= squared * np.exp(chance)
        n_doubtful, n_theirs = (sum(map(len, doubtful[name].values())) for name in (model, other))
        if not same or n_doubtful <= n_theirs:
            return ""
        states = [
            f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} {state}"
            for state, names in doubtful[model].items()
            if names
        ]
        return (
            f"its force is that of {simpler.title} to {100.0 * np.sqrt(difference):.2g} % of the force's deviation, "
            f"and {' and '.join(states)}"
        )

    def judged(standing: Standing) -> Standing:
        for simpler in by_size if standing.model in fits else []:
            if simpler.n_params < standing.n_params and (reason := reason_for(standing, simpler)):
                return replace(standing, same_as=simpler.model, reason=reason)
        return standing

    return [judged(standing) for standing in rows]


def _residuals_of(fit: Fit, tests: tuple[DamperTest, ...]) -> list[Floats]:
    predictions = predictions_of(fit, tests)
    return [prediction.residual / np.std(prediction.measured) for prediction in predictions]


def _doubtful_parameters(fit: Fit, tests: tuple[DamperTest, ...]) -> dict[str, list[str]]:
    """Free parameters on a bound, and those with a standard error above their value or half their range, or none."""
    spec, theta = fit.spec, np.array(fit.theta)
    scales = parameter_scales(spec, Box.of(spec).with_bounds(fit.settings.bounds), tests, theta)
    free = [(index, estimate) for index, estimate in enumerate(fit.estimates) if estimate.is_free]
    return {
        "on a bound": [estimate.name for _, estimate in free if estimate.at_bound],
        "undetermined": [
            estimate.name
            for index, estimate in free
            if estimate.verdict.word == "not identifiable"
            or (
                estimate.verdict.word == "weakly identifiable" and not estimate.at_bound
                if estimate.standard_error is None
                else estimate.standard_error > scales[index].size
            )
        ],
    }
