"""One fit from the same starts: optimistix and optax on `mr.jax`, SciPy on the core, and a user's loop in diffrax.

All move the logits of six parameters of the normalised Bouc-Wen model in the same box.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.optimize import least_squares

import mrwork as mr
from mrwork.identification import CandidateObjective, find_minima
from mrwork.records import DamperTest
from mrwork.report import Table
from studies.former.arrays import Floats
from studies.former.table import Cell, table_of
from studies.former.timing import rotated, timed
from studies.gradients.own_loop import force_by_diffrax
from studies.gradients.posed import record

MODEL, HELD = "normalised_bouc_wen", "x0"
# jax leaves these unannotated.
_jax: Any = jax
# How far the start is from the truth, in logits.
_AWAY = 0.5
_TOLERANCE = 1e-7
# Share of the least misfit.
NEAR = 1e-3
_MOST_STEPS = 200
_ADAM_RATE = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class FitRow:
    """One engine: medians over the starts, and the share of starts that arrive `NEAR` the least misfit of all.

    Misfits are those of the core where an engine ended. `evaluations` are residuals with their Jacobian, or misfits
    with their gradient, of `mr.identify` simulations; `seconds` are without `compile_seconds`. `gradient_apart` is the
    largest difference of an engine's gradient from that of the core, over the largest component there, at the first
    start; not a number where it has none of its own.
    """

    engine: str
    arrived: float
    misfit: float
    evaluations: float
    seconds: float
    compile_seconds: float
    gradient_apart: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """An objective of logits, starts, (n_starts, n_params), and the sub-steps that the core takes at the first."""

    test: DamperTest
    objective: CandidateObjective
    starts: Floats
    substeps: int
    adam_steps: int

    @classmethod
    def of(cls, n_time: int, adam_steps: int, starts: int, threads: int) -> Problem:
        test = record(MODEL, n_time)
        nominal = np.array(mr.damper(MODEL).nominal)
        held = {HELD: (float(nominal[mr.damper(MODEL).names.index(HELD)]),) * 2}
        objective = mr.objective(
            MODEL, test, bounds=held, observe="none", coordinates="latent", threads=threads
        )
        away = _AWAY * np.random.default_rng(2).choice([-1.0, 1.0], (starts, len(objective.names)))
        places = np.asarray(objective.box.latent_from_theta(objective.box.inside(nominal))) + away
        (run,) = objective.objective.misfits(objective.theta(places[:1]))
        return cls(
            test=test,
            objective=objective,
            starts=places,
            substeps=int(run.substeps[0]),
            adam_steps=adam_steps,
        )

    def residuals_of(self, force: Callable[[Array], Array]) -> Callable[[Array], Array]:
        """Residuals of logits as `mr.objective` has them, of another simulation of parameters."""
        measured, box = jnp.asarray(self.test.force), self.objective.box
        scale = float(np.std(self.test.force) * np.sqrt(self.test.n_time))

        def residuals(latent: Array) -> Array:
            return (force(jnp.asarray(box.theta_from_latent(latent))) - measured) / scale

        return residuals


@dataclass(frozen=True, slots=True, kw_only=True)
class Ready:
    """An engine that is compiled: from a start, `run` has the logits where it ends, and how often it evaluated."""

    run: Callable[[Floats], tuple[Floats, int]]
    compile_seconds: float = 0.0
    gradient: Floats | None = None


def measure(
    *, threads: int, n_time: int, adam_steps: int, starts: int, engines: Sequence[str]
) -> Iterator[FitRow | str]:
    """Rows of the engines whose libraries are installed, all if none are named; they take turns from start to start."""
    problem = Problem.of(n_time, adam_steps, starts, threads)
    ready: dict[str, Ready] = {}
    for name, (library, prepare) in ENGINES.items():
        if (engines and name not in engines) or find_spec(library) is None:
            continue
        yield f"compiling {name}"
        ready[name] = prepare(problem)
    expected = problem.objective.gradient(problem.starts[0])
    found: dict[str, list[tuple[float, int, float]]] = {name: [] for name in ready}
    for turn, start in enumerate(problem.starts):
        for name in rotated(list(ready), turn):
            yield f"start {turn + 1} of {starts}: {name}"
            (latent, evaluations), seconds = timed(partial(ready[name].run, start))
            found[name].append((float(problem.objective(latent)), evaluations, seconds))
    least = min(misfit for ends in found.values() for misfit, _, _ in ends)
    for name, ends in found.items():
        misfits, evaluations, seconds = np.array(ends).T
        gradient = ready[name].gradient
        apart = np.nan if gradient is None else np.max(np.abs(gradient - expected)) / np.max(np.abs(expected))
        yield FitRow(
            engine=name,
            arrived=float(np.mean(misfits <= least * (1.0 + NEAR))),
            misfit=float(np.median(misfits)),
            evaluations=float(np.median(evaluations)),
            seconds=float(np.median(seconds)),
            compile_seconds=ready[name].compile_seconds,
            gradient_apart=float(apart),
        )


def _by_marquardt(problem: Problem, residuals: Callable[[Array], Array]) -> Ready:
    optimistix: Any = import_module("optimistix")
    solver = optimistix.LevenbergMarquardt(rtol=_TOLERANCE, atol=_TOLERANCE)

    def solve(start: Array) -> tuple[Array, Array]:
        solution = optimistix.least_squares(
            lambda latent, _: residuals(latent),
            solver,
            start,
            options={"jac": "fwd"},
            max_steps=_MOST_STEPS,
            throw=False,
        )
        return solution.value, solution.stats["num_steps"]

    def misfit(latent: Array) -> Array:
        return jnp.sqrt(jnp.sum(residuals(latent) ** 2))

    return _compiled(problem, solve, jax.jacfwd(misfit))


def _compiled(problem: Problem, solve: Callable[[Array], Any], gradient: Callable[[Array], Array]) -> Ready:
    """A function of the start that gives logits and a count, compiled."""
    start = jnp.asarray(problem.starts[0])
    compiled, seconds = timed(lambda: jax.jit(solve).lower(start).compile())

    def run(start: Floats) -> tuple[Floats, int]:
        latent, count = _jax.block_until_ready(compiled(jnp.asarray(start)))
        return np.asarray(latent), int(count)

    return Ready(run=run, compile_seconds=seconds, gradient=np.asarray(jax.jit(gradient)(start)))


def _on_kernel(problem: Problem) -> Ready:
    return _by_marquardt(problem, mr.jax.residuals(problem.objective))


def _on_twin(problem: Problem) -> Ready:
    twin = mr.jax.twin(MODEL)
    motion = twin.record(problem.test)
    return _by_marquardt(
        problem, problem.residuals_of(lambda theta: twin.simulate(theta, motion, problem.substeps))
    )


def _on_diffrax(solver: Any, problem: Problem) -> Ready:
    force = force_by_diffrax(problem.test, solver, problem.substeps)
    return _by_marquardt(problem, problem.residuals_of(force))


def _by_lbfgs(problem: Problem) -> Ready:
    optax: Any = import_module("optax")
    misfit = mr.jax.misfit(problem.objective)
    method = optax.lbfgs()
    # The line search leaves the last value and gradient in the state; what is asked again is read from there.
    value_and_gradient = optax.value_and_grad_from_state(misfit)

    def solve(start: Array) -> tuple[Array, Array]:
        def unfinished(carry: Any) -> Array:
            _, state, before, evaluations = carry
            value = optax.tree.get(state, "value")
            # Both are infinite at the start.
            goes_on: Array = (evaluations < _MOST_STEPS) & ~(before - value <= _TOLERANCE * value)
            return goes_on

        def advance(carry: Any) -> Any:
            latent, state, _, evaluations = carry
            value, gradient = value_and_gradient(latent, state=state)
            updates, state = method.update(
                gradient, state, latent, value=value, grad=gradient, value_fn=misfit
            )
            searched = optax.tree.get(state, "info").num_linesearch_steps
            return optax.apply_updates(latent, updates), state, value, evaluations + searched

        first = (start, method.init(start), jnp.inf, jnp.zeros((), dtype=int))
        latent, _, _, evaluations = jax.lax.while_loop(unfinished, advance, first)
        return latent, evaluations + 1

    return _compiled(problem, solve, jax.grad(misfit))


def _by_adam(problem: Problem) -> Ready:
    optax: Any = import_module("optax")
    misfit = mr.jax.misfit(problem.objective)
    method = optax.adam(optax.cosine_decay_schedule(_ADAM_RATE, problem.adam_steps))

    def solve(start: Array) -> tuple[Array, int]:
        def advance(carry: Any, _: None) -> Any:
            latent, state = carry
            updates, state = method.update(jax.grad(misfit)(latent), state)
            return (optax.apply_updates(latent, updates), state), None

        (latent, _), _ = jax.lax.scan(advance, (start, method.init(start)), length=problem.adam_steps)
        return latent, problem.adam_steps

    return _compiled(problem, solve, jax.grad(misfit))


def _by_scipy(problem: Problem) -> Ready:
    objective = problem.objective

    def run(start: Floats) -> tuple[Floats, int]:
        found = least_squares(
            objective.residuals,
            start,
            jac=objective.jacobian,
            ftol=_TOLERANCE,
            xtol=_TOLERANCE,
            max_nfev=_MOST_STEPS,
        )
        return found.x, int(found.nfev)

    return Ready(run=run, gradient=objective.gradient(problem.starts[0]))


def _by_lanes(problem: Problem) -> Ready:
    objective = problem.objective

    def run(start: Floats) -> tuple[Floats, int]:
        theta = objective.theta(start)[None]
        found = find_minima(objective.objective, objective.box, theta, max_iterations=_MOST_STEPS)
        return np.asarray(objective.box.latent_from_theta(found.theta[0])), found.iterations

    return Ready(run=run)


def _by_identify(problem: Problem) -> Ready:
    objective = problem.objective
    box = objective.box
    bounds = dict(zip(box.names, zip(box.lower, box.upper, strict=True), strict=True))

    def run(start: Floats) -> tuple[Floats, int]:
        theta = dict(zip(box.names, objective.theta(start).tolist(), strict=True))
        fit = mr.identify(
            MODEL, problem.test, bounds=bounds, starts=[theta], observe="none", rng=1, threads=1
        )
        return np.asarray(box.latent_from_theta(box.inside(np.array(fit.theta)))), fit.evaluations

    return Ready(run=run)


# Library and preparation of each engine.
ENGINES: dict[str, tuple[str, Callable[[Problem], Ready]]] = {
    "optimistix LM on mr.jax": ("optimistix", _on_kernel),
    "SciPy trf on mr.objective": ("scipy", _by_scipy),
    "lanes, find_minima": ("mrwork", _by_lanes),
    "mr.identify, with its search": ("mrwork", _by_identify),
    "optax L-BFGS on mr.jax": ("optax", _by_lbfgs),
    "optax Adam on mr.jax": ("optax", _by_adam),
    "optimistix LM on the twin": ("optimistix", _on_twin),
    "optimistix LM on diffrax, Tsit5, adaptive": ("diffrax", partial(_on_diffrax, "tsit5")),
    "optimistix LM on diffrax, Heun, fixed": ("diffrax", partial(_on_diffrax, "heun")),
}


def tables(rows: Sequence[FitRow]) -> Iterator[Table]:
    """One table; seconds over those of the first row."""
    if not rows:
        return
    first = rows[0].seconds
    columns: dict[str, Cell] = {
        "seconds, ratio": lambda row: f"{row['seconds'] / first:.3g}",
        "arrive": "{arrived:.0%}",
        "misfit": "{misfit:.6f}",
        "evaluations": "{evaluations:.0f}",
        "seconds": "{seconds:.3g}",
        "compile s": "{compile_seconds:.2g}",
        "gradient apart": lambda row: (
            "-" if np.isnan(row["gradient_apart"]) else f"{row['gradient_apart']:.0e}"
        ),
    }
    yield table_of(
        "One fit from the same starts", "engine", ((row.engine, asdict(row)) for row in rows), columns
    )
