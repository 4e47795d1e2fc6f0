"""No-U-turn sampler of numpyro, as a check of the ensemble by another sampler."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mrwork.base.arguments import Count, Seed, checked
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import SettingError
from mrwork.identification.traced import Residuals, arrays_of
from mrwork.twins.models import on_processor
from mrwork.uncertainty.posterior.laplace import centre_and_root
from mrwork.uncertainty.posterior.target import Target
from mrwork.uncertainty.traced_likelihood import LogLikelihood

LogDensity = Callable[[jax.Array], jax.Array]


def traced_log_posterior(target: Target) -> LogDensity:
    """Log posterior of one position, (n_dim,), that of `target` as a function of JAX; -inf where it is not finite."""
    objective, space = target.objective, target.space
    free = [index for index in space.box.free if index < space.n_params]
    residuals = Residuals.of(objective, columns=free, substeps=None, threads=1)
    likelihood = LogLikelihood.of(objective, target.noise, residuals)
    tests = arrays_of(objective)

    def log_posterior(position: jax.Array) -> jax.Array:
        values, inside = space.values(position)
        density = space.log_prior(values) + target.temper * likelihood(values, tests)
        return jnp.where(inside & jnp.isfinite(density), density, -jnp.inf)

    return log_posterior


@array_dataclass(repr=False)
class NutsDraws(Summarised):
    """Parameters and noise, shape (n_chains, n_draws, n_params + n_noise), and the number of divergent trajectories."""

    values: Floats
    diverged: int
    evaluations: int


@array_dataclass()
class Trajectories:
    """Unbounded coordinates in which the target is nearly standard normal: logits, scaled by the Fisher ellipsoid.

    In place of k and k x0, where bounds of the second would depend on the first, it has k and x0, with the volume |k|.
    """

    target: Target
    origin: Floats
    root: Floats
    stiffness: int | None
    log_density: LogDensity

    @classmethod
    def of(cls, target: Target, start: Floats) -> Trajectories:
        """The coordinates about `start`, (n_params,)."""
        pair = target.space.pair
        even_in_product = pair is not None and target.space.priors[pair[1]] is None
        plain = replace(target, space=replace(target.space, pair=None))
        origin, root = centre_and_root(plain, start)
        # The logit of a fit on a face of the box is infinite; one standard deviation inside is typical of the draws.
        deviation = np.minimum(np.sqrt(np.sum(root**2, axis=1)), 0.25)
        inside = np.clip(origin, deviation, 1.0 - deviation)
        slope = 1.0 / (inside * (1.0 - inside))
        return cls(
            target=plain,
            origin=np.log(inside) - np.log1p(-inside),
            root=slope[:, None] * root,
            stiffness=plain.space.box.free[pair[0]] if pair is not None and even_in_product else None,
            log_density=traced_log_posterior(plain),
        )

    def position(self, point: jax.Array) -> jax.Array:
        """Unit coordinates, (n_dim,), of a point on a trajectory."""
        return jax.nn.sigmoid(self.origin + self.root @ point)

    def potential(self, point: jax.Array) -> jax.Array:
        """Negative log density of a point."""
        latent = self.origin + self.root @ point
        position = jax.nn.sigmoid(latent)
        density = self.log_density(position)
        density = density + jnp.sum(jax.nn.log_sigmoid(latent) + jax.nn.log_sigmoid(-latent))
        if self.stiffness is not None:
            density = density + jnp.log(jnp.abs(self.target.space.values(position)[0][self.stiffness]))
        return -density


@checked
def sample_nuts(
    target: Target,
    start: Floats,
    *,
    warmup: Count = 500,
    draws: Count = 1000,
    chains: Count = 4,
    rng: Seed = 0,
) -> NutsDraws:
    """Sample a target by the no-U-turn sampler, in sequential chains that start near `start`, (n_params,).

    Raises
    ------
    SettingError
        Where numpyro is not installed, or the noise has no derivatives.
    """
    return nuts_of(target, start, warmup=warmup, draws=draws, chains=chains)(rng)


@on_processor()
def nuts_of(
    target: Target, start: Floats, *, warmup: Count, draws: Count, chains: Count
) -> Callable[[int], NutsDraws]:
    """The sampler of `sample_nuts` as a function of the seed, compiled on the first call."""
    try:
        numpyro: Any = import_module("numpyro.infer")
    except ModuleNotFoundError as error:
        raise SettingError("NUTS needs numpyro; install it with pip install 'mrwork[nuts]'") from error
    trajectories = Trajectories.of(target, start)
    kernel = numpyro.NUTS(potential_fn=trajectories.potential, dense_mass=True)
    run = numpyro.MCMC(
        kernel,
        num_warmup=warmup,
        num_samples=draws,
        num_chains=chains,
        chain_method="sequential",
        progress_bar=False,
    )
    mapped = jax.jit(jax.vmap(jax.vmap(trajectories.position)))

    @on_processor()
    def sample(rng: int) -> NutsDraws:
        points = np.random.default_rng(rng).standard_normal((chains, len(trajectories.origin)))
        first = jnp.asarray(points if chains > 1 else points[0])
        run.run(jax.random.PRNGKey(rng), init_params=first, extra_fields=("diverging", "num_steps"))
        extra = run.get_extra_fields()
        values, _ = trajectories.target.space.values(np.asarray(mapped(run.get_samples(group_by_chain=True))))
        return NutsDraws(
            values=np.asarray(values),
            diverged=int(np.sum(extra["diverging"])),
            evaluations=int(np.sum(extra["num_steps"])),
        )

    return sample
