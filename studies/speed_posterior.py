"""How many effective draws of a posterior come in a second, beside numpyro's NUTS?

The posterior of 9 dimensions of a measured test, the non-symmetric Bouc-Wen model with independent noise, its
likelihood tempered for both. NUTS runs on the compiled model and its exact derivatives, with the mass matrix of the
fit; it has a fifth of the effective draws per second of `mr.sample`, without the time to compile. The same move on
numba, and on the twin in jax, had less. Two minutes.
"""

import time

import jax
import jax.numpy as jnp
import numpy as np
import numpyro.infer

import mrwork as mr
from common import DATA, Script
from timing import processor

script = Script(
    __file__,
    __doc__,
    quick="a short synthetic record, 40 steps of 20 walkers, 10 draws of NUTS with what it takes to compile",
    seed=1,
    steps={"type": int, "default": 2000, "help": "most steps of the ensemble, default 2000"},
    walkers={"type": int, "default": 64, "help": "of the ensemble, default 64"},
    nuts_draws={"type": int, "default": 100, "help": "of NUTS, after as many of warm-up, default 100"},
)
threads = script.threads or 1
steps, walkers, nuts_draws = script.options.steps, script.options.walkers, script.options.nuts_draws
if script.quick:
    steps, walkers, nuts_draws = 40, 20, 10
MODEL = "non_symmetric_bouc_wen"
# The whole offset of the velocity in the dashpot, as in Kwok et al. (2007).
HELD = {"share": (1.0, 1.0), "w_s": (0.1, 0.1)}

# %% The record of speed_identify.py, and its fit in the box that is searched there.
path = DATA / "dampers" / "utfsm" / "10mm1Hz0x5A.csv"
if path.exists() and not script.quick:
    test = mr.records.cut(mr.read_damper_test(path, keep_velocity=True), start=0.5, every=4)
else:
    test = mr.records.cut(mr.synthetic_test("rd1005_1a"), every=2)
test = mr.records.cut(test, end=test.start_time + ((300 if script.quick else 2000) - 0.5) * test.dt)
box = mr.objective(MODEL, test, bounds=HELD, observe="none")
bounds = HELD | dict(zip(box.names, box.bounds, strict=True))
search = (
    mr.identification.Race(samples=2, starts=2, population=5, generations=2, most_rounds=1)
    if script.quick
    else None
)
fit = mr.identify(MODEL, test, bounds=bounds, observe="none", rng=script.seed, threads=threads, search=search)
script.say(f"fit {fit.fit_percent:.2f} %")

# %% Ours: an ensemble whose walkers move by differences of its past.
if not script.quick:
    mr.sample(fit, test, walkers=walkers, most_steps=20, threads=threads)  # loads what is loaded once
draws = mr.sample(fit, test, walkers=walkers, most_steps=steps, rng=script.seed, threads=threads)
script.say(f"{draws.n_steps} steps of {walkers} walkers, {draws.seconds:.1f} s")

# %% NUTS on the same density in latent coordinates: logits of the places between the bounds.
objective = mr.objective(MODEL, test, bounds=bounds, observe="none", coordinates="latent", threads=threads)
likelihood = mr.jax.log_likelihood(objective, noise="iid", coordinates="latent", threads=threads)
n_free, of_k = len(objective.names), objective.box.names.index("k")


def potential(point):
    """Negative log density; the prior is uniform between the bounds, in k and k x0 in place of k and x0."""
    places = jax.nn.log_sigmoid(point) + jax.nn.log_sigmoid(-point)
    stiffness = likelihood.parameters(point)[of_k]
    return -(draws.temper * likelihood(point) + jnp.sum(places) + jnp.log(jnp.abs(stiffness)))


# Start and mass matrix: the fit, and the Gauss-Newton precision there; of the noise that of its logarithm.
first = np.clip(likelihood.box.points_inside(np.append(fit.theta, fit.nrmse), "latent"), -6.0, 6.0)
J = objective.jacobian(first[:n_free]) / np.linalg.norm(objective.residuals(first[:n_free]))
precision = 0.3 * np.eye(n_free + 1)
precision[:n_free, :n_free] += draws.temper * len(J) * J.T @ J
place = 1.0 / (1.0 + np.exp(-first[-1]))
slope = np.log(likelihood.box.upper[-1] / likelihood.box.lower[-1]) * place * (1.0 - place)
precision[n_free, n_free] += 2.0 * draws.temper * len(J) * slope**2
kernel = numpyro.infer.NUTS(
    potential_fn=potential,
    dense_mass=True,
    inverse_mass_matrix=jnp.asarray(np.linalg.inv(precision)),
    max_tree_depth=3 if script.quick else 10,
)
run = numpyro.infer.MCMC(kernel, num_warmup=nuts_draws, num_samples=nuts_draws, progress_bar=False)


def nuts(seed):
    """Seconds of one run."""
    began = time.perf_counter()
    run.run(jax.random.PRNGKey(seed), init_params=jnp.asarray(first), extra_fields=("diverging", "num_steps"))
    jax.block_until_ready(run.get_samples())
    return time.perf_counter() - began


script.say("NUTS, and its compiling")
compiling, nuts_seconds = nuts(1), 0.0
if not script.quick:
    nuts_seconds = nuts(2)
    compiling -= nuts_seconds
points = np.asarray(run.get_samples())
extra = {name: int(np.sum(values)) for name, values in run.get_extra_fields().items()}
theta = objective.theta(points[:, :n_free])

# %% Least bulk effective size and largest R-hat of the parameters, and whether both found the same posterior.
chains = {
    "mrwork": np.stack([draws.chain(name) for name in objective.names], axis=-1),
    "numpyro NUTS": theta[None, :, objective.box.free],
}
judged = {
    sampler: [mr.uncertainty.convergence(np.ascontiguousarray(of[..., index])) for index in range(n_free)]
    for sampler, of in chains.items()
}
seconds = {"mrwork": draws.seconds, "numpyro NUTS": nuts_seconds or compiling}
settings = {
    "mrwork": f"{walkers} walkers, {draws.n_steps} steps; the whole call, differences of the past",
    "numpyro NUTS": f"{nuts_draws} + {nuts_draws} draws, dense mass, derivatives of our kernel; "
    f"{extra['diverging']} diverged; gradients of the draws alone are counted",
}
rows = {}
for sampler, verdicts in judged.items():
    ess = min(verdict.ess_bulk for verdict in verdicts)
    rows[sampler] = {
        **{"sampler": sampler, "threads": threads, "seconds": seconds[sampler]},
        **{"compile_seconds": compiling if sampler == "numpyro NUTS" else 0.0, "ess_min": ess},
        **{"ess_per_second": ess / seconds[sampler], "rhat": max(verdict.rhat for verdict in verdicts)},
        "evaluations": walkers * (draws.n_steps + 1) if sampler == "mrwork" else extra["num_steps"],
        **{"simulating_share": None, "settings": settings[sampler]},
    }
ours, theirs = (of.reshape(-1, n_free) for of in chains.values())
apart = np.abs(theirs.mean(axis=0) - ours.mean(axis=0)) / ours.std(axis=0)
agreement = {
    name: {
        "means apart, deviations": apart[index],
        "deviation over ours": theirs[:, index].std() / ours[:, index].std(),
    }
    for index, name in enumerate(objective.names)
}
title = f"{test.name}, {test.n_time} samples, fit {fit.fit_percent:.2f} %, log-likelihood times {draws.temper:.3f}"
shown = {
    sampler: {
        name: value for name, value in row.items() if name not in ("sampler", "simulating_share", "settings")
    }
    | {"over ours": row["ess_per_second"] / rows["mrwork"]["ess_per_second"]}
    for sampler, row in rows.items()
}
script.table("speed", shown, title=f"{title}; {processor()}", digits=3)
script.table("agreement", agreement, title="The posterior of NUTS beside ours", digits=2)
script.tables["rows"] = rows
script.check()
