"""Largest errors of every method over the peak force, against the core with 64 times its sub-steps."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from mrwork.dampers import LoadingHistory, damper, simulate_forces
from mrwork.twins import simulate
from studies.former.arrays import Floats
from studies.stiff_stepping.any_model import twin_force
from studies.stiff_stepping.batch import PRESET, forces, random_record

FINEST = 64
FINE = 16
TOLERANCE = 1e-3
# The records start in motion from a damper at rest: what a coarse step makes of that jump is over by then.
START = 5e-3


def preset_error(method: str, substeps: int, seeds: range) -> dict[str, float]:
    """Worst of several records, the preset of Dyke et al.: over the whole record, and after its first 5 ms."""
    theta = damper(PRESET).nominal[None]
    found = []
    for seed in seeds:
        history = random_record(seed)
        exact = simulate_forces(damper(PRESET), theta, history, substep_factor=FINEST).force[:, :-1]
        found.append(_error(forces(method, theta, history, substeps), exact, history)[:, 0])
    whole, late = np.max(found, axis=0)
    return {"whole": float(whole), "late": float(late)}


def _error(force: Floats, exact: Floats, history: LoadingHistory) -> Floats:
    """Whole and late error of each row, shape (2, n_batch); what is not finite is infinite."""
    departure = np.nan_to_num(np.abs(force - exact), nan=np.inf) / np.max(np.abs(exact), axis=1)[:, None]
    late = departure[:, round(START / history.dt) :]
    return np.stack([departure.max(axis=1), late.max(axis=1)])


def scattered(n_batch: int, rng: np.random.Generator) -> Floats:
    """Candidates about the preset: sizes scattered by half, sigma from 1/2 to 3, n from 1 to 3."""
    theta = np.tile(damper(PRESET).nominal, (n_batch, 1))
    theta[:, [0, 1, 2, 5, 6]] *= np.exp(0.5 * rng.standard_normal((n_batch, 5)))
    theta[:, 7] = np.exp(rng.uniform(np.log(0.5), np.log(3.0), n_batch))
    theta[:, 8] = rng.uniform(1.0, 3.0, n_batch)
    return theta


def scattered_errors(
    methods: tuple[str, ...], factors: tuple[float, ...], n_batch: int
) -> dict[str, dict[float, Floats]]:
    """Late errors of scattered candidates, each with `factor` times the sub-steps that the core gives it."""
    theta = scattered(n_batch, np.random.default_rng(0))
    history = random_record(1, n_time=1000)
    reference = simulate_forces(damper(PRESET), theta, history, substep_factor=FINE)
    exact = reference.force[:, :-1]
    counts = reference.substeps // FINE
    found: dict[str, dict[float, Floats]] = {method: {} for method in methods}
    for method in methods:
        for factor in factors:
            error = np.empty(n_batch)
            for count in np.unique(counts):
                rows = counts == count
                force = forces(method, theta[rows], history, max(1, int(factor * count)))
                error[rows] = _error(force, exact[rows], history)[1]
            found[method][factor] = error
    return found


def model_errors(
    model: str, methods: tuple[str, ...], dt: float, seeds: range
) -> tuple[int, dict[str, float]]:
    """Sub-steps of the core for a model at its nominal values, worst late errors of it and of other methods."""
    spec = damper(model)
    worst: dict[str, float] = {}
    for seed in seeds:
        history = random_record(seed, dt)
        exact = simulate_forces(spec, spec.nominal[None], history, substep_factor=FINEST).force[:, :-1]
        run = simulate_forces(spec, spec.nominal[None], history)
        count = int(run.substeps[0])
        candidates = {"rk4": run.force[:, :-1]}
        for method in methods:
            candidates[method] = np.asarray(twin_force(method, spec, spec.nominal, history, count))[None]
        for method, force in candidates.items():
            worst[method] = max(worst.get(method, 0.0), float(_error(force, exact, history)[1, 0]))
    return count, worst


def derivative_error(method: str, substeps: int, exponent: float) -> float:
    """Error of the force's derivatives by rho, sigma and n over their peaks, the largest of the three."""
    spec = damper(PRESET)
    theta = jnp.asarray(np.where(np.arange(9) == 8, exponent, spec.nominal))
    history = random_record(1, n_time=600)

    def by_core(substeps: int) -> jax.Array:
        stages = jnp.asarray(history.stages(substeps))
        return jax.jacfwd(lambda theta: simulate(spec, theta, stages, history.dt)[:-1])(theta)

    if method == "rk4":
        found = by_core(substeps)
    else:
        found = jax.jacfwd(lambda theta: twin_force(method, spec, theta, history, substeps))(theta)
    exact = by_core(16 * 8)
    error = jnp.max(jnp.abs(found - exact), axis=0) / jnp.max(jnp.abs(exact), axis=0)
    return float(jnp.max(error[6:]))
