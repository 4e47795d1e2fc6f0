"""What do samplers and optimisers of JAX make of the exact gradients of `mr.jax`?

For a model with states a call takes the time of `mr.objective`; gradients and batches take a fifth to a fourteenth of
the time of the twin in `jax.numpy`. NUTS on it has 3 to 20 times the rate of effective samples of NUTS on the twin, by
processor, 10 to 60 times with its chains in lanes; the ensemble of `mr.sample` has still twice as many. For a fit alone
SciPy on `mr.objective` is fastest, and optimistix takes 1.7 times as long. Ten minutes of one core, the quick form half
a minute. Peers of the extra `bench` that are absent are left out.
"""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from itertools import product
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import least_squares

import mrwork as mr
from common import Script

script = Script(__file__, __doc__, quick="short records, few steps and starts; its times mean nothing")
os.environ["MRWORK_COMPILATION_CACHE"] = "off"  # programs that earlier runs have left would not be compiled
MODEL, HELD = "normalised_bouc_wen", "x0"


# %% Records: a simulated damper under a motion that swells and ebbs, sampled every millisecond, with white noise.
def record(model: str, n_time: int) -> mr.DamperTest:
    """A test of the nominal damper, with noise of 8 N."""
    spec, time = mr.damper(model), 1e-3 * np.arange(n_time)
    omega, slow = 2.0 * np.pi * np.array([2.5, 0.3])
    swell, swelling = 0.6 + 0.4 * np.sin(slow * time), 0.4 * slow * np.cos(slow * time)
    displacement = 0.015 * swell * np.sin(omega * time)
    velocity = 0.015 * (swelling * np.sin(omega * time) + omega * swell * np.cos(omega * time))
    motion = mr.Loading(dt=1e-3, displacement=displacement, velocity=velocity)
    noise = 8.0 * np.random.default_rng(0).standard_normal(n_time)
    test = mr.test_from_arrays(
        name=f"{model}, {n_time} samples",
        time=time,
        displacement=displacement,
        velocity=velocity,
        force=mr.simulate(spec, spec.nominal, motion) + noise,
        synthetic=True,
    )
    return replace(test, n_settle=0)  # it begins at rest, so its first samples are as good as others


# %% Seconds of compilation are told apart: JAX reports its tracings and compilations, which lie within each other.
spans: list[tuple[float, float]] = []


def note(event: str, duration_secs: float, **_: Any) -> None:
    """Keep when a compilation began and ended."""
    if event.startswith("/jax/core/compile/"):
        spans.append((time.perf_counter() - duration_secs, time.perf_counter()))


jax.monitoring.register_event_duration_secs_listener(note)


@contextmanager
def timed(row: dict[str, Any]) -> Iterator[None]:
    """Write the seconds of a block and those of compilation in it to a row of a table."""
    reached = began = time.perf_counter()
    spans.clear()
    yield
    seconds, compiling = time.perf_counter() - began, 0.0
    for begin, end in sorted(spans):
        compiling += max(end - max(begin, reached), 0.0)
        reached = max(reached, end)
    row |= {"seconds": seconds - compiling, "compiling": compiling}


# %% A call: misfits and their gradients, of one point and of batches by `vmap`, medians of turns.
def by_callback(objective: Any) -> Callable[..., Any]:
    """`mr.objective` for JAX as one would write it without `mr.jax`."""

    @jax.custom_vjp
    def misfit(point: Any) -> Any:
        return jax.pure_callback(objective, jnp.zeros(()), point, vmap_method="expand_dims")

    def forward(point: Any) -> Any:
        both = lambda point: (objective(np.asarray(point)), objective.gradient(np.asarray(point)))  # noqa: E731
        return jax.pure_callback(both, (jnp.zeros(()), point), point, vmap_method="expand_dims")

    misfit.defvjp(forward, lambda slope, along: (along * slope,))
    return misfit


def on_twin(model: str, test: mr.DamperTest) -> Callable[..., Any]:
    """Forces of parameters by the twin, with the sub-steps of the core."""
    twin = mr.jax.twin(model)
    motion, substeps = twin.record(test), twin.substeps(twin.spec.nominal, test)
    return lambda theta: twin.simulate(theta, motion, substeps)


rows: dict[str, dict[str, Any]] = {}
functions: dict[str, Callable[..., Any]]
models, n_time, batches, rounds = ["bingham", MODEL], 2000, [1, 8, 256], 9
if script.quick:
    models, n_time, batches, rounds = models[:1], 100, [1, 2], 1
for model, batch in product(models, batches):
    test, nominal = record(model, n_time), np.array(mr.damper(model).nominal)
    factors = np.random.default_rng(1).uniform(0.98, 1.0, (batch, len(nominal)))
    points = nominal * (factors if batch > 1 else factors[0])
    objective = mr.objective(model, test, threads=1)
    force = on_twin(model, test)

    def twin_misfit(theta: Any, force: Any = force, test: mr.DamperTest = test) -> Any:
        return jnp.sqrt(jnp.mean((force(theta) - test.force) ** 2)) / np.std(test.force)

    functions = {
        "mr.jax": mr.jax.misfit(objective, threads=1),
        "callback": by_callback(objective),
        "twin": twin_misfit,
    }
    for what in ("value", "gradient"):
        name = f"{model}, {what}, {n_time} x {batch}"
        script.say(name)
        if what == "gradient":  # of a long scan with few parameters forward
            functions = {
                each: (jax.jacfwd if each == "twin" else jax.grad)(f) for each, f in functions.items()
            }
        given = jnp.asarray(points)
        calls: dict[str, Callable[..., Any]] = {}
        for each, function in functions.items():
            compiled = jax.jit(jax.vmap(function) if batch > 1 else function)
            calls[each] = lambda compiled=compiled, given=given: np.asarray(compiled(given))
        direct = objective if what == "value" else objective.gradient
        calls["mr.objective"] = lambda direct=direct, points=points: direct(points)
        found = {each: np.asarray(call()) for each, call in calls.items()}
        apart = max(np.abs(each - found["mr.objective"]).max() for each in found.values())
        turns: dict[str, list[float]] = {each: [] for each in calls}
        for _ in range(rounds):
            for each, call in calls.items():
                began, count = time.process_time(), 0
                while count == 0 or time.process_time() - began < 0.08:
                    call()
                    count += 1
                turns[each].append(1e6 * (time.process_time() - began) / count)
        medians = {each: float(np.median(taken)) for each, taken in turns.items()}
        rows[name] = {"us": medians["mr.jax"]} | {
            f"{each}/mr.jax": medians[each] / medians["mr.jax"]
            for each in ("mr.objective", "callback", "twin")
        }
        rows[name]["apart"] = float(apart / np.abs(found["mr.objective"]).max())
script.table("calls", rows, title="Processor microseconds of a call, and of others over it", digits=3)


# %% A posterior of six parameters and the noise: logits, scaled by the Fisher matrix at the fit.
test = record(MODEL, 200 if script.quick else 500)
x0 = float(mr.damper(MODEL).nominal[mr.damper(MODEL).names.index(HELD)])
box = mr.objective(MODEL, test).box
bounds = dict(zip(box.names, zip(box.lower, box.upper, strict=True), strict=True)) | {HELD: (x0, x0)}
fit = mr.identify(MODEL, test, bounds=bounds, observe="none", rng=1, threads=1)
objective = mr.objective(MODEL, test, bounds=bounds, observe="none", coordinates="latent", threads=1)
likelihood = mr.jax.log_likelihood(objective)
box = likelihood.box  # of the parameters and the noise, a share of the deviation of the force
free, noise = np.array(box.free), 1.0 - fit.fit_percent / 100.0
theta = np.asarray(box.inside(np.array([*fit.theta, noise])))
origin = np.asarray(box.latent_from_theta(theta))
jacobian = objective.jacobian(origin[:-1]) / noise
fisher = np.zeros((len(origin), len(origin)))
fisher[:-1, :-1] = test.n_time * jacobian.T @ jacobian
fisher[-1, -1] = 2.0 * test.n_time * (box.slope_from(theta, "latent")[-1] / noise) ** 2
root = np.linalg.cholesky(np.linalg.inv(fisher))
force = on_twin(MODEL, test)


def twin_likelihood(latent: Any) -> Any:
    """The same likelihood on the twin."""
    *theta, noise = box.theta_from_latent(latent)
    residuals = (force(jnp.stack(theta)) - test.force) / (noise * np.std(test.force))
    return -test.n_time * jnp.log(noise) - 0.5 * jnp.sum(residuals**2)


def by_numpyro(likelihood: Callable[..., Any], method: str, chains: int, steps: int) -> Any:
    """Points, gradients and divergences of as many steps as those of the warm-up."""
    from numpyro.infer import MCMC, NUTS

    def potential(point: Any) -> Any:  # flat in the box, on the scale of each parameter
        latent = origin + root @ point
        return -likelihood(latent) - jnp.sum(jax.nn.log_sigmoid(latent) + jax.nn.log_sigmoid(-latent))

    run = MCMC(
        NUTS(potential_fn=potential, dense_mass=True),
        num_warmup=steps,
        num_samples=steps,
        num_chains=chains,
        chain_method=method,
        progress_bar=False,
    )
    starts = jnp.asarray(np.random.default_rng(1).standard_normal((chains, len(origin))))
    run.run(jax.random.PRNGKey(1), init_params=starts, extra_fields=("diverging", "num_steps"))
    extra = run.get_extra_fields()
    return run.get_samples(group_by_chain=True), extra["num_steps"], extra["diverging"]


samplers: dict[str, Callable[[], Any]] = {}
chains, steps, walker_steps = (2, 100, 1000) if script.quick else (4, 300, 20_000)
if find_spec("numpyro"):
    samplers["numpyro NUTS, chains in lanes"] = lambda: by_numpyro(likelihood, "vectorized", chains, steps)
    if not script.quick:
        samplers["numpyro NUTS, chain after chain"] = lambda: by_numpyro(likelihood, "sequential", 4, 300)
        samplers["numpyro NUTS on the twin"] = lambda: by_numpyro(twin_likelihood, "sequential", 2, 200)

rows, first = {}, None
for name in ("ensemble of mr.sample", *samplers):
    script.say(name)
    row: dict[str, Any] = {}
    with timed(row):
        if name in samplers:
            points, gradients, diverged = samplers[name]()
            latent = origin + np.asarray(points) @ root.T
            values = np.asarray(box.theta_from_latent(latent))[..., free]
            row |= {"gradients": int(np.sum(gradients)), "diverged": int(np.sum(diverged))}
        else:
            draws = mr.sample(fit, test, tempering=1.0, threads=1, most_steps=walker_steps)
            of_fit = [draws.names.index(each) for each in np.array(box.names)[free[:-1]]]
            values = np.concatenate([draws.chains[..., of_fit], draws.noise_chains], axis=-1)
    told = [mr.uncertainty.convergence(each.copy()) for each in np.moveaxis(values, -1, 0)]
    means, errors = values.mean(axis=(0, 1)), np.array([each.mcse for each in told])
    first = first or (means, errors)
    row["ESS"] = min(each.ess_bulk for each in told)
    row["ESS a second"] = row["ESS"] / row["seconds"]
    rows[name] = row
    row["rate over ensemble"] = row["ESS a second"] / rows["ensemble of mr.sample"]["ESS a second"]
    row["R-hat"] = max(each.rhat for each in told)
    # Means beside those of the ensemble, in Monte-Carlo standard errors.
    row["means apart"] = float(np.max(np.abs(means - first[0]) / np.hypot(errors, first[1])))
script.table("samplers", rows, title="Samplers of one posterior")

# %% A fit from starts half a unit of logits from the truth in every parameter.
test = record(MODEL, 200 if script.quick else 1000)
objective = mr.objective(
    MODEL, test, bounds={HELD: (x0, x0)}, observe="none", coordinates="latent", threads=1
)
box, scale = objective.box, float(np.std(test.force) * np.sqrt(test.n_time))
true = np.asarray(box.latent_from_theta(box.inside(np.array(mr.damper(MODEL).nominal))))
starts = true + 0.5 * np.random.default_rng(2).choice([-1.0, 1.0], (3 if script.quick else 7, len(true)))
residuals, misfit = mr.jax.residuals(objective), mr.jax.misfit(objective)
force, tolerance, most = on_twin(MODEL, test), 1e-7, 200


def by_optimistix(residuals: Callable[..., Any]) -> Callable[..., Any]:
    """Levenberg-Marquardt: where it ends, and how many Jacobians it took."""
    optimistix: Any = import_module("optimistix")

    solver = optimistix.LevenbergMarquardt(rtol=tolerance, atol=tolerance)

    def solve(start: Any) -> Any:
        found = optimistix.least_squares(
            *(lambda point, _: residuals(point), solver, start),
            options={"jac": "fwd"},
            max_steps=most,
            throw=False,
        )
        return found.value, found.stats["num_steps"]

    return jax.jit(solve)


def by_scipy(start: Any) -> Any:
    """Least squares of the objective with its Jacobian."""
    found = least_squares(
        *(objective.residuals, np.asarray(start), objective.jacobian),
        ftol=tolerance,
        xtol=tolerance,
        max_nfev=most,
    )
    return found.x, found.nfev


def residuals_of(force: Callable[..., Any]) -> Callable[..., Any]:
    """Residuals of another simulation, as those of `mr.objective`."""
    return lambda latent: (force(jnp.asarray(box.theta_from_latent(latent))) - test.force) / scale


engines: dict[str, Callable[..., Any]] = {"SciPy on mr.objective": by_scipy}
if find_spec("optimistix"):
    engines["optimistix LM on mr.jax"] = by_optimistix(residuals)
    if not script.quick:
        engines["optimistix LM on the twin"] = by_optimistix(residuals_of(force))

ends: dict[str, list[dict[str, Any]]] = {name: [] for name in engines}
for number, (start, name) in enumerate(product(starts, engines)):
    script.say(f"fit {number + 1} of {len(starts) * len(engines)}: {name}")
    row = {}
    with timed(row):
        point, evaluations = map(np.asarray, engines[name](jnp.asarray(start)))
    row |= {"misfit": float(objective(point)), "evaluations": int(evaluations)}
    ends[name].append(row)
least = min(row["misfit"] for each in ends.values() for row in each)
rows = {
    name: {
        column: float(np.median([row[column] for row in each]))
        for column in ("misfit", "evaluations", "seconds")
    }
    | {"compiling": max(row["compiling"] for row in each)}
    | {"arrive": 100.0 * float(np.mean([row["misfit"] <= 1.001 * least for row in each]))}
    for name, each in ends.items()
}
script.table(
    "fits", rows, title="One fit, medians over starts; per cent that arrive within 0.1 % of the least misfit"
)

# %% Draws of two parameters by the last sampler.
figure = Figure(figsize=(4.5, 4.0), layout="constrained")
axes = figure.subplots()
axes.plot(values[..., 0].ravel(), values[..., 1].ravel(), ".", markersize=2)
axes.set(xlabel=likelihood.box.free_names[0], ylabel=likelihood.box.free_names[1])
script.figure(figure, "draws")
script.check()
