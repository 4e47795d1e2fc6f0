"""How many Runge-Kutta steps of each damper model are done in a second, beside the same equations in jax?

Misfits of 1024 candidates on one record of 2000 samples, beside the model's twin in two forms: `jax` is `vmap` of its
simulation as users run it, which keeps every force, and `jax_scan` takes its equations alone, in one scan that keeps
nothing but the misfit, as ours does. Models without a state have no step to take, only a force to evaluate: XLA makes
one loop of that, which runs in vectors as ours does. Three minutes.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from scipy.interpolate import CubicSpline

import mrwork as mr
from common import Script
from timing import median_seconds, processor

script = Script(
    __file__,
    __doc__,
    quick="two models, batches of 16, 100 samples, once",
    seed=2007,
    model={"action": "append", "metavar": "NAME", "help": "this one only; may be repeated"},
    batch={"type": int, "default": 1024, "help": "candidates side by side, default 1024"},
)
threads = script.threads or 1
jax.config.update("jax_enable_x64", True)
names = script.options.model or [spec.name for spec in mr.damper_models()]
n_time, batch, rounds = 2000, script.options.batch, 7
if script.quick:
    names, n_time, batch, rounds = script.options.model or ["bingham", "normalised_bouc_wen"], 100, 16, 1
# What was fastest in `speed_kernels.py`, whose scan is that of one of these models.
UNROLL, OPTIONS = 1, {"xla_cpu_prefer_vector_width": "512"}


# %% A record that one step per sample resolves, with candidates around the nominal values.
def workload(spec):
    """Parameters, the objective, stages of every step and the test; what is nominally zero stays zero."""
    ends = np.stack([0.9 * np.array(spec.nominal), 1.1 * np.array(spec.nominal)])
    lower = np.maximum(ends.min(axis=0), [parameter.lower for parameter in spec.parameters])
    upper = np.minimum(ends.max(axis=0), [parameter.upper for parameter in spec.parameters])
    theta = np.random.default_rng(script.seed).uniform(lower, upper, (batch, len(lower)))
    for dt in 1e-3 * 0.5 ** np.arange(20):
        time = dt * np.arange(n_time)
        sweep = np.sin(2.0 * np.pi * (1.0 + 1.75 * time) * time)
        displacement = 0.010 * np.sin(2.0 * np.pi * time) + 0.001 * sweep
        velocity = np.gradient(displacement, dt)
        measured = 600.0 * np.tanh(velocity / 0.02) + 1500.0 * velocity
        test = mr.test_from_arrays(time, displacement, measured, velocity=velocity, synthetic=True)
        test = replace(test, n_settle=0)
        posed = mr.objective(spec, test, observe="none", threads=threads)
        objective = posed.objective
        found = objective.misfits(theta)[0]
        if found.substeps.max() == 1 and not found.outcome.any():
            break
    else:
        raise SystemExit(f"{spec.name} asks for more than one step a sample even at {dt:g} s")
    instants = test.time[:-1, None] + test.dt * np.array([0.0, 0.5, 1.0])
    splines = [CubicSpline(test.time, signal)(instants) for signal in (test.displacement, test.velocity)]
    return theta, objective, np.stack(splines, axis=-1), test


# %% The twin's equations, for one candidate; `vmap` makes a batch of them, split over one device per core.
def by_simulation(spec):
    def misfit(theta, record, measured):
        return jnp.sum(jnp.square(mr.twins.simulate(spec, theta, record, 1) - measured))

    return misfit


def by_scan(spec, dt):
    twin = mr.jax.twin(spec)

    def misfit(theta, stages, measured):
        def squared(state, motion, measured):
            return jnp.square(twin.force(theta, state, motion[0], motion[1]) - measured)

        def step(carry, inputs):
            state, total = carry
            ((x0, v0), (x1, v1), (x2, v2)), measured = inputs
            if spec.n_states:
                k1 = twin.rate(theta, state, x0, v0)
                k2 = twin.rate(theta, state + 0.5 * dt * k1, x1, v1)
                k3 = twin.rate(theta, state + 0.5 * dt * k2, x1, v1)
                k4 = twin.rate(theta, state + dt * k3, x2, v2)
                state = state + dt / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
            return (state, total + squared(state, (x2, v2), measured)), None

        rest = jnp.zeros(spec.n_states)
        begin = rest, squared(rest, stages[0, 0], measured[0])
        (_, total), _ = lax.scan(step, begin, (stages, measured[1:]), unroll=UNROLL)
        return total

    return misfit


def compiled(misfit, theta, *shared):
    """The call that is timed: sums of squared residuals, shape (n_batch,)."""
    devices = np.array(jax.devices()[: threads if batch % threads == 0 else 1])
    mesh = jax.sharding.Mesh(devices, ("candidates",))
    split, whole = (
        jax.sharding.NamedSharding(mesh, jax.sharding.PartitionSpec(*axes)) for axes in (("candidates",), ())
    )
    run = jax.jit(jax.vmap(misfit, in_axes=(0, *[None] * len(shared))), compiler_options=OPTIONS)
    placed = jax.device_put(theta, split), *(jax.device_put(array, whole) for array in shared)
    return lambda: run(*placed).block_until_ready()


# %% Ours and both forms in turns.
rows, agreement = {}, {}
for name in names:
    script.say(name)
    spec = mr.damper(name)
    theta, objective, stages, test = workload(spec)
    expected = objective.misfits(theta)[0].squared_error
    runs = {"ours": lambda theta=theta, objective=objective: objective.misfits(theta)}
    simulated = by_simulation(spec), mr.jax.twin(spec).record(test)
    for peer, (form, motion) in {"jax": simulated, "jax_scan": (by_scan(spec, test.dt), stages)}.items():
        runs[peer] = compiled(form, theta, motion, test.force)
        difference = float(np.max(np.abs(np.asarray(runs[peer]()) / expected - 1.0)))
        agreement.setdefault(name, {})[peer] = difference
    if max(agreement[name].values()) > 1e-9:
        continue  # nothing is timed that does not agree; the check tells it
    seconds = median_seconds(runs, rounds, 0.0 if script.quick else 0.08)
    steps = batch * (n_time - 1 if spec.n_states else n_time)
    speeds = {run: steps / value for run, value in seconds.items()}
    flops = mr.dampers.flops_per_step(name, theta[0])
    peak = sorted(mr.dampers.fma_peak(threads, 0.002 if script.quick else 0.04) for _ in range(rounds))[
        rounds // 2
    ]
    rows[name] = {
        **{"model": name, "n_states": spec.n_states, "batch": batch, "threads": threads},
        **{"substeps": 1, "dt": test.dt},
        **speeds,
        **{f"ratio_{peer}": speeds["ours"] / speeds[peer] for peer in ("jax", "jax_scan")},
        **{"peak_fraction": speeds["ours"] * flops / peak, "flops_per_step": flops, "fma_peak": peak},
        "variants": {"jax": "vmap(simulate)", "jax_scan": f"vmap(scan), unroll {UNROLL}"},
    }

# %% In million steps per second.
millions = {
    name: {"states": row["n_states"], "threads": threads}
    | {run: row[run] / 1e6 for run in ("ours", "jax", "jax_scan")}
    | {f"ours/{peer}": row[f"ratio_{peer}"] for peer in ("jax", "jax_scan")}
    | {"of FMA peak %": 100.0 * row["peak_fraction"]}
    for name, row in sorted(rows.items(), key=lambda pair: pair[1]["n_states"] == 0)
}
instructions = mr.instruction_set()
used = f"{instructions.used}; {processor()}"
script.table(
    "steps", millions, title=f"Million steps per second, medians of rounds in turns; {used}", digits=3
)
script.table("agreement", agreement, title="Misfits, largest relative difference from ours", digits=2)
script.tables["rows"] = rows
script.check()
