"""Check of a plan by nested Monte Carlo with draws of the posterior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import NotNegative
from mrwork.errors import SettingError
from mrwork.identification.nuisance import without_nuisance
from mrwork.simulate import Outcome, simulate_forces
from mrwork.summary import Summarised, Summary, rounded
from mrwork.uncertainty.planning.candidates import Candidate, motion_of
from mrwork.uncertainty.planning.plan import Gain, LinearisedPosterior, Plan, column_of
from mrwork.values import holds_arrays

# Smallest effective number of draws after a test for an estimate of the variance; number of draws taken as the truth.
_LEAST = 8.0
_TRUTHS = 60


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class CheckedPlan(Summarised):
    """A plan with gains from draws, their rank correlation (Spearman), and the least effective number of draws.

    `agreement` is `None` with fewer than three gains.
    """

    plan: Plan
    agreement: float | None
    least_effective: NotNegative

    @property
    def gains(self) -> tuple[Gain, ...]:
        """Candidates in order of gain, as those of the plan."""
        return self.plan.gains

    @property
    def band(self) -> str:
        """The band whose variance they reduce."""
        return self.plan.band

    def _summary(self) -> Summary:
        plan = self.plan._summary()
        return replace(
            plan,
            facts=(
                *plan.facts,
                ("rank correlation with draws", rounded(self.agreement, 2)),
                ("effective draws after a test", f"at least {rounded(self.least_effective, 3)}"),
            ),
        )


def normal_draws(
    posterior: LinearisedPosterior, n_draws: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Draws of the linearised posterior as parameters, shape (n_draws, n_params), clipped to the box."""
    root = np.linalg.cholesky(np.linalg.inv(posterior.precision))
    position = posterior.position + rng.standard_normal((n_draws, posterior.position.size)) @ root.T
    return posterior.scaled.parameters(np.clip(position, posterior.scaled.lower, posterior.scaled.upper))


def checked_with_draws(
    plan: Plan,
    posterior: LinearisedPosterior,
    draws: NDArray[np.float64],
    *,
    targets: Sequence[Candidate] = (),
    rng: np.random.Generator,
) -> CheckedPlan:
    """Estimate each gain of a plan from draws (n_draws, n_params) of the posterior.

    Some draws are taken as the truth in turn: the test is simulated with noise, the other draws are weighted by its
    likelihood, and the variance of the band among them is computed. The mean over the truths is the expected remaining
    variance (nested Monte Carlo, Ryan, Journal of Computational and Graphical Statistics 12, 2003, 585-603).

    Parameters
    ----------
    draws
        Parameters of the model of `posterior`; rows that cannot be simulated are left out.

    Raises
    ------
    SettingError
        Where there are too few draws.
    """
    if len(draws) < 2 * _LEAST:
        raise SettingError(f"{len(draws)} draws are too few to weigh against each other; give some hundreds")
    forces = _forces(posterior, draws, [each.candidate for each in plan.gains])
    of_targets = _forces(posterior, draws, targets) if targets else forces
    usable = np.all([np.isfinite(each.corrected).all(axis=1) for each in [*forces, *of_targets]], axis=0)
    forces, of_targets = ([_rows(each, usable) for each in group] for group in (forces, of_targets))
    gram = _band_gram(posterior, draws[usable], of_targets, plan.band)
    n_draws = len(gram)
    variance_now = float(_variances(gram, np.full((1, n_draws), 1.0 / n_draws))[0])
    truths = rng.choice(n_draws, size=min(_TRUTHS, n_draws), replace=False)
    gains, least = [], float(n_draws)
    for gain, response in zip(plan.gains, forces, strict=True):
        weights = _weights(posterior, response.corrected, truths, rng)
        counted = float(np.median(1.0 / np.sum(weights**2, axis=1)))
        least = min(least, counted)
        reliable = counted >= _LEAST and variance_now > 0.0
        drawn = 1.0 - float(np.mean(_variances(gram, weights))) / variance_now if reliable else None
        gains.append(replace(gain, drawn=drawn))
    from scipy.stats import spearmanr

    pairs = [(each.gain, each.drawn) for each in gains if each.drawn is not None]
    agreement = float(spearmanr(*np.array(pairs).T).statistic) if len(pairs) > 2 else None
    return CheckedPlan(plan=replace(plan, gains=tuple(gains)), agreement=agreement, least_effective=least)


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class _Forces:
    """Forces of the draws minus their mean, (n_draws, n_counted), per its deviation and root n; energies of a cycle.

    `corrected` has the forces after nuisance parameters have been fitted.
    """

    force: NDArray[np.float64]
    corrected: NDArray[np.float64]
    energy: NDArray[np.float64]


def _forces(
    posterior: LinearisedPosterior, draws: NDArray[np.float64], candidates: Sequence[Candidate]
) -> list[_Forces]:
    found = []
    for candidate in candidates:
        loading, counted = motion_of(candidate, posterior.spec)
        run = simulate_forces(posterior.spec, draws, loading.history(), threads=posterior.threads)
        force = np.where((run.outcome == Outcome.FINISHED)[:, None], run.force[:, counted], np.nan)
        middle = np.nanmean(force, axis=0)
        size = np.std(middle) * np.sqrt(middle.size)
        velocity = candidate.peak_velocity * np.cos(
            2.0 * np.pi * candidate.frequency * loading.dt * np.arange(counted.start, counted.stop)
        )
        energy = force @ velocity
        found.append(
            _Forces(
                force=(force - middle) / size,
                corrected=without_nuisance(force, middle, posterior.nuisances) / size,
                energy=energy / float(np.nanmean(energy)),
            )
        )
    return found


def _rows(forces: _Forces, usable: NDArray[np.bool_]) -> _Forces:
    return _Forces(
        force=forces.force[usable], corrected=forces.corrected[usable], energy=forces.energy[usable]
    )


def _band_gram(
    posterior: LinearisedPosterior, draws: NDArray[np.float64], of_targets: Sequence[_Forces], band: str
) -> NDArray[np.float64]:
    """Inner products of the draws in the quantity of the band, shape (n_draws, n_draws)."""
    if band == "force":
        return np.asarray(np.mean([each.force @ each.force.T for each in of_targets], axis=0))
    if band == "energy":
        return np.asarray(np.mean([np.outer(each.energy, each.energy) for each in of_targets], axis=0))
    index = column_of(posterior, band)
    value = posterior.scaled.position(draws)[:, index]
    return np.outer(value - value.mean(), value - value.mean())


def _weights(
    posterior: LinearisedPosterior,
    corrected: NDArray[np.float64],
    truths: NDArray[np.int64],
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Posterior weight of each draw after the test of each truth, shape (n_truths, n_draws), rows of sum 1."""
    measured = corrected[truths] + rng.standard_normal((truths.size, corrected.shape[1])) / np.sqrt(
        posterior.weight
    )
    exponent = (
        -0.5 * posterior.weight * (np.einsum("jt,jt->j", corrected, corrected) - 2.0 * measured @ corrected.T)
    )
    # The truth itself is excluded, for it would always have the largest weight.
    exponent[np.arange(truths.size), truths] = -np.inf
    weights = np.exp(exponent - exponent.max(axis=1, keepdims=True))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _variances(gram: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Variance for each row of weights, from inner products."""
    return np.asarray(weights @ np.diag(gram) - np.einsum("kj,kj->k", weights @ gram, weights))
