"""The likelihood of tests under a noise model as a function of JAX."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jax import Array

from mrwork.base.arguments import Threads, checked
from mrwork.dampers.coordinates import Coordinates
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.identification.candidates import CandidateObjective
from mrwork.identification.objective import Objective
from mrwork.identification.traced_objective import (
    ComparedArrays,
    Residuals,
    candidate_objective,
    form_of,
    function_of,
)
from mrwork.records import DamperTest
from mrwork.twins.traced_function import TracedFunction
from mrwork.uncertainty.noise import Noise, noise_model
from mrwork.uncertainty.posterior.target import with_noise

_OUTSIDE_BOX = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class LogLikelihood:
    """Log-likelihood as a function of the parameters of model and noise, and of tests."""

    residuals: Residuals
    noise: Noise
    deviations: tuple[float, ...]

    @classmethod
    def of(cls, objective: Objective, noise: Noise, residuals: Residuals) -> LogLikelihood:
        """The likelihood of an objective whose residuals have this form."""
        if not all(test.is_plain for test in objective.compared):
            raise SettingError(
                "this objective has weights or a loss, and a likelihood has its noise in their place; leave one out"
            )
        return cls(
            residuals=residuals, noise=noise, deviations=tuple(test.deviation for test in objective.compared)
        )

    def __call__(self, values: Array, tests: Sequence[ComparedArrays]) -> Array:
        """Sum over all samples that are compared; -inf where a simulation failed, or the noise leaves its range."""
        n_params = len(self.residuals.kernel.spec.parameters)
        theta, noise_values = values[:n_params], values[n_params:]
        lower, upper = jnp.array(
            [(parameter.lower, parameter.upper) for parameter in self.noise.parameters]
        ).T
        inside = jnp.isclose(noise_values, jnp.clip(noise_values, lower, upper), rtol=_OUTSIDE_BOX, atol=0.0)
        noise = jnp.where(inside, noise_values, upper)
        total, failures = jnp.zeros(()), [~jnp.all(inside)]
        for deviation, (newtons, failed) in zip(
            self.deviations, self.residuals.newtons(theta, tests), strict=True
        ):
            residual = newtons / deviation
            total = total + jnp.sum(self.noise.log_densities(residual[None], noise[None]))  # type: ignore[arg-type] # arrays of JAX
            failures.append(failed)
        failed = jnp.any(jnp.stack(failures))
        return jnp.where(failed, -jnp.inf, jnp.where(failed, 0.0, total))


@checked
def log_likelihood(
    model: DamperSpec | str | CandidateObjective,
    tests: DamperTest | Sequence[DamperTest] | None = None,
    noise: str = "iid",
    *,
    coordinates: Coordinates | None = None,
    substeps: int | None = None,
    threads: Threads = 1,
) -> TracedFunction:
    """The log-likelihood of tests as a function of the free parameters of model and noise, for JAX.

    Residuals of a free run on real tests are mostly model error, which repeats from sample to sample: as independent
    noise they make intervals far too narrow. Take correlated noise, "ar1", or multiply by the share of independent
    samples, as `mr.sample` does.

    Parameters
    ----------
    model, tests, substeps, threads
        As in `mr.jax.misfit`. The exponent of the force of an objective has no part in a likelihood.
    noise
        Name of a noise model; its parameters are in units of the standard deviation of the measured force of each test.
    coordinates
        As in `mr.jax.misfit`, for the parameters of the noise too.

    Returns
    -------
    TracedFunction
        Of a point, shape (n_free + n_noise,), with the noise last, the log-likelihood; -inf where a simulation fails or
        the noise is outside its range, with a derivative of zero.

    Raises
    ------
    SettingError
        Where the objective has weights or a loss, in whose place a likelihood has its noise.

    Examples
    --------
    >>> import jax, jax.numpy as jnp, mrwork as mr
    >>> likelihood = mr.jax.log_likelihood("bingham", mr.synthetic_test("spencer1997"), "ar1", coordinates="unit")
    >>> likelihood.names
    ('f_c', 'v_s', 'c0', 'f0', 'noise.sigma', 'noise.phi')
    >>> jax.grad(likelihood)(jnp.full(6, 0.5)).shape
    (6,)
    """
    density = noise_model(noise)
    objective = candidate_objective(model, tests, coordinates)
    compute = LogLikelihood.of(objective.objective, density, form_of(objective, substeps, threads))
    box = with_noise(objective.box, density)
    middle = box.theta_from_unit(np.full(len(box.free), 0.5))[len(objective.box.names) :]
    return function_of(objective, compute, "Log-likelihood", box=box, start=middle)
