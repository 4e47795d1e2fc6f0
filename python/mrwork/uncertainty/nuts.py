"""A second opinion: the no-U-turn sampler of numpyro on the twin, for the same target."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError
from mrwork.uncertainty.target import Target
from mrwork.uncertainty.twin_target import LogDensity, substeps_at, twin_log_posterior
from mrwork.uncertainty.walkers import ellipsoid

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

    Logits of the position, which know no faces, then centred and scaled by the Fisher ellipsoid.
    """

    origin: Array
    root: Array
    product: int | None
    log_density: LogDensity

    @classmethod
    def of(cls, target: Target, start: Array) -> Trajectories:
        """The coordinates about `start`, (n_params,)."""
        pair = target.space.pair
        product = None if pair is None else pair[1]
        origin, root = ellipsoid(target, start)
        # A fit on a face of the box is an infinite logit: one deviation inside is where the draws will be.
        deviation = np.minimum(np.sqrt(np.sum(root**2, axis=1)), 0.25)
        inside = np.clip(origin, deviation, 1.0 - deviation)
        slope = 1.0 / (inside * (1.0 - inside))
        latent = np.log(inside) - np.log1p(-inside)
        if product is not None:
            # A product k x0 has no faces of its own.
            slope[product], latent[product] = 1.0, origin[product]
        theta = target.form.box.inside(start)
        return cls(
            origin=latent,
            root=slope[:, None] * root,
            product=product,
            log_density=twin_log_posterior(target, substeps_at(target, theta)),
        )

    def position(self, place: jax.Array) -> jax.Array:
        """Position of the target, (n_dim,), from that of a trajectory."""
        latent = self.origin + self.root @ place
        position = jax.nn.sigmoid(latent)
        return position if self.product is None else position.at[self.product].set(latent[self.product])

    def potential(self, place: jax.Array) -> jax.Array:
        """Minus the log density of a place."""
        latent = self.origin + self.root @ place
        volumes = jax.nn.log_sigmoid(latent) + jax.nn.log_sigmoid(-latent)
        if self.product is not None:
            volumes = volumes.at[self.product].set(0.0)
        return -(self.log_density(self.position(place)) + jnp.sum(volumes))


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
    key, places = (
        jax.random.PRNGKey(rng),
        np.random.default_rng(rng).standard_normal((chains, len(trajectories.origin))),
    )
    first = jnp.asarray(places if chains > 1 else places[0])
    run.run(key, init_params=first, extra_fields=("diverging", "num_steps"))
    found = run.get_samples(group_by_chain=True)
    positions = jax.vmap(jax.vmap(trajectories.position))(found)
    extra = run.get_extra_fields()
    values, _ = target.space.values(np.asarray(positions))
    return NutsDraws(
        values=np.asarray(values),
        diverged=int(np.sum(extra["diverging"])),
        evaluations=int(np.sum(extra["num_steps"])),
    )
