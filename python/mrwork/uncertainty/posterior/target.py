"""Posterior density: priors of parameters, the coordinates that are sampled, and prior times likelihood of all tests.

The default prior is uniform over the bounds, on the parameter's own scale: in the logarithm where the model declares
it. Priors and coordinates are written on the array API for NumPy and JAX.

A coordinate runs over [0, 1] as its parameter runs over its bounds, on the scale of the parameter. One pair is
different: of a spring force k (x - x0) the data determine the stiffness k and the product k x0, an offset of the force.
Where k may be zero, the posterior of x0 follows a hyperbola that samplers cannot explore, and a prior that is uniform
in x0 over metres would favour k = 0. There k x0 is the coordinate in place of x0, with a uniform prior by default.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import isfinite, log, pi
from typing import Annotated, Any, ClassVar, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import Positive, checked
from mrwork.base.hints import Within
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.errors import SettingError, UnknownNameError
from mrwork.identification.covariance import effective_samples
from mrwork.identification.equivalent import Form
from mrwork.identification.fit import Fit
from mrwork.identification.objective import Objective
from mrwork.identification.problem import Problem
from mrwork.records import DamperTest
from mrwork.uncertainty.noise import Iid, Noise

# NumPy or JAX, as in `coordinates`.
AnyArray = Any

_HALF_LOG_2_PI = 0.5 * log(2.0 * pi)


@runtime_checkable
class Prior(Protocol):
    """A prior density of one parameter."""

    def log_density(self, value: AnyArray) -> AnyArray:
        """Log density of each value, of the same shape; -inf outside the support."""


@checked
class Normal:
    """Normal about `mean` with standard `deviation`."""

    mean: float
    deviation: Positive

    def log_density(self, value: AnyArray) -> AnyArray:
        """Log density of each value, of the same shape."""
        return -0.5 * ((value - self.mean) / self.deviation) ** 2 - log(self.deviation) - _HALF_LOG_2_PI


@checked
class Lognormal:
    """Lognormal about `median`, with the standard `deviation` of the natural logarithm."""

    median: Positive
    deviation: Positive

    def log_density(self, value: AnyArray) -> AnyArray:
        """Log density of each value, of the same shape; -inf where it is not positive."""
        xp = value.__array_namespace__()
        positive = value > 0.0
        logarithm = xp.log(xp.where(positive, value, 1.0))
        deviations = (logarithm - log(self.median)) / self.deviation
        density = -0.5 * deviations**2 - log(self.deviation) - _HALF_LOG_2_PI - logarithm
        return xp.where(positive, density, -xp.inf)


@checked
class Uniform:
    """Uniform in the value between two limits, regardless of the scale of the parameter."""

    lower: float
    upper: float

    def __post_init__(self) -> None:
        if not self.lower < self.upper:
            raise SettingError(
                f"a uniform prior has the limits {self.lower:g} and {self.upper:g}; give the lower one first"
            )

    def log_density(self, value: AnyArray) -> AnyArray:
        """Log density of each value, of the same shape; -inf outside the bounds."""
        xp = value.__array_namespace__()
        inside = (value >= self.lower) & (value <= self.upper)
        return xp.where(inside, -log(self.upper - self.lower), -xp.inf)


_KINDS: dict[str, Callable[[float, float], Prior]] = {
    "normal": lambda mean, deviation: Normal(mean=mean, deviation=deviation),
    "lognormal": lambda median, deviation: Lognormal(median=median, deviation=deviation),
    "uniform": lambda lower, upper: Uniform(lower=lower, upper=upper),
}


PRIORS_IN_WORDS = "normal:MEAN:DEVIATION, lognormal:MEDIAN:DEVIATION_OF_LOG or uniform:LOWER:UPPER"


def prior_of_text(text: str) -> Prior:
    """The prior of `KIND:NUMBER:NUMBER`, such as `normal:650:50`."""
    kind, *numbers = text.split(":")
    try:
        first, second = (float(number) for number in numbers)
    except ValueError:
        first = second = float("nan")
    if kind not in _KINDS or not (isfinite(first) and isfinite(second)):
        raise SettingError(f"a prior is {text!r}; give {PRIORS_IN_WORDS}")
    return _KINDS[kind](first, second)


NOISE = "noise."
# Tolerance for parameters on a face of the box, whose logarithm is rounded.
_OFF_FACE = 1e-12


def with_noise(box: Box, noise: Noise) -> Box:
    """The ranges of the parameters of a model and then of a noise model."""
    return Box(
        names=box.names + tuple(NOISE + parameter.name for parameter in noise.parameters),
        lower=box.lower + tuple(parameter.lower for parameter in noise.parameters),
        upper=box.upper + tuple(parameter.upper for parameter in noise.parameters),
        log=box.log + tuple(parameter.log for parameter in noise.parameters),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Space:
    """Positions (..., n_dim) of free and noise parameters in a `box`; `pair` holds the coordinates of k and of k x0."""

    box: Box
    n_params: int
    pair: tuple[int, int] | None
    priors: tuple[Prior | None, ...]

    @classmethod
    def of(cls, form: Form, noise: Noise, priors: Mapping[str, Prior]) -> Space:
        """The space of a model in its identifiable form, with priors by name; of the noise as `noise.sigma`."""
        model_box = form.box
        box = with_noise(model_box, noise)
        names = tuple(box.names[index] for index in box.free)
        for name in priors:
            if name not in box.names:
                raise UnknownNameError(
                    f"a prior was given for {name!r}; {form.spec.name} is sampled in {', '.join(names)}"
                )
            if name not in names:
                raise SettingError(
                    f"a prior was given for {name}, which is held fixed; leave one of the two out"
                )
        pair = tuple(box.free.index(index) for index in form.mirrored)
        return cls(
            box=box,
            n_params=len(model_box.names),
            pair=(pair[0], pair[1]) if pair else None,
            priors=tuple(priors.get(name) for name in names),
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, one for each coordinate."""
        return tuple(self.box.names[index] for index in self.box.free)

    @property
    def n_dim(self) -> int:
        """Number of coordinates: the free parameters of the model and of the noise."""
        return len(self.box.free)

    def values(self, position: AnyArray) -> tuple[AnyArray, AnyArray]:
        """Parameters and noise parameters, (..., n_all), undefined outside the box, and whether they lie in it."""
        xp = position.__array_namespace__()
        unit = self._unit(position)
        # x0 is undefined for zero stiffness: `unit` is then NaN, hence not inside.
        inside = xp.all((unit >= -_OFF_FACE) & (unit <= 1.0 + _OFF_FACE), axis=-1)
        return self.box.theta_from_unit(xp.clip(xp.where(inside[..., None], unit, 0.5), 0.0, 1.0)), inside

    def position(self, values: AnyArray) -> AnyArray:
        """Position, shape (..., n_dim), of parameters and noise parameters, shape (..., n_all); inverse of `values`."""
        unit = self.box.unit_from_theta(values)
        if self.pair is None:
            return unit
        xp = values.__array_namespace__()
        product = values[..., self._of_box(0)] * values[..., self._of_box(1)] / self._product_span
        return xp.stack(
            [product if index == self.pair[1] else unit[..., index] for index in range(self.n_dim)], axis=-1
        )

    def reflect(self, position: AnyArray) -> AnyArray:
        """Positions reflected at the faces of the box; the product k x0 has no faces of its own."""
        folded = np.abs(position)
        folded = np.where(folded > 1.0, 2.0 - folded, folded)
        if self.pair is not None:
            folded[:, self.pair[1]] = position[:, self.pair[1]]
        return folded

    def slope(self, values: AnyArray) -> AnyArray:
        """Derivative of the free parameters with respect to their coordinates, (n_free, n_free), at values (n,)."""
        free = [index for index in self.box.free if index < self.n_params]
        lower, upper = np.array(self.box.lower)[free], np.array(self.box.upper)[free]
        log = np.array(self.box.log)[free]
        ratio = np.where(log, upper, 1.0) / np.where(log, lower, 1.0)
        slope = np.diag(np.where(log, values[free] * np.log(ratio), upper - lower))
        if self.pair is not None:
            of_k, of_product = self.pair
            stiffness, x0 = values[self._of_box(0)], values[self._of_box(1)]
            slope[of_product, of_product] = self._product_span / stiffness
            slope[of_product, of_k] = -x0 / stiffness * slope[of_k, of_k]
        return slope

    def log_prior(self, values: AnyArray) -> AnyArray:
        """Log prior density of values in the box, shape (...), with respect to the position."""
        xp = values.__array_namespace__()
        total = xp.zeros(values.shape[:-1])
        for prior, index in zip(self.priors, self.box.free, strict=True):
            if prior is not None:
                value = values[..., index]
                lower, upper = self.box.lower[index], self.box.upper[index]
                slope = (
                    xp.log(value * np.log(upper / lower)) if self.box.log[index] else np.log(upper - lower)
                )
                total = total + prior.log_density(value) + slope
        if self.pair is not None and self.priors[self.pair[1]] is not None:
            # Change of variables from x0 to k x0.
            total = total - xp.log(xp.abs(values[..., self._of_box(0)]) / self._largest_stiffness)
        return total

    def _unit(self, position: AnyArray) -> AnyArray:
        if self.pair is None:
            return position
        xp = position.__array_namespace__()
        k_index, x0_index = self._of_box(0), self._of_box(1)
        lower, upper = self.box.lower[k_index], self.box.upper[k_index]
        stiffness = lower + (upper - lower) * position[..., self.pair[0]]
        safe = xp.where(stiffness == 0.0, xp.nan, stiffness)
        x0 = position[..., self.pair[1]] * self._product_span / safe
        lower, upper = self.box.lower[x0_index], self.box.upper[x0_index]
        unit = (x0 - lower) / (upper - lower)
        return xp.stack(
            [unit if index == self.pair[1] else position[..., index] for index in range(self.n_dim)], axis=-1
        )

    def _of_box(self, which: int) -> int:
        """Index in the box of k (which=0) or x0 (which=1); 0 where the model has no such pair."""
        return self.box.free[self.pair[which]] if self.pair is not None else 0

    @property
    def _largest_stiffness(self) -> float:
        index = self._of_box(0)
        return max(abs(self.box.lower[index]), abs(self.box.upper[index]))

    @property
    def _product_span(self) -> float:
        """Width of the range of k x0 in the box [N]."""
        index = self._of_box(1)
        return 2.0 * self._largest_stiffness * max(abs(self.box.lower[index]), abs(self.box.upper[index]))


Tempering = Literal["effective"] | Annotated[float, Within(above=0.0, most=1.0)]
Walkers = Annotated[int, Within(least=2, most=10_000)]
Steps = Annotated[int, Within(least=1, most=10_000_000)]

# Largest number of force histories in memory.
_ROWS = 64


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Target(Summarised):
    """Log posterior density of positions of a `space`, up to a constant, with the log-likelihood times `temper`.

    Residuals are of a free run, in units of the standard deviation of each test's force, `deviations` [N];
    effects of each test take their least-squares values for each candidate. `start`, shape (n_params,), is the fit in
    the form that is sampled.
    """

    _made_by: ClassVar[str] = "mr.sample(fit, test)"

    _units: ClassVar[Mapping[str, str]] = {"deviations": "N"}

    form: Form
    objective: Objective
    noise: Noise
    space: Space
    start: Floats
    deviations: tuple[float, ...]
    temper: float

    @classmethod
    def of_fit(
        cls,
        fit: Fit,
        tests: tuple[DamperTest, ...],
        noise: Noise,
        *,
        tempering: Tempering | None,
        priors: Mapping[str, Prior] | None = None,
        threads: int = 0,
    ) -> Target:
        """The posterior of a fit's family on tests, with tempering from the residuals of the fit, see `sample`.

        Residuals of real tests are mostly model error with a lag-1 autocorrelation of 0.9 and more: 2000 count as some
        tens of independent observations, and intervals would be far too narrow if all were counted.
        """
        problem = Problem.of_fit(fit, tests, threads=threads).freeing(fit.varied_effects)
        form, objective = problem.form, problem.objective
        target = cls(
            form=form,
            objective=objective,
            noise=noise,
            space=Space.of(form, noise, priors or {}),
            start=problem.inside(fit.varied_values),
            deviations=tuple(test.deviation for test in objective.compared),
            temper=1.0,
        )
        if tempering is None:
            tempering = 1.0 if noise.correlated else "effective"
        if tempering == "effective":
            residuals = [residual[0] for residual, _ in target.residuals(target.start[None])]
            share = effective_samples(residuals) / objective.n_time
        else:
            share = float(tempering)
            if not 0.0 < share <= 1.0:
                raise SettingError(f"`tempering` is {share:g}; give 'effective', or a share above 0 up to 1")
        return replace(target, temper=share)

    def __call__(self, position: Floats) -> Floats:
        """Log posterior of each row of `position` (n_batch, n_dim), shape (n_batch,); -inf outside and on failure."""
        values, inside = self.space.values(position)
        density = np.full(len(position), -np.inf)
        rows = np.flatnonzero(inside)
        if rows.size:
            within = values if rows.size == len(values) else values[rows]
            density[rows] = self.space.log_prior(within) + self.temper * self.log_likelihood(within)
        return density

    def log_likelihood(self, values: Floats) -> Floats:
        """Untempered log-likelihood of parameters and noise, shape (n_batch,); -inf where a simulation failed."""
        n_params = self.space.n_params
        theta, noise = np.ascontiguousarray(values[:, :n_params]), values[:, n_params:]
        if isinstance(self.noise, Iid):
            counts = np.array([test.measured.size for test in self.objective.compared])
            squared = self.objective.squared_nrmse(theta) @ counts
            return self.noise.log_likelihood_of_sum(squared, self.objective.n_time, noise)
        total = np.zeros(len(theta))
        for first in range(0, len(theta), _ROWS):
            rows = slice(first, first + _ROWS)
            for residual, failed in self.residuals(theta[rows]):
                total[rows] += self.noise.log_densities(residual, noise[rows]).sum(axis=1)
                total[rows][failed] = -np.inf
        return total

    def residuals(self, theta: Floats) -> Iterator[tuple[Floats, NDArray[np.bool_]]]:
        """Residuals of each test in deviations, (n_batch, n_counted), and rows that failed, of zeros."""
        objective = self.objective
        objective.tally.simulations += len(theta)
        for test, deviation in zip(objective.compared, self.deviations, strict=True):
            residual, failed = test.residuals(theta, threads=objective.threads)
            residual /= deviation
            residual[failed] = 0.0
            yield residual, failed

    def position_of(self, theta: Floats) -> Floats:
        """Position (n_dim,) of parameters (n_params,), clipped to the box, with the mean noise of all residuals."""
        runs = self.residuals(theta[None])
        noise = np.mean([self.noise.estimate(residual[0]) for residual, _ in runs], axis=0)
        values = np.concatenate([theta, noise])
        return np.asarray(self.space.position(self.space.box.inside(values)))
