"""A second opinion: the no-U-turn sampler of numpyro on the twin, for the same target."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError
from mrwork.uncertainty.posterior.target import Target
from mrwork.uncertainty.posterior.twin_target import LogDensity, substeps_at, twin_log_posterior
from mrwork.uncertainty.posterior.walkers import ellipsoid

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NutsDraws:
    """Parameters and noise, shape (n_chains, n_draws, n_params + n_noise), and how many trajectories diverged."""

    values: Array
    diverged: int
    evaluations: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trajectories:
    """What trajectories run in: coordinates in which the target is about a standard normal.

    Logits of the unit coordinates, which know no faces, then centred and scaled by the Fisher ellipsoid. Of a pair k
    and k x0 the second would have a face that moves with the first; so x0 itself stands for it, with the volume |k|.
    """

    target: Target
    origin: Array
    root: Array
    stiffness: int | None
    log_density: LogDensity

    @classmethod
    def of(cls, target: Target, start: Array) -> Trajectories:
        """The coordinates about `start`, (n_params,)."""
        pair = target.space.pair
        even_in_product = pair is not None and target.space.priors[pair[1]] is None
        plain = replace(target, space=replace(target.space, pair=None))
        origin, root = ellipsoid(plain, start)
        # A fit on a face of the box is an infinite logit: one deviation inside is where the draws will be.
        deviation = np.minimum(np.sqrt(np.sum(root**2, axis=1)), 0.25)
        inside = np.clip(origin, deviation, 1.0 - deviation)
        slope = 1.0 / (inside * (1.0 - inside))
        return cls(
            target=plain,
            origin=np.log(inside) - np.log1p(-inside),
            root=slope[:, None] * root,
            stiffness=plain.space.box.free[pair[0]] if pair is not None and even_in_product else None,
            log_density=twin_log_posterior(plain, substeps_at(plain, target.form.box.inside(start))),
        )

    def position(self, place: jax.Array) -> jax.Array:
        """Unit coordinates, (n_dim,), from a place on a trajectory."""
        return jax.nn.sigmoid(self.origin + self.root @ place)

    def potential(self, place: jax.Array) -> jax.Array:
        """Minus the log density of a place."""
        latent = self.origin + self.root @ place
        position = jax.nn.sigmoid(latent)
        density = self.log_density(position)
        density = density + jnp.sum(jax.nn.log_sigmoid(latent) + jax.nn.log_sigmoid(-latent))
        if self.stiffness is not None:
            density = density + jnp.log(jnp.abs(self.target.space.values(position)[0][self.stiffness]))
        return -density


def sample_nuts(
    target: Target,
    start: Array,
    *,
    warmup: int = 500,
    draws: int = 1000,
    chains: int = 4,
    rng: int = 0,
) -> NutsDraws:
    """Sample a target by the no-U-turn sampler, chains one after another from about `start`, (n_params,).

    Derivatives are taken forwards: through a long scan they cost less than backwards. Sub-steps are those of the start
    for every draw.

    Raises
    ------
    SettingError
        Where numpyro is not installed, or the twin has no such target.
    """
    return nuts_of(target, start, warmup=warmup, draws=draws, chains=chains)(rng)


def nuts_of(
    target: Target, start: Array, *, warmup: int, draws: int, chains: int
) -> Callable[[int], NutsDraws]:
    """What `sample_nuts` runs, by seed; compiled on the first call.

    Raises
    ------
    SettingError
        As `sample_nuts`.
    """
    try:
        numpyro: Any = import_module("numpyro.infer")
    except ModuleNotFoundError as error:
        raise SettingError("NUTS needs numpyro; install it with pip install 'mrwork[nuts]'") from error
    trajectories = Trajectories.of(target, start)
    kernel = numpyro.NUTS(
        potential_fn=trajectories.potential, dense_mass=True, forward_mode_differentiation=True
    )
    run = numpyro.MCMC(
        kernel,
        num_warmup=warmup,
        num_samples=draws,
        num_chains=chains,
        chain_method="sequential",
        progress_bar=False,
    )
    mapped = jax.jit(jax.vmap(jax.vmap(trajectories.position)))

    def sample(rng: int) -> NutsDraws:
        places = np.random.default_rng(rng).standard_normal((chains, len(trajectories.origin)))
        first = jnp.asarray(places if chains > 1 else places[0])
        run.run(jax.random.PRNGKey(rng), init_params=first, extra_fields=("diverging", "num_steps"))
        extra = run.get_extra_fields()
        values, _ = trajectories.target.space.values(np.asarray(mapped(run.get_samples(group_by_chain=True))))
        return NutsDraws(
            values=np.asarray(values),
            diverged=int(np.sum(extra["diverging"])),
            evaluations=int(np.sum(extra["num_steps"])),
        )

    return sample
