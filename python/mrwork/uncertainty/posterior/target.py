"""Posterior density: prior times likelihood of all tests, for a batch of positions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import AnyNumbers, Shape, checked
from mrwork.errors import SettingError
from mrwork.identification.autocorrelation import effective_samples
from mrwork.identification.equivalent import Form
from mrwork.identification.objective import Objective
from mrwork.summary import Summarised
from mrwork.uncertainty.noise import Noise
from mrwork.uncertainty.posterior.prior import Prior
from mrwork.uncertainty.posterior.space import Space

Array = NDArray[np.float64]
_PARAMETERS = Shape(("n_params",))
Tempering = Literal["effective"] | float

# Largest number of force histories in memory.
_ROWS = 64


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Target(Summarised):
    """Log posterior density of positions of a `space`, up to a constant.

    Residuals are those of a free run, in units of the standard deviation of each test's force, `deviations` [N].
    Observation models and nuisance parameters act as in the fit; the latter take their least-squares values for each
    candidate. `temper` multiplies the log-likelihood.
    """

    _made_by: ClassVar[str] = "mr.uncertainty.Target.of(form, objective, noise, ...)"

    _units: ClassVar[Mapping[str, str]] = {"deviations": "N"}

    form: Form
    objective: Objective
    noise: Noise
    space: Space
    deviations: tuple[float, ...]
    temper: float

    @classmethod
    @checked
    def of(
        cls,
        form: Form,
        objective: Objective,
        noise: Noise,
        *,
        start: Annotated[Array, _PARAMETERS],
        priors: Mapping[str, Prior],
        tempering: Tempering | None,
    ) -> Target:
        """The target with tempering from the residuals at `start`, shape (n_params,).

        Parameters
        ----------
        tempering
            Factor of the log-likelihood: a number, or "effective" for n_eff / n, the share of independent samples among
            the residuals at the start. Default "effective" for noise models without correlation, 1 for those with it.
            Residuals of real tests are mostly model error with a lag-1 autocorrelation of 0.9 and more: 2000 count
            as some tens of independent observations, and intervals would be far too narrow if all were counted.

        Raises
        ------
        SettingError
            Where `tempering` is neither, or the start cannot be simulated.
        """
        target = cls(
            form=form,
            objective=objective,
            noise=noise,
            space=Space.of(form, noise, priors),
            deviations=tuple(each.deviation for each in objective.compared),
            temper=1.0,
        )
        if tempering is None:
            tempering = 1.0 if noise.correlated else "effective"
        if tempering == "effective":
            residuals = [residual[0] for residual, _, _ in target.residuals(start[None])]
            share = effective_samples(residuals) / objective.n_time
        else:
            share = float(tempering)
            if not 0.0 < share <= 1.0:
                raise SettingError(f"`tempering` is {share:g}; give 'effective', or a share above 0 up to 1")
        return replace(target, temper=share)

    @checked
    def __call__(self, position: Annotated[AnyNumbers, Shape(("n_batch", "n_dim"))]) -> Array:
        """Log posterior of each row of `position` (n_batch, n_dim), shape (n_batch,); -inf outside and on failure."""
        if position.shape[1] != self.space.n_dim:
            raise SettingError(
                f"`position` has shape {position.shape}; give shape (n_batch, {self.space.n_dim})"
            )
        values, inside = self.space.values(position)
        density = np.full(len(position), -np.inf)
        rows = np.flatnonzero(inside)
        if rows.size:
            within = values if rows.size == len(values) else values[rows]
            density[rows] = self.space.log_prior(within) + self.temper * self.log_likelihood(within)
        return density

    @checked
    def log_likelihood(self, values: Annotated[AnyNumbers, Shape(("n_batch", "n_values"))]) -> Array:
        """Untempered log-likelihood of parameters and noise, shape (n_batch,); -inf where a simulation failed."""
        n_params, n_noise = self.space.n_params, len(self.noise.parameters)
        if values.shape[1] != n_params + n_noise:
            raise SettingError(
                f"`values` has shape {values.shape}; give {n_params} parameters and {n_noise} of the noise in each row"
            )
        theta, noise = np.ascontiguousarray(values[:, :n_params]), values[:, n_params:]
        if self.noise.of_sum_of_squares and self.objective.is_direct:
            squared = np.zeros(len(theta))
            for run, deviation in zip(self.objective.misfits(theta), self.deviations, strict=True):
                squared += run.squared_error / deviation**2
            return self.noise.log_likelihood_of_sum(squared, self.objective.n_time, noise)
        return in_chunks(self._of_histories, theta, noise)

    def _of_histories(self, theta: Array, noise: Array) -> Array:
        total = np.zeros(len(theta))
        for residual, force, failed in self.residuals(theta):
            total += self.noise.log_densities(residual, force, noise).sum(axis=1)
            total[failed] = -np.inf
        return total

    @checked
    def residuals(
        self, theta: Annotated[AnyNumbers, Shape(("n_batch", "n_params"))]
    ) -> Iterator[tuple[Array, Array, NDArray[np.bool_]]]:
        """Residuals and forces about the measured mean, (n_batch, n_counted), and rows that failed, test by test.

        Both are in units of the deviation of the test's measured force; both are zero in rows that failed.
        """
        objective = self.objective
        objective.tally.simulations += len(theta)
        for each, deviation in zip(objective.compared, self.deviations, strict=True):
            residual, failed = each.residuals(theta, threads=objective.threads)
            residual /= deviation
            force = residual + (each.measured - each.measured.mean()) / deviation
            residual[failed] = 0.0
            force[failed] = 0.0
            yield residual, force, failed

    @checked
    def noise_at(self, theta: Annotated[Array, _PARAMETERS]) -> Array:
        """Moment estimates of the noise parameters, (n_noise,), at `theta` (n_params,), averaged over tests."""
        found = [
            self.noise.estimate(residual[0], force[0]) for residual, force, _ in self.residuals(theta[None])
        ]
        return np.asarray(np.mean(found, axis=0))

    @checked
    def position_of(self, theta: Annotated[Array, _PARAMETERS]) -> Array:
        """Position (n_dim,) of parameters (n_params,), clipped to the box, with the noise of the residuals."""
        values = np.concatenate([theta, self.noise_at(theta)])
        return np.asarray(self.space.position(self.space.box.inside(values)))


def in_chunks(function: Callable[[Array, Array], Array], theta: Array, noise: Array) -> Array:
    """Results of `function` for rows of parameters and noise, computed in chunks to limit memory."""
    chunks = -(-len(theta) // _ROWS)
    pairs = zip(np.array_split(theta, chunks), np.array_split(noise, chunks), strict=True)
    return np.concatenate([function(np.ascontiguousarray(rows), own) for rows, own in pairs])
