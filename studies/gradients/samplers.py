"""Effective sample size per second of one posterior: NUTS of two libraries on `mr.jax`, on the twin, and the ensemble.

The posterior is that of a model and of the noise, on a synthetic test with white noise; the prior is flat in the box,
each parameter on its own scale, and the length of a spring is held. All begin at the fit. NUTS moves in logits that the
Fisher matrix there has scaled, also on the twin, where the package does it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

import mrwork as mr
from mrwork.identification import CandidateObjective, Fit, identifiable_form
from mrwork.records import DamperTest
from mrwork.report import Table
from mrwork.uncertainty import Iid, Target, convergence, nuts_of
from studies.former.arrays import Floats
from studies.former.compilation import timed_apart
from studies.former.table import Cell, table_of
from studies.gradients.posed import record

_LENGTH = "x0"
# jax leaves these unannotated.
_jax: Any = jax


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplerRow:
    """One sampler: `ess` is the least bulk one of all parameters, `seconds` have the warm-up, not `compile_seconds`.

    `warmup_share` is the share of steps that are not kept. `gradients` are those of the kept draws, 0 for an ensemble.
    `z` is the largest difference of a mean from that of the first sampler, in Monte-Carlo standard errors.
    """

    sampler: str
    ess: float
    rhat: float
    seconds: float
    compile_seconds: float
    warmup_share: float
    draws: int
    gradients: int
    diverged: int
    z: float

    @property
    def per_second(self) -> float:
        """Effective sample size per second."""
        return self.ess / self.seconds

    @property
    def per_second_with_compilation(self) -> float:
        """Likewise with the seconds of compilation."""
        return self.ess / (self.seconds + self.compile_seconds)


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """Draws of one sampler, values of all free parameters and the noise, (n_chains, n_draws, n_dim), and its counts."""

    values: Floats
    seconds: float
    compile_seconds: float
    warmup_share: float
    gradients: int = 0
    diverged: int = 0


@dataclass(frozen=True, kw_only=True)
class Posterior:
    """The test with its fit, and the box of the prior by name."""

    model: str
    test: DamperTest
    fit: Fit
    bounds: dict[str, tuple[float, float]]

    @classmethod
    def of(cls, model: str, n_time: int) -> Posterior:
        test = record(model, n_time)
        box = mr.objective(model, test).box
        bounds = dict(zip(box.names, zip(box.lower, box.upper, strict=True), strict=True))
        if _LENGTH in box.names:
            nominal = mr.damper(model).nominal[box.names.index(_LENGTH)]
            bounds[_LENGTH] = (nominal, nominal)
        fit = mr.identify(model, test, bounds=bounds, observe="none", rng=1)
        return cls(model=model, test=test, fit=fit, bounds=bounds)

    @cached_property
    def objective(self) -> CandidateObjective:
        """The objective of logits."""
        return mr.objective(
            self.model, self.test, bounds=self.bounds, observe="none", coordinates="latent", threads=1
        )

    @cached_property
    def likelihood(self) -> mr.jax.TracedFunction:
        """The log-likelihood of logits."""
        return mr.jax.log_likelihood(self.objective)

    @cached_property
    def frame(self) -> tuple[Floats, Floats]:
        """Logits of the fit with its noise, (n_dim,), and a root of their covariance by the Fisher matrix."""
        box, n_time = self.likelihood.box, self.test.n_time
        objective = self.objective
        misfit = 1.0 - self.fit.fit_percent / 100.0
        theta = np.asarray(box.inside(np.array([*self.fit.theta, misfit])))
        origin = np.asarray(box.latent_from_theta(theta))
        # The deviation of the noise has the Fisher information 2 n/sigma^2, and the residuals are NRMSE/sqrt(n).
        jacobian = objective.jacobian(origin[:-1]) / misfit
        fisher = np.zeros((len(origin), len(origin)))
        fisher[:-1, :-1] = n_time * jacobian.T @ jacobian
        fisher[-1, -1] = 2.0 * n_time * (box.slope_from(theta, "latent")[-1] / misfit) ** 2
        return origin, np.asarray(np.linalg.cholesky(np.linalg.inv(fisher)))

    def log_density(self, point: Array) -> Array:
        """Log posterior of a point, in logits that the Fisher matrix has scaled, (n_dim,)."""
        latent = self.latent(point)
        volume = jax.nn.log_sigmoid(latent) + jax.nn.log_sigmoid(-latent)
        return self.likelihood(latent) + jnp.sum(volume)

    def latent(self, point: Array) -> Array:
        """Logits of a point."""
        origin, root = self.frame
        return jnp.asarray(origin + root @ point)

    def values(self, points: Array) -> Floats:
        """Free parameters and noise of points (..., n_dim)."""
        box = self.likelihood.box
        theta = np.asarray(
            box.theta_from_latent(np.asarray(jnp.vectorize(self.latent, signature="(d)->(d)")(points)))
        )
        return theta[..., np.array(box.free)]

    def starts(self, chains: int, rng: int) -> Array:
        """Points from which chains begin, (chains, n_dim)."""
        return jnp.asarray(np.random.default_rng(rng).standard_normal((chains, len(self.frame[0]))))


def measure(
    *,
    threads: int,
    model: str,
    n_time: int,
    libraries: Sequence[str],
    in_lanes: bool,
    steps: int,
    chains: int,
    twin_steps: int,
    walker_steps: int,
) -> Iterator[SamplerRow | str]:
    """Rows of the samplers of those libraries that are installed, and of the ensemble.

    `steps` are those of the warm-up, and again of the draws, for each of the chains, which run one after another, and
    then perhaps all at once in lanes. The twin has `twin_steps`, or takes no part.
    """
    yield "fitting"
    posterior = Posterior.of(model, n_time)
    samplers: dict[str, Callable[[], Found]] = {}
    for library, sampler in (("numpyro", _numpyro), ("blackjax", _blackjax)):
        if library in libraries and find_spec(library):
            name = f"{library} NUTS on mr.jax"
            samplers[name] = partial(sampler, posterior, steps, chains, False)
            if in_lanes:
                samplers[f"{name}, chains in lanes"] = partial(sampler, posterior, steps, chains, True)
    if twin_steps and find_spec("numpyro"):
        samplers["numpyro NUTS on the twin"] = partial(_on_twin, posterior, twin_steps)
    samplers["ensemble, mr.sample"] = partial(_ensemble, posterior, walker_steps, threads)
    first: Found | None = None
    for name, sample in samplers.items():
        yield name
        found = sample()
        first = first or found
        yield _row(name, found, first)


def _row(name: str, found: Found, first: Found) -> SamplerRow:
    own, others = _judged(found), _judged(first)
    errors = np.hypot([each.mcse for each in own], [each.mcse for each in others])
    difference = np.abs(np.mean(found.values, axis=(0, 1)) - np.mean(first.values, axis=(0, 1)))
    return SamplerRow(
        sampler=name,
        ess=min(each.ess_bulk for each in own),
        rhat=max(each.rhat for each in own),
        seconds=found.seconds,
        compile_seconds=found.compile_seconds,
        warmup_share=found.warmup_share,
        draws=found.values.shape[0] * found.values.shape[1],
        gradients=found.gradients,
        diverged=found.diverged,
        z=float(np.max(difference / errors)),
    )


def _judged(found: Found) -> list[Any]:
    return [convergence(np.ascontiguousarray(each)) for each in np.moveaxis(found.values, -1, 0)]


def _numpyro(posterior: Posterior, steps: int, chains: int, in_lanes: bool) -> Found:
    numpyro: Any = import_module("numpyro.infer")
    run = numpyro.MCMC(
        numpyro.NUTS(potential_fn=lambda point: -posterior.log_density(point), dense_mass=True),
        num_warmup=steps,
        num_samples=steps,
        num_chains=chains,
        chain_method="vectorized" if in_lanes else "sequential",
        progress_bar=False,
    )
    starts, key, fields = posterior.starts(chains, 1), jax.random.PRNGKey(1), ("diverging", "num_steps")

    def sample() -> None:
        run.run(key, init_params=starts, extra_fields=fields)
        _jax.block_until_ready(run.get_samples())

    _, seconds, compiling = timed_apart(sample)
    extra = run.get_extra_fields()
    return Found(
        values=posterior.values(run.get_samples(group_by_chain=True)),
        seconds=seconds,
        compile_seconds=compiling,
        warmup_share=0.5,
        gradients=int(np.sum(extra["num_steps"])),
        diverged=int(np.sum(extra["diverging"])),
    )


def _blackjax(posterior: Posterior, steps: int, chains: int, in_lanes: bool) -> Found:
    blackjax: Any = import_module("blackjax")
    adaptation = blackjax.window_adaptation(
        blackjax.nuts, posterior.log_density, is_mass_matrix_diagonal=False
    )

    def chain(key: Array, start: Array) -> Any:
        of_warmup, of_draws = jax.random.split(key)
        (state, tuned), _ = adaptation.run(of_warmup, start, num_steps=steps)
        kernel = blackjax.nuts(posterior.log_density, **tuned)

        def step(state: Any, key: Array) -> Any:
            state, told = kernel.step(key, state)
            return state, (state.position, told.num_integration_steps, told.is_divergent)

        return jax.lax.scan(step, state, jax.random.split(of_draws, steps))[1]

    keys, starts = jax.random.split(jax.random.PRNGKey(1), chains), posterior.starts(chains, 1)
    # One program for all chains, or for each of them in turn.
    many = jax.jit(
        jax.vmap(chain) if in_lanes else lambda *chains: jax.lax.map(lambda one: chain(*one), chains)
    )
    told, seconds, compiling = timed_apart(lambda: _jax.block_until_ready(many(keys, starts)))
    points, gradients, diverged = told
    return Found(
        values=posterior.values(points),
        seconds=seconds,
        compile_seconds=compiling,
        warmup_share=0.5,
        gradients=int(np.sum(gradients)),
        diverged=int(np.sum(diverged)),
    )


def _on_twin(posterior: Posterior, steps: int) -> Found:
    form = identifiable_form(mr.damper(posterior.model), posterior.bounds)
    start = np.asarray(form.box.inside(np.array(posterior.fit.theta)))
    target = Target.of(form, posterior.objective.objective, Iid(), start=start, priors={}, tempering=1.0)
    sample = nuts_of(target, start, warmup=steps, draws=steps, chains=2)
    result, seconds, compiling = timed_apart(lambda: sample(1))
    return Found(
        values=result.values[..., np.array(target.space.box.free)],
        seconds=seconds,
        compile_seconds=compiling,
        warmup_share=0.5,
        gradients=result.evaluations,
        diverged=result.diverged,
    )


def _ensemble(posterior: Posterior, most_steps: int, threads: int) -> Found:
    draws, seconds, compiling = timed_apart(
        lambda: mr.sample(
            posterior.fit, posterior.test, tempering=1.0, most_steps=most_steps, threads=threads
        )
    )
    free = np.array([draws.names.index(each.name) for each in draws.varied if each.name in draws.names])
    return Found(
        values=np.concatenate([draws.chains[..., free], draws.noise_chains], axis=-1),
        seconds=seconds,
        compile_seconds=compiling,
        warmup_share=0.25,
    )


def tables(rows: Sequence[SamplerRow]) -> Iterator[Table]:
    """One table; rates are over that of the first row."""
    if not rows:
        return
    first = rows[0].per_second
    columns: dict[str, Cell] = {
        "ESS/s, ratio": lambda row: f"{row.per_second / first:.3g}",
        "ESS/s": lambda row: f"{row.per_second:.3g}",
        "with compilation": lambda row: f"{row.per_second_with_compilation:.3g}",
        "seconds": lambda row: f"{row.seconds:.2f}",
        "compile s": lambda row: f"{row.compile_seconds:.1f}",
        "warm-up": lambda row: f"{row.warmup_share:.0%}",
        "ESS": lambda row: f"{row.ess:.0f}",
        "draws": lambda row: str(row.draws),
        "gradients": lambda row: str(row.gradients or "-"),
        "diverged": lambda row: str(row.diverged),
        "R-hat": lambda row: f"{row.rhat:.3f}",
        "means apart": lambda row: f"{row.z:.1f}",
    }
    yield table_of("Samplers of one posterior", "sampler", ((row.sampler, row) for row in rows), columns)
