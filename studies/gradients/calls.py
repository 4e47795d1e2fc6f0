"""Microseconds of a call: `mr.jax` beside the core that it calls, the core by `jax.pure_callback`, and the twin."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

import mrwork as mr
from mrwork.dampers import LoadingHistory, force_histories, misfits, sensitivities
from mrwork.records import DamperTest
from mrwork.report import Table
from studies.former.arrays import Floats
from studies.former.table import Cell, table_of
from studies.former.timing import Run, require_agreement, time_in_turns
from studies.gradients.posed import near_nominal, record

# jax leaves these unannotated.
_jax: Any = jax
MODELS = ("bingham", "normalised_bouc_wen")
# All are the same simulation; a gradient of the twin is summed in another order over some 1e5 sub-steps.
_AGREEMENT = 1e-6
# What the twin of a batch takes beyond is minutes for a row of which the smaller batches tell the ratio.
_MOST_OF_TWIN = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class CallRow:
    """Microseconds of a call for a batch, medians; `twin` is not a number where it was left out.

    Of the misfit the value, or the value with the gradient; of the force the force, or its mean with weights in time,
    with the gradient of that. `core` is the call of the compiled module alone, whose record is ready, `public` that of
    `mr.objective`, `mr.simulate` or `mr.sensitivities`. `apart` is the largest relative difference from the core.
    """

    model: str
    n_time: int
    batch: int
    what: str
    order: str
    substeps: int
    core: float
    public: float
    kernel: float
    callback: float
    twin: float
    apart: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """A model, its record, and points, (n_params,) or (n_batch, n_params), that take the same sub-steps.

    The force is weighted in time by `weights`, (n_time,).
    """

    model: str
    test: DamperTest
    history: LoadingHistory
    points: Floats
    substeps: int
    weights: Floats
    threads: int

    @classmethod
    def of(cls, model: str, n_time: int, batch: int, threads: int) -> Problem:
        test, points = record(model, n_time), near_nominal(model, batch)
        motion = mr.Loading(dt=test.dt, displacement=test.displacement, velocity=test.velocity).history()
        (substeps,) = {int(each) for each in force_histories(model, np.atleast_2d(points), motion)[2]}
        weights = np.cos(np.linspace(0.0, 3.0, n_time)) / n_time
        return cls(
            model=model,
            test=test,
            history=motion,
            points=points,
            substeps=substeps,
            weights=weights,
            threads=threads,
        )

    @property
    def deviation(self) -> float:
        """Standard deviation of the measured force [N]."""
        return float(np.std(self.test.force))

    @property
    def with_twin(self) -> bool:
        """Whether the twin takes part."""
        return len(np.atleast_2d(self.points)) * self.test.n_time <= _MOST_OF_TWIN

    def misfit(self, points: Floats) -> Floats:
        """Misfits of (n_batch, n_params) by the compiled module, shape (n_batch,)."""
        squared = misfits(self.model, points, self.history, self.test.force, threads=self.threads)[0]
        return np.asarray(np.sqrt(squared / self.test.n_time) / self.deviation)

    def misfit_and_slope(self, points: Floats) -> tuple[Floats, Floats]:
        """Misfits with their gradients, (n_batch, n_params), by one simulation."""
        force, jacobian = self.force_and_jacobian(points)
        residuals = force - self.test.force
        misfit = np.sqrt(np.mean(residuals**2, axis=-1)) / self.deviation
        slope = np.matmul(jacobian, residuals[:, :, None])[:, :, 0]
        return misfit, slope / (misfit * self.deviation**2 * self.test.n_time)[:, None]

    def force(self, points: Floats) -> Floats:
        """Forces, shape (n_batch, n_time)."""
        return force_histories(self.model, points, self.history, threads=self.threads)[0]

    def force_and_jacobian(self, points: Floats) -> tuple[Floats, Floats]:
        """Forces with their derivatives, (n_batch, n_params, n_time)."""
        return sensitivities(self.model, points, self.history, threads=self.threads)[:2]

    def weighted_and_slope(self, points: Floats) -> tuple[Floats, Floats]:
        """Weighted means of the forces, shape (n_batch,), with their gradients, (n_batch, n_params)."""
        force, jacobian = self.force_and_jacobian(points)
        return force @ self.weights, jacobian @ self.weights


def measure(
    *, threads: int, models: Sequence[str], lengths: Sequence[int], batches: Sequence[int], rounds: int
) -> Iterator[CallRow | str]:
    """Rows of every model, length and batch, each contender in turns with the others."""
    for model in models:
        for n_time in lengths:
            for batch in batches:
                problem = Problem.of(model, n_time, batch, threads)
                for what, sides in (("misfit", _misfits), ("force", _forces)):
                    for order in ("value", "gradient"):
                        yield f"{model}, {n_time} samples, {batch}: {what}, {order}"
                        yield _row(problem, what, order, sides(problem, order), rounds)


def _row(problem: Problem, what: str, order: str, runs: dict[str, Run], rounds: int) -> CallRow:
    # The public function of gradients has these alone.
    found = {name: np.asarray(jax.tree.leaves(run())[-1]) for name, run in runs.items()}
    apart = max(float(np.max(np.abs(each - found["core"]))) for each in found.values())
    apart /= float(np.max(np.abs(found["core"])))
    require_agreement("the core and its peers", what, apart, _AGREEMENT)
    seconds, _ = time_in_turns(runs, rounds, lambda: 0.0)
    micro = {name: 1e6 * each for name, each in seconds.items()}
    return CallRow(
        model=problem.model,
        n_time=problem.test.n_time,
        batch=len(np.atleast_2d(problem.points)),
        what=what,
        order=order,
        substeps=problem.substeps,
        core=micro["core"],
        public=micro["public"],
        kernel=micro["kernel"],
        callback=micro["callback"],
        twin=micro.get("twin", np.nan),
        apart=apart,
    )


def _compiled(function: Callable[..., Any], points: Floats, *data: Any) -> Run:
    """A function of a point and data, compiled for these points, as a call that waits for its end."""
    for _ in range(points.ndim - 1):
        function = jax.vmap(function, (0, *(None for _ in data)))
    compiled, given = jax.jit(function), jnp.asarray(points)
    return lambda: _jax.block_until_ready(compiled(given, *data))


def _misfits(problem: Problem, order: str) -> dict[str, Run]:
    points, rows, test = problem.points, np.atleast_2d(problem.points), problem.test
    objective = mr.objective(problem.model, test, threads=problem.threads)
    kernel, callback = mr.jax.misfit(objective, threads=problem.threads), _misfit_by_callback(problem)
    twin = mr.jax.twin(problem.model)

    def on_twin(point: Array, motion: Any, measured: Array) -> Array:
        residuals = twin.simulate(point, motion, problem.substeps) - measured
        return jnp.sqrt(jnp.mean(residuals**2)) / problem.deviation

    data = (twin.record(test), jnp.asarray(test.force))
    if order == "value":
        runs: dict[str, Run] = {
            "core": lambda: problem.misfit(rows),
            "public": lambda: objective(points),
            "kernel": _compiled(kernel, points, kernel.data),
            "callback": _compiled(callback, points),
        }
    else:
        runs = {
            "core": lambda: problem.misfit_and_slope(rows),
            "public": lambda: objective.gradient(points),
            "kernel": _compiled(jax.value_and_grad(kernel), points, kernel.data),
            "callback": _compiled(jax.value_and_grad(callback), points),
        }
    if problem.with_twin:
        runs["twin"] = _compiled(on_twin if order == "value" else _forward(on_twin), points, *data)
    return runs


def _forces(problem: Problem, order: str) -> dict[str, Run]:
    points, rows, test = problem.points, np.atleast_2d(problem.points), problem.test
    kernel, callback, twin = (
        mr.jax.force(problem.model, test, threads=problem.threads),
        _force_by_callback(problem),
        mr.jax.twin(problem.model),
    )
    motion, weights = twin.record(test), jnp.asarray(problem.weights)

    def on_twin(point: Array, motion: Any) -> Array:
        return twin.simulate(point, motion, problem.substeps)

    def weighted(force: Callable[..., Array]) -> Callable[..., Array]:
        return lambda point, weights, *data: jnp.vdot(weights, force(point, *data))

    def public_slope() -> Floats:
        run = mr.sensitivities(problem.model, points, test, threads=problem.threads)
        return np.asarray(np.einsum("...tp,t->...p", run.jacobian, problem.weights))

    if order == "value":
        runs: dict[str, Run] = {
            "core": lambda: problem.force(rows),
            "public": lambda: mr.simulate(problem.model, points, test, threads=problem.threads),
            "kernel": _compiled(kernel, points, kernel.data),
            "callback": _compiled(callback, points),
        }
    else:
        runs = {
            "core": lambda: problem.weighted_and_slope(rows),
            "public": public_slope,
            "kernel": _compiled(jax.value_and_grad(weighted(kernel)), points, weights, kernel.data),
            "callback": _compiled(jax.value_and_grad(weighted(callback)), points, weights),
        }
    if problem.with_twin:
        runs["twin"] = (
            _compiled(on_twin, points, motion)
            if order == "value"
            else _compiled(_forward(weighted(on_twin)), points, weights, motion)
        )
    return runs


def _forward(value: Callable[..., Array]) -> Callable[..., Any]:
    """Value and gradient by forward derivatives, which for few parameters cost least in a long scan."""

    def both(point: Array, *data: Any) -> tuple[Array, Array]:
        def twice(point: Array) -> tuple[Array, Array]:
            found = value(point, *data)
            return found, found

        gradient, found = jax.jacfwd(twice, has_aux=True)(point)
        return found, gradient

    return both


def _misfit_by_callback(problem: Problem) -> Callable[[Array], Array]:
    """The core by `pure_callback`: one call for a batch, and one simulation for a value with its gradient."""
    value, both = _on_host(problem.misfit), _on_host(problem.misfit_and_slope)

    @jax.custom_vjp
    def misfit(point: Array) -> Array:
        found: Array = jax.pure_callback(value, _floats(), point, vmap_method="expand_dims")
        return found

    def forward(point: Array) -> Any:
        shapes = (_floats(), _floats(*point.shape))
        return jax.pure_callback(both, shapes, point, vmap_method="expand_dims")

    misfit.defvjp(forward, lambda slope, along: (along * slope,))
    return misfit


def _force_by_callback(problem: Problem) -> Callable[[Array], Array]:
    """Likewise the force, with the derivatives of the core for the way back."""
    value, both, n_time = _on_host(problem.force), _on_host(problem.force_and_jacobian), problem.test.n_time

    @jax.custom_vjp
    def force(point: Array) -> Array:
        found: Array = jax.pure_callback(value, _floats(n_time), point, vmap_method="expand_dims")
        return found

    def forward(point: Array) -> Any:
        shapes = (_floats(n_time), _floats(*point.shape, n_time))
        return jax.pure_callback(both, shapes, point, vmap_method="expand_dims")

    force.defvjp(forward, lambda jacobian, along: (jacobian @ along,))
    return force


def _on_host(function: Callable[[Floats], Any]) -> Callable[[Any], Any]:
    """A function of rows as one of points of any leading shape."""

    def on_host(points: Any) -> Any:
        given = np.asarray(points)
        found = function(given.reshape(-1, given.shape[-1]))
        return jax.tree.map(lambda each: each.reshape((*given.shape[:-1], *each.shape[1:])), found)

    return on_host


def _floats(*shape: int) -> Any:
    return _jax.ShapeDtypeStruct(shape, jnp.float64)


def tables(rows: Sequence[CallRow]) -> Iterator[Table]:
    """A table for each model and function."""
    columns: dict[str, Cell] = {
        "mr.jax/core": lambda row: f"{row['kernel'] / row['core']:.2f}",
        "mr.jax/public": lambda row: f"{row['kernel'] / row['public']:.2f}",
        "callback/mr.jax": lambda row: f"{row['callback'] / row['kernel']:.2f}",
        "twin/mr.jax": lambda row: _unless_left_out(row["twin"] / row["kernel"], ".1f"),
        "core us": "{core:.0f}",
        "public us": "{public:.0f}",
        "mr.jax us": "{kernel:.0f}",
        "callback us": "{callback:.0f}",
        "twin us": lambda row: _unless_left_out(row["twin"], ".0f"),
        "apart": "{apart:.0e}",
    }
    for model in dict.fromkeys(row.model for row in rows):
        for what in dict.fromkeys(row.what for row in rows):
            own = [row for row in rows if (row.model, row.what) == (model, what)]
            yield table_of(
                f"{what} of {model}, sub-steps per sample: {own[0].substeps}",
                "call",
                ((f"{row.order}, {row.n_time} x {row.batch}", asdict(row)) for row in own),
                columns,
            )


def _unless_left_out(value: float, form: str) -> str:
    return "-" if np.isnan(value) else format(value, form)
