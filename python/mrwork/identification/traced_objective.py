"""Forces, residuals and misfits as functions of JAX, with the exact derivatives of the kernel.

They equal `mr.simulate` and `mr.objective`, for `jit`, `vmap`, `grad`, `jacfwd` and `jacrev`. A point at which a
simulation fails, or that lies outside the unit cube, has an infinite force and misfit, with derivatives of zero.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mrwork.base.arguments import Threads, checked
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box, Coordinates
from mrwork.dampers.parameters import MOST_SUBSTEPS
from mrwork.dampers.simulation import Loading
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import SettingError
from mrwork.identification.candidates import CandidateObjective, loading_for, objective
from mrwork.identification.objective import Objective
from mrwork.identification.residual import Loss, without_effects
from mrwork.identification.ties import Ties
from mrwork.records import DamperTest, Observation
from mrwork.records.observation import AS_IT_IS, Effect, observe_by
from mrwork.twins.kernel import Kernel
from mrwork.twins.model_twins import on_processor
from mrwork.twins.powers import root
from mrwork.twins.record_arrays import RecordArrays
from mrwork.twins.traced_function import TracedFunction


class ComparedArrays(NamedTuple):
    """A test: its motion, the measured force [N] that is compared, (n_counted,), and its normalisation.

    `counted` are the samples that are compared, `weights` the factors on their residuals, and `acceleration` that of
    the motion [m/s^2], zero where no mass needs it.
    """

    record: RecordArrays
    measured: Array
    normalisation: Array
    counted: Array
    weights: Array
    acceleration: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Residuals:
    """Residuals of an objective as a function of parameters and tests; equal values share one compilation.

    `observed` are the observation model and the step [s] of each test.
    """

    kernel: Kernel
    observed: tuple[tuple[Observation, float], ...]
    each: tuple[Effect, ...]
    loss: Loss | None
    ties: Ties | None

    @classmethod
    def of(
        cls, objective: Objective, *, columns: Sequence[int], substeps: int = 0, threads: int = 1
    ) -> Residuals:
        """The form of an objective; it is differentiated with respect to these columns of `theta`, and those tied."""
        first = objective.compared[0]
        if callable(first.loss and first.loss.rho):
            raise SettingError(
                "mr.jax has the losses by name, and this one is a function in NumPy; write it in jax.numpy over "
                "mr.jax.residuals"
            )
        tied = () if first.ties is None else first.ties.indices
        for test in objective.tests:
            # Refuse here what cannot be observed.
            test.observation.observe(np.zeros(2), test.dt, np.zeros(2))
        return cls(
            kernel=Kernel(
                spec=objective.spec, columns=(*sorted({*columns, *tied}),), substeps=substeps, threads=threads
            ),
            # Without an observation model another step needs no other compilation.
            observed=tuple(
                (test.observation, 1.0 if test.observation == AS_IT_IS else test.dt)
                for test in objective.tests
            ),
            each=objective.settings.observing.of_each,
            loss=first.loss,
            ties=first.ties,
        )

    def newtons(self, theta: Array, tests: Sequence[ComparedArrays]) -> list[tuple[Array, Array]]:
        """Residuals of each test [N], shape (n_counted,), zero where its simulation failed, and whether it did."""
        tied = theta if self.ties is None else self.ties.feasible(theta)
        results = []
        for (observation, dt), test in zip(self.observed, tests, strict=True):
            force = self.kernel(tied, test.record)
            failed = jnp.isinf(force[-1])
            force = observe_by(observation, _filtered, jnp.where(failed, 0.0, force), dt, test.acceleration)
            (residual,) = without_effects(force[None, test.counted], test.measured, self.each)
            results.append((jnp.where(failed, 0.0, residual), failed))
        return results

    def normalised(self, theta: Array, tests: Sequence[ComparedArrays]) -> tuple[Array, Array]:
        """Residuals whose sum of squares is the squared misfit, (n_residuals,), 1 in tests that failed; and if any did.

        They are those of `Objective.residuals`.
        """
        parts, failures = [], []
        for test, (residual, failed) in zip(tests, self.newtons(theta, tests), strict=True):
            emphasised = residual * test.weights
            if self.loss is not None:
                emphasised = _transform(self.loss, emphasised)
            parts.append(jnp.where(failed, 1.0, emphasised * test.normalisation))
            failures.append(failed)
        return jnp.concatenate(parts), jnp.any(jnp.stack(failures))

    def __call__(self, theta: Array, tests: Sequence[ComparedArrays]) -> Array:
        """Normalised residuals of all tests, one after another, shape (n_residuals,); 1 where a simulation failed."""
        return self.normalised(theta, tests)[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """The misfit of all tests, a function of parameters and tests that JAX differentiates."""

    residuals: Residuals

    def __call__(self, theta: Array, tests: Sequence[ComparedArrays]) -> Array:
        """The root mean square of the NRMSE; infinite where a simulation failed."""
        residuals, failed = self.residuals.normalised(theta, tests)
        return jnp.where(failed, jnp.inf, root(jnp.sum(residuals**2)))


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def _transform(loss: Loss, residuals: Array) -> Array:
    transformed: Array = loss.transform(residuals)[0]
    return transformed


@_transform.defjvp
def _transform_slope(loss: Loss, primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    transformed, slope = loss.transform(primals[0])
    return transformed, slope * tangents[0]


@on_processor()
def arrays_of(objective: Objective) -> tuple[ComparedArrays, ...]:
    """Record, measured force, weights and compared samples of each test, as arrays of JAX."""
    return tuple(
        ComparedArrays(
            record=RecordArrays.of(test.history),
            measured=jnp.asarray(test.measured),
            normalisation=jnp.asarray(test.normalisation),
            counted=jnp.arange(test.test.n_time)[test.counted],
            weights=jnp.asarray(1.0 if test.weights is None else test.weights),
            acceleration=jnp.asarray(0.0 if test.acceleration is None else test.acceleration),
        )
        for test in objective.compared
    )


@checked
def force(
    model: DamperSpec | str,
    record: DamperTest | Loading,
    *,
    coordinates: Coordinates = "theta",
    substeps: int | None = None,
    threads: Threads = 1,
) -> TracedFunction:
    """The simulated force of a record as a function of all parameters, for JAX; it has the bits of `mr.simulate`.

    Parameters
    ----------
    model
        A model or its name.
    record
        A damper test, of which the measured force is not used, or a loading.
    coordinates
        Whether a point is physical parameters, "theta", shares of the range between the bounds of the model, "unit", or
        the logits of these shares, "latent".
    substeps
        Sub-steps per sample of every point, a power of two. By default they follow from the stiffness of the point, and
        the force jumps, within the error of the integration, where their number changes.

    Returns
    -------
    TracedFunction
        Of a point, shape (n_params,), the force [N], (n_time,); infinite where the simulation fails, with derivatives
        of zero.

    Raises
    ------
    RecordError
        Where the model follows a command that the record does not have.
    LibraryError
        Where this version of jaxlib does not take the operation.

    Examples
    --------
    >>> import jax, jax.numpy as jnp, mrwork as mr
    >>> spec = mr.damper("bingham")
    >>> force = mr.jax.force(spec, mr.synthetic_test("spencer1997"))
    >>> jax.jacfwd(force)(jnp.array(spec.nominal)).shape
    (2001, 4)
    """
    spec = damper(model) if isinstance(model, str) else model
    return TracedFunction.of(
        f"Force of {spec.name}",
        Kernel(spec=spec, columns=(*range(len(spec.names)),), substeps=_substeps(substeps), threads=threads),
        box=Box.of(spec),
        units=tuple(parameter.unit for parameter in spec.parameters),
        coordinates=coordinates,
        start=np.array(spec.nominal),
        data=RecordArrays.of(loading_for(record, spec).history()),
    )


@checked
def residuals(
    model: DamperSpec | str | CandidateObjective,
    tests: DamperTest | Sequence[DamperTest] | None = None,
    *,
    coordinates: Coordinates | None = None,
    substeps: int | None = None,
    threads: Threads = 1,
) -> TracedFunction:
    """The residuals of an objective as a function of its free parameters, for JAX; arguments as in `misfit`.

    Of a point, shape (n_free,), it has the residuals of `mr.objective`, shape (n_residuals,), whose sum of squares is
    the squared misfit. In tests whose simulation fails they are 1, with derivatives of zero.
    """
    objective = candidate_objective(model, tests, coordinates)
    return function_of(objective, form_of(objective, substeps, threads), "Residuals")


@checked
def misfit(
    model: DamperSpec | str | CandidateObjective,
    tests: DamperTest | Sequence[DamperTest] | None = None,
    *,
    coordinates: Coordinates | None = None,
    substeps: int | None = None,
    threads: Threads = 1,
) -> TracedFunction:
    """The misfit of `mr.identify` and `mr.objective` as a function of the free parameters, for JAX.

    Parameters
    ----------
    model
        A model or its name; or an objective, `mr.objective(...)`, with its bounds, ties, effects of each test, weights,
        masks and loss, and then no `tests`.
    tests
        The tests.
    coordinates
        As in `mr.objective`; those of `model` are the default where it is an objective.
    substeps, threads
        As in `mr.jax.force`. With a fixed number of sub-steps the misfit has no jumps.

    Returns
    -------
    TracedFunction
        Of a point, shape (n_free,), the misfit (NRMSE); infinite where a simulation fails, with a derivative of zero.

    Raises
    ------
    SettingError
        Where a loss is a function, which is one in NumPy.

    Examples
    --------
    >>> import jax, jax.numpy as jnp, mrwork as mr
    >>> misfit = mr.jax.misfit("bingham", mr.synthetic_test("spencer1997"), coordinates="unit")
    >>> jax.grad(misfit)(jnp.array(misfit.start)).shape
    (4,)
    """
    candidates = candidate_objective(model, tests, coordinates)
    return function_of(candidates, Misfit(residuals=form_of(candidates, substeps, threads)), "Misfit")


def candidate_objective(
    model: DamperSpec | str | CandidateObjective,
    tests: DamperTest | Sequence[DamperTest] | None,
    coordinates: Coordinates | None,
) -> CandidateObjective:
    """The objective that is given, or a new one of a model and its tests."""
    if not isinstance(model, CandidateObjective):
        if tests is None:
            raise SettingError("`tests` are missing; give a damper test, or several, beside the model")
        return objective(model, tests, coordinates=coordinates or "theta")
    if tests is not None:
        raise SettingError("an objective has its tests; leave `tests` out, or give a model beside them")
    return model if coordinates is None else replace(model, coordinates=coordinates)


def form_of(given: CandidateObjective, substeps: int | None, threads: int) -> Residuals:
    """The residuals of an objective, with derivatives with respect to its free parameters."""
    return Residuals.of(
        given.objective, columns=given.box.free, substeps=_substeps(substeps), threads=threads
    )


def function_of(
    given: CandidateObjective,
    compute: Callable[[Array, Any], Array],
    what: str,
    *,
    box: Box | None = None,
    start: Sequence[float] = (),
) -> TracedFunction:
    """A function of the point of an objective, and of further parameters of the `box`, if one is given."""
    labels = list_names([test.label for test in given.objective.tests])
    return TracedFunction.of(
        f"{what} of {given.objective.spec.name} on {labels}",
        compute,
        box=box or given.box,
        units=(*given.units, *("1" for _ in start)),
        coordinates=given.coordinates,
        start=np.array([*given.objective.spec.nominal, *start]),
        data=arrays_of(given.objective),
    )


def _substeps(wanted: int | None) -> int:
    if wanted is not None and not (0 < wanted <= MOST_SUBSTEPS and wanted.bit_count() == 1):
        raise SettingError(
            f"`substeps` is {wanted}; give a power of two from 1 to {MOST_SUBSTEPS}, or leave it out for those of the "
            "stepping rule"
        )
    return wanted or 0


def _filtered(
    numerator: Floats | list[float], denominator: Floats | list[float], signal: Array, _settled: object
) -> Array:
    """A filter as a recursion of first order for each of its poles, from rest at the first value of the signal."""
    weights = np.asarray(numerator)
    order = weights.size - 1
    padded = jnp.concatenate([*[signal[..., :1]] * order, signal], axis=-1)
    driven: Any = sum(
        weight * padded[..., order - back : padded.shape[-1] - back] for back, weight in enumerate(weights)
    )
    steady = weights.sum() * signal[..., :1]
    for pole in np.roots(denominator):
        steady = steady / (1.0 - pole)
        driven = _recursion(pole, driven, steady)
    return jnp.real(driven)


def _recursion(factor: Any, driven: Any, before: Any) -> Any:
    """y of y[t] = factor y[t - 1] + driven[t] along the last axis; `before` is y before the first sample."""
    factors = jnp.full_like(jnp.asarray(driven) + before, factor, dtype=jnp.result_type(driven, factor))

    def after(one: tuple[Array, Array], other: tuple[Array, Array]) -> tuple[Array, Array]:
        return one[0] * other[0], one[1] * other[0] + other[1]

    decays, answers = jax.lax.associative_scan(after, (factors, driven + 0.0 * factors), axis=-1)
    return answers + decays * before
