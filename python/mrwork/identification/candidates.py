"""Candidates of a damper model under a record: their forces, exact derivatives, and the misfit as a plain function.

A search, a study or a sensitivity analysis of a user calls these three; they are the identification's own simulation
and objective, a batch in a call.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.base.arguments import AnyArrayLike, Positive, Samples, Shape, Threads, checked
from mrwork.base.keys import check_known
from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box, Coordinates, OfPoints
from mrwork.dampers.simulation import (
    Loading,
    refuse_failure,
    refuse_other_unit,
    simulate_forces,
    simulate_sensitivities,
)
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import SettingError
from mrwork.identification.equivalent import search_box
from mrwork.identification.indistinct import bounds_without_offsets
from mrwork.identification.objective import Objective, linearise_residuals, ties_of
from mrwork.identification.residual import LossFunction, LossName, loss_of, refuse_free
from mrwork.identification.settings import FitSettings
from mrwork.records import DamperTest, observed
from mrwork.records.damper_test import as_tests, loading_of
from mrwork.records.observation import DETECT, Observe, Observing
from mrwork.records.window import spans_with

Mask = Annotated[NDArray[np.bool_], Shape(("n_time",))]


@checked
def simulate(
    model: DamperSpec | str, theta: AnyArrayLike, record: DamperTest | Loading, *, threads: Threads = 0
) -> Floats:
    """Forces [N] of candidates of a damper model under the motion and command of a record.

    The states of the damper begin at zero, and the current in the coil at the first command. The force is at
    the damper; `predict` also applies the observation model of a test.

    Parameters
    ----------
    model
        A model or its name.
    theta
        Parameters in the order of `mr.damper(name).names`, shape (n_batch, n_params), or (n_params,) for one candidate.
    record
        A damper test, of which the measured force is not used, or a loading.

    Returns
    -------
    ndarray
        Shape (n_batch, n_time), or (n_time,) for one candidate. Rows that did not finish are infinite.

    Raises
    ------
    SimulationError
        Where the only candidate diverges or cannot be resolved.
    RecordError
        Where the model follows a command that the test does not have.

    Examples
    --------
    >>> import numpy as np, mrwork as mr
    >>> spec = mr.damper("bingham")
    >>> theta = np.tile(spec.nominal, (2000, 1))
    >>> theta[:, 0] = np.linspace(300.0, 900.0, 2000)
    >>> mr.simulate(spec, theta, mr.synthetic_test("spencer1997")).shape
    (2000, 2001)
    """
    spec = damper(model) if isinstance(model, str) else model
    rows, one = _rows_of(theta, spec.names, f"{spec.name} takes")
    run = simulate_forces(spec, rows, loading_for(record, spec).history(), threads=threads)
    if one:
        refuse_failure(spec.name, run.outcome[0])
    return np.asarray(run.force[0] if one else run.force)


@array_dataclass(repr=False)
class ForceSensitivities(WithAxes, Summarised):
    """Forces [N] of candidates, shape (n_batch, n_time), and their exact derivatives, (n_batch, n_time, n_params).

    Without the first axis for one candidate. The derivatives are in newtons per `units` of each of the parameters
    `names`; rows that did not finish are infinite. `time` [s] has shape (n_time,).
    """

    _made_by: ClassVar[str] = "mr.sensitivities(model, theta, record)"
    _units: ClassVar[dict[str, str]] = {"time": "s", "force": "N"}

    model: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    time: Floats
    force: Floats
    jacobian: Floats

    @checked
    def by(self, name: str) -> Floats:
        """Derivative by one parameter, shape (n_batch, n_time), or (n_time,) for one candidate."""
        check_known(name, self.names, f"{self.model} has no parameter {name!r}", otherwise="it has")
        return np.asarray(self.jacobian[..., self.names.index(name)])

    def _named_arrays(self) -> NamedArrays:
        batch = () if self.force.ndim == 1 else ("candidate",)
        candidates = {axis: NamedArray.of(range(len(self.force))) for axis in batch}
        return NamedArrays(
            title=f"Force of {self.model} and its derivatives",
            rows=(*batch, "time"),
            labels={
                **candidates,
                "time": NamedArray.of(self.time, unit="s", long_name="time"),
                "parameter": NamedArray.of(self.names),
            },
            along={"unit": NamedArray.of([f"N/({unit})" for unit in self.units], "parameter")},
            arrays={
                "force": NamedArray.of(self.force, *batch, "time", unit="N", long_name="damper force"),
                "jacobian": NamedArray.of(
                    self.jacobian,
                    *batch,
                    "time",
                    "parameter",
                    long_name="derivative of the force by a parameter",
                ),
            },
        )


@checked
def sensitivities(
    model: DamperSpec | str, theta: AnyArrayLike, record: DamperTest | Loading, *, threads: Threads = 0
) -> ForceSensitivities:
    """Forces of candidates with their exact derivatives by every parameter; arguments as in `simulate`.

    The forces have the same bits as from `simulate`. The derivatives are exact up to rounding for the discrete
    equations; at a kink the branch that the value takes is differentiated.

    Raises
    ------
    SimulationError
        Where the only candidate diverges or cannot be resolved.

    Examples
    --------
    >>> import mrwork as mr
    >>> spec = mr.damper("bingham")
    >>> found = mr.sensitivities(spec, spec.nominal, mr.synthetic_test("spencer1997"))
    >>> found.names, found.jacobian.shape
    (('f_c', 'v_s', 'c0', 'f0'), (2001, 4))
    """
    spec = damper(model) if isinstance(model, str) else model
    rows, one = _rows_of(theta, spec.names, f"{spec.name} takes")
    loading = loading_for(record, spec)
    run = simulate_sensitivities(spec, rows, loading.history(), threads=threads)
    if one:
        refuse_failure(spec.name, run.outcome[0])
    # The compiled module has the derivatives of a parameter one after the other.
    jacobian = np.moveaxis(run.jacobian, 1, 2)
    start = record.start_time if isinstance(record, DamperTest) else 0.0
    return ForceSensitivities(
        model=spec.name,
        names=spec.names,
        units=tuple(parameter.unit for parameter in spec.parameters),
        time=start + loading.dt * np.arange(run.force.shape[1], dtype=np.float64),
        force=run.force[0] if one else run.force,
        jacobian=jacobian[0] if one else jacobian,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class CandidateObjective(OfPoints, Summarised):
    """The objective of an identification as a function of the free parameters, for any optimiser.

    A point has shape (n_free,), many have (n_batch, n_free): values of `names` in `units`, or, with the coordinates
    "unit", shares of the range between their `bounds`, on the scale of each parameter, linear or logarithmic, or, with
    "latent", the logits of these shares. Other parameters are held. `mr.identify` minimises the same `objective`.
    """

    _made_by: ClassVar[str] = "mr.objective(model, tests)"

    objective: Objective
    box: Box
    coordinates: Coordinates = "theta"

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the free parameters."""
        return tuple(self.objective.spec.parameters[index].unit for index in self.box.free)

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        """Lower and upper bound of every coordinate, a pair for each."""
        return tuple(zip(self.lower.tolist(), self.upper.tolist(), strict=True))

    @property
    def start(self) -> Floats:
        """The nominal parameters moved inside the bounds, as a point, shape (n_free,)."""
        return self.box.points_inside(np.array(self.objective.spec.nominal), self.coordinates)

    @checked
    def theta(self, points: AnyArrayLike) -> Floats:
        """All parameters of the model in SI, shape (..., n_params), with those that are held or tied."""
        values = np.asarray(points, dtype=np.float64)
        _rows_of(values, self.names, "the objective takes")
        if self.coordinates == "unit" and not np.all((values >= 0.0) & (values <= 1.0)):
            raise SettingError(
                "a point of the unit cube has coordinates from 0 to 1; give those, see `bounds`"
            )
        theta: Floats = self.box.theta_from(values, self.coordinates)
        ties = self.objective.compared[0].ties
        return theta if ties is None else ties.apply(theta)

    # Any: one number for a point, an array for many.
    @checked
    def __call__(self, points: AnyArrayLike) -> Any:
        """Misfit of a point, a number, or of many, shape (n_batch,); infinite where a simulation failed."""
        theta = self.theta(points)
        misfit = self.objective(np.atleast_2d(theta))
        return misfit[0] if theta.ndim == 1 else misfit

    @checked
    def residuals(self, points: AnyArrayLike) -> Floats:
        """Residuals whose sum of squares is the squared misfit, shape (n_residuals,) or (n_batch, n_residuals)."""
        theta = self.theta(points)
        residuals = self.objective.residuals(np.atleast_2d(theta))
        return np.asarray(residuals[0] if theta.ndim == 1 else residuals)

    @checked
    def jacobian(self, points: AnyArrayLike) -> Floats:
        """Exact derivatives of the residuals, shape (n_residuals, n_free) or (n_batch, n_residuals, n_free)."""
        return self._linearise(points)[1]

    @checked
    def gradient(self, points: AnyArrayLike) -> Floats:
        """Exact derivatives of the misfit, shape (n_free,) or (n_batch, n_free)."""
        residuals, jacobian = self._linearise(points)
        misfit = np.sqrt(np.sum(residuals**2, axis=-1, keepdims=True))
        return np.asarray(np.einsum("...r,...rp->...p", residuals, jacobian) / misfit)

    def _linearise(self, points: AnyArrayLike) -> tuple[Floats, Floats]:
        theta = self.theta(points)
        residuals, slope = linearise_residuals(self.objective, np.atleast_2d(theta), self.box.free)
        if self.coordinates != "theta":
            slope = slope * self.box.slope_from(np.atleast_2d(theta), self.coordinates)[..., None]
        jacobian = np.moveaxis(slope, 1, 2)
        return (residuals[0], jacobian[0]) if theta.ndim == 1 else (residuals, jacobian)

    def _summary(self) -> Summary:
        spec = self.objective.spec
        return Summary(
            title=f"Objective of {spec.name} on {list_names([test.label for test in self.objective.tests])}",
            facts=(("coordinates", self.coordinates), ("samples", str(self.objective.n_time))),
            tables=[self._table(self.units, self.start.tolist())],
        )


@checked
def objective(
    model: DamperSpec | str,
    tests: DamperTest | Sequence[DamperTest],
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    ties: Mapping[str, str] | None = None,
    observe: Observe = DETECT,
    force_exponent: float = 1.0,
    weights: Sequence[Samples | float | None] = (),
    masks: Sequence[Mask | None] = (),
    loss: LossName | LossFunction = "linear",
    loss_scale: Positive | None = None,
    coordinates: Coordinates = "theta",
    threads: Threads = 0,
) -> CandidateObjective:
    """The objective of an identification as a function, for SciPy, pymoo, Optuna, cma or an optimiser of your own.

    It is what `mr.identify` minimises: the misfit (NRMSE) of free runs on the tests, a batch of candidates in a call.

    Parameters
    ----------
    model, tests, ties, observe, force_exponent
        As in `mr.identify`.
    bounds
        Parameter name to (lower, upper); equal bounds hold the parameter. Parameters that are not named have
        the range that `mr.identify` searches first, which follows from stroke, velocity and force of the tests.
    weights
        For each test factors on its residuals, one for each sample, shape (n_time,), or one number; `None` for none.
    masks
        For each test which samples are compared, true or false, shape (n_time,); `None` for all.
    loss, loss_scale
        Loss function of the residuals, and the size of a residual [N] above which it departs from the square; a
        function maps z = (residual/scale)^2 to rho(z) and its derivative, stacked, as in
        `scipy.optimize.least_squares`.
    coordinates
        Whether points are physical parameters, "theta", shares of the range between the bounds, "unit", or the logits
        of these shares, "latent", which have no bounds.

    Raises
    ------
    SettingError
        Where bounds, weights or masks do not fit the model and its tests, every parameter is held, or weights or a loss
        are given together with effects of each test, which have their least-squares values, or an effect is free.

    Examples
    --------
    >>> import mrwork as mr
    >>> from scipy.optimize import least_squares
    >>> objective = mr.objective("bingham", mr.synthetic_test("spencer1997"), coordinates="unit")
    >>> ends = (objective.lower, objective.upper)
    >>> found = least_squares(objective.residuals, objective.start, jac=objective.jacobian, bounds=ends)
    >>> bool(objective(found.x) < objective(objective.start))
    True
    """
    spec = damper(model) if isinstance(model, str) else model
    observing = Observing.of(observe)
    settings = FitSettings(
        bounds=bounds_without_offsets(observing, spec) | dict(bounds or {}),
        ties=dict(ties or {}),
        force_exponent=force_exponent,
        observe=observing,
    )
    refuse_free(observing, "an objective")
    if observing.of_each and (weights or loss != "linear"):
        raise SettingError(
            "the effects that `observe` estimates for each test have their least-squares values, which go with neither "
            "`weights` nor a `loss`; leave one out"
        )
    unmasked = tuple(observed(test, observing) for test in as_tests(tests))
    masked = list(unmasked)
    for index, mask in enumerate(_for_each(masks, None, unmasked, "masks")):
        if mask is not None:
            _check_samples(mask, unmasked[index], "masks")
            masked[index] = replace(unmasked[index], uncompared=spans_with(unmasked[index].uncompared, ~mask))
    whole = Objective.of(spec, tuple(masked), settings, threads=threads)
    compared, rho = [], loss_of(loss, loss_scale)
    for test, weight in zip(whole.compared, _for_each(weights, None, unmasked, "weights"), strict=True):
        factors = None
        if weight is not None:
            if isinstance(weight, np.ndarray):
                _check_samples(weight, test.test, "weights")
            if np.any(np.asarray(weight) < 0.0):
                raise SettingError(f"a weight of {test.test.label} is negative; give numbers of at least 0")
            factors = np.asarray(np.broadcast_to(weight, test.test.force.shape)[test.counted])
        compared.append(replace(test, loss=rho, weights=factors))
    whole = replace(whole, compared=tuple(compared))
    requested = Box.of(spec).with_bounds(settings.bounds)
    searched = search_box(spec, requested, unmasked)
    ranges = zip(searched.names, zip(searched.lower, searched.upper, strict=True), strict=True)
    box = requested.with_bounds({name: bounds for name, bounds in ranges if name not in settings.bounds})
    if (tied := ties_of(spec, settings)) is not None:
        middle = box.theta_from_unit(np.full(len(box.free), 0.5))
        box = box.with_bounds({spec.names[index]: (float(middle[index]),) * 2 for index in tied.indices})
    if not box.free:
        raise SettingError(f"every parameter of {spec.name} is held or tied; leave at least one free")
    return CandidateObjective(objective=whole, box=box, coordinates=coordinates)


EntryT = TypeVar("EntryT")


def _for_each(
    entries: Sequence[EntryT], none: EntryT, tests: Sequence[DamperTest], name: str
) -> Sequence[EntryT]:
    """One entry for each test, `none` where there are no entries at all."""
    if entries and len(entries) != len(tests):
        raise SettingError(
            f"`{name}` has {len(entries)} entries and `tests` {len(tests)}; give one entry for each test"
        )
    return entries or [none] * len(tests)


def _check_samples(samples: NDArray[Any], test: DamperTest, name: str) -> None:
    if samples.shape != test.force.shape:
        raise SettingError(
            f"`{name}` of {test.label} has shape {samples.shape}; give one number for each of its {test.n_time} samples"
        )


def loading_for(record: DamperTest | Loading, spec: DamperSpec) -> Loading:
    """Motion and command of a record, in the unit that the model takes."""
    if isinstance(record, DamperTest):
        return loading_of(record, spec)
    refuse_other_unit(record, spec)
    return record


def _rows_of(theta: ArrayLike, names: Sequence[str], taken_by: str) -> tuple[Floats, bool]:
    """Candidates in rows, and whether a single one was given."""
    rows = np.asarray(theta, dtype=np.float64)
    if rows.ndim not in (1, 2) or rows.shape[-1] != len(names):
        raise SettingError(
            f"`theta` has shape {rows.shape}; {taken_by} {len(names)} numbers, ({len(names)},) or "
            f"(n_batch, {len(names)}): {list_names(names, 20)}"
        )
    return np.atleast_2d(rows), rows.ndim == 1
