"""The three coordinates of a parameter vector and the maps between them.

`theta` is physical, `unit` is in [0, 1]^n for search, `latent` in R^n for gradients. The maps use the array API, so
that they accept NumPy and JAX arrays; the last axis is the parameter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from math import isfinite
from typing import Any, ClassVar, Literal

import numpy as np

from mrwork.base.arguments import AnyArray, AnyNumbers, checked
from mrwork.base.keys import check_known
from mrwork.base.numbers import format_rounded
from mrwork.base.table import Table
from mrwork.base.values import Floats
from mrwork.dampers.dependence import Array
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError

Coordinates = Literal["theta", "unit", "latent"]
"""How a point gives the free parameters: their values, their shares of the range, or the logits of these."""

# A parameter closer to a bound than this share of its range is on the bound.
ON_BOUND = 1e-4
# Ends of a logarithmic range that are closer may have equal logarithms: the parameter is fixed.
_LEAST_RATIO = 1.0 + 1e-14


@checked
class Box:
    """A range for each parameter; `theta` has all parameters of the model, `unit` and `latent` the free ones only.

    Equal bounds fix a parameter.
    """

    _made_by: ClassVar[str] = "mr.Box.of(spec)"

    names: tuple[str, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    log: tuple[bool, ...]

    @classmethod
    @checked
    def of(cls, spec: DamperSpec) -> Box:
        """The box of the admissible ranges of a model; no parameter is fixed."""
        return cls(
            names=spec.names,
            lower=tuple(parameter.lower for parameter in spec.parameters),
            upper=tuple(parameter.upper for parameter in spec.parameters),
            log=tuple(parameter.scale == "log" for parameter in spec.parameters),
        )

    @property
    def free(self) -> tuple[int, ...]:
        """Indices of the parameters that are not fixed."""
        ranges = zip(self.lower, self.upper, self.log, strict=True)
        return tuple(
            index
            for index, (lower, upper, log) in enumerate(ranges)
            if upper > (lower * _LEAST_RATIO if log else lower)
        )

    @property
    def free_names(self) -> tuple[str, ...]:
        """Names of the parameters that are not fixed."""
        return tuple(self.names[index] for index in self.free)

    @checked
    def with_bounds(self, bounds: Mapping[str, tuple[float, float]]) -> Box:
        """Return the box with some ranges replaced; equal bounds fix a parameter."""
        lower, upper = list(self.lower), list(self.upper)
        for name, (low, high) in bounds.items():
            sentence = f"no parameter is called {name!r}"
            check_known(name, self.names, sentence, otherwise="this model has", kind=SettingError)
            index = self.names.index(name)
            if not (isfinite(low) and isfinite(high)):
                raise SettingError(f"bounds of {name} are {low:g} and {high:g}; both must be finite numbers")
            if low > high:
                raise SettingError(
                    f"bounds of {name} are reversed, {low:g} is above {high:g}; give the lower bound first"
                )
            if low < self.lower[index] or high > self.upper[index]:
                raise SettingError(
                    f"bounds of {name} run from {low:g} to {high:g}, the model admits "
                    f"{self.lower[index]:g} to {self.upper[index]:g}; stay inside"
                )
            lower[index], upper[index] = low, high
        return replace(self, lower=tuple(lower), upper=tuple(upper))

    def _check(self, name: str, values: Array, n_columns: int) -> None:
        if values.ndim < 1 or values.shape[-1] != n_columns:
            raise SettingError(
                f"`{name}` has shape {values.shape}; give shape (..., {n_columns}): the box has "
                f"{len(self.names)} parameters, {len(self.free)} of them free"
            )

    def _spread(self, xp: Any) -> tuple[Array, Array, Array]:
        """Start, span and log mask of the free parameters, on their own scale (linear or logarithmic)."""
        index = list(self.free)
        log = np.array(self.log)[index]
        lower, upper = np.array(self.lower)[index], np.array(self.upper)[index]
        start = np.where(log, np.log(np.where(log, lower, 1.0)), lower)
        end = np.where(log, np.log(np.where(log, upper, 1.0)), upper)
        return xp.asarray(start), xp.asarray(end - start), xp.asarray(log)

    @checked
    def theta_from_unit(self, unit: AnyArray) -> Array:
        """Physical parameters, shape (..., n_params), from unit coordinates, shape (..., n_free)."""
        self._check("unit", unit, len(self.free))
        xp = unit.__array_namespace__()
        start, span, log = self._spread(xp)
        spread = start + span * unit
        value = xp.where(log, xp.exp(xp.where(log, spread, 0.0)), spread)
        # exp(log(...)) may leave the box by rounding.
        within = xp.clip(value, *(self._free_of(xp.asarray(bounds)) for bounds in (self.lower, self.upper)))
        if not isinstance(value, np.ndarray):
            # The limit takes no derivatives away on a face. Imported by name, because JAX is seldom needed.
            lax: Any = import_module("jax.lax")
            within = value + lax.stop_gradient(within - value)
        return self._with_held(within)

    def _free_of(self, theta: Array) -> Array:
        return theta[..., np.array(self.free, dtype=int)]

    def _with_held(self, value: Array) -> Array:
        """All parameters, shape (..., n_params), from the free ones, shape (..., n_free)."""
        if len(self.free) == len(self.names):
            return value
        xp = value.__array_namespace__()
        columns = [xp.full(value.shape[:-1], lower) for lower in self.lower]
        for column, index in enumerate(self.free):
            columns[index] = value[..., column]
        return xp.stack(columns, axis=-1)

    @checked
    def theta_from(self, points: AnyArray, coordinates: Coordinates) -> Array:
        """Physical parameters, shape (..., n_params), from points in these coordinates, shape (..., n_free)."""
        if coordinates == "theta":
            self._check("theta", points, len(self.free))
            return self._with_held(points)
        return self.theta_from_unit(points) if coordinates == "unit" else self.theta_from_latent(points)

    @checked
    def points_from(self, theta: AnyArray, coordinates: Coordinates) -> Array:
        """Points in these coordinates, shape (..., n_free), from physical parameters, shape (..., n_params)."""
        if coordinates == "theta":
            return self._free_of(theta)
        return self.unit_from_theta(theta) if coordinates == "unit" else self.latent_from_theta(theta)

    @checked
    def points_inside(self, theta: AnyNumbers, coordinates: Coordinates) -> Floats:
        """Finite points, shape (..., n_free), of parameters (..., n_params) that are moved between their bounds."""
        theta = self.inside(theta) if coordinates == "latent" else np.clip(theta, self.lower, self.upper)
        return np.asarray(np.clip(self.points_from(theta, coordinates), *self.ends(coordinates)))

    @checked
    def ends(self, coordinates: Coordinates) -> tuple[Floats, Floats]:
        """Lower and upper bound of every coordinate, each of shape (n_free,)."""
        lower, upper = (self.points_from(np.array(ends), coordinates) for ends in (self.lower, self.upper))
        return lower, upper

    @checked
    def slope_from(self, theta: AnyArray, coordinates: Coordinates) -> Array:
        """Derivative of each free parameter by its coordinate, shape (..., n_free), at `theta`, (..., n_params)."""
        slope = self.unit_slope(theta)
        if coordinates == "theta":
            return slope.__array_namespace__().ones_like(slope)
        unit = self.unit_from_theta(theta)
        return slope if coordinates == "unit" else slope * unit * (1.0 - unit)

    @checked
    def unit_slope(self, theta: AnyArray) -> Array:
        """Derivative of each free parameter by its unit coordinate, (..., n_free), at `theta`, (..., n_params)."""
        self._check("theta", theta, len(self.names))
        xp = theta.__array_namespace__()
        _, span, log = self._spread(xp)
        return span * xp.where(log, self._free_of(theta), 1.0)

    @checked
    def unit_from_theta(self, theta: AnyArray) -> Array:
        """Unit coordinates, shape (..., n_free), from physical parameters, shape (..., n_params)."""
        self._check("theta", theta, len(self.names))
        xp = theta.__array_namespace__()
        start, span, log = self._spread(xp)
        value = self._free_of(theta)
        positive = xp.where(log, value, 1.0)
        if isinstance(theta, np.ndarray) and not (positive > 0.0).all():
            wrong = np.argwhere(~(positive > 0.0))[0]
            raise SettingError(
                f"`theta` has {value[tuple(wrong)]:g} for {self.names[self.free[wrong[-1]]]}, whose scale is "
                "logarithmic; give a positive number"
            )
        spread = xp.where(log, xp.log(positive), value)
        return (spread - start) / span

    @checked
    def theta_from_latent(self, latent: AnyArray) -> Array:
        """Physical parameters, shape (..., n_params), from latent coordinates, shape (..., n_free)."""
        xp = latent.__array_namespace__()
        return self.theta_from_unit(0.5 * (1.0 + xp.tanh(0.5 * latent)))

    @checked
    def latent_from_theta(self, theta: AnyArray) -> Array:
        """Logits of the unit coordinates, (..., n_free), of parameters, (..., n_params); infinite on faces."""
        unit = self.unit_from_theta(theta)
        xp = unit.__array_namespace__()
        with np.errstate(divide="ignore", invalid="ignore"):
            return xp.log(unit) - xp.log1p(-unit)

    @checked
    def inside(self, theta: AnyArray) -> Array:
        """Move parameters into the box and off its faces, where the latent coordinate is infinite."""
        self._check("theta", theta, len(self.names))
        xp = theta.__array_namespace__()
        theta = xp.clip(theta, xp.asarray(self.lower), xp.asarray(self.upper))
        return self.theta_from_unit(xp.clip(self.unit_from_theta(theta), 1e-6, 1.0 - 1e-6))

    @checked
    def log_slope(self, latent: AnyArray) -> Array:
        """Logarithm of d theta / d latent of each free parameter, shape (..., n_free)."""
        xp = latent.__array_namespace__()
        _, span, log = self._spread(xp)
        theta = self._free_of(self.theta_from_latent(latent))
        # d unit / d latent = unit (1 - unit), written so that neither factor underflows.
        logistic = -xp.abs(latent) - 2.0 * xp.log1p(xp.exp(-xp.abs(latent)))
        return logistic + xp.log(span) + xp.where(log, xp.log(xp.where(log, theta, 1.0)), 0.0)


def bound_at(box: Box, index: int, value: float, near: float = ON_BOUND) -> Literal["", "lower", "upper"]:
    """The bound that is within a share `near` of the range of a value of the box; empty where none is."""
    lower, upper = box.lower[index], box.upper[index]
    if box.log[index]:
        lower, upper, value = np.log(lower), np.log(upper), np.log(value)
    unit = (value - lower) / (upper - lower)
    return "lower" if unit <= near else "upper" if unit >= 1.0 - near else ""


class OfPoints:
    """What a result has that is a function of points that give the free parameters of a box in some coordinates."""

    __slots__ = ()
    box: Box
    coordinates: Coordinates

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters."""
        return self.box.free_names

    @property
    def lower(self) -> Floats:
        """Lower bound of every coordinate, shape (n_free,)."""
        return self.box.ends(self.coordinates)[0]

    @property
    def upper(self) -> Floats:
        """Upper bound of every coordinate, shape (n_free,)."""
        return self.box.ends(self.coordinates)[1]

    def _table(self, units: Sequence[str], start: Sequence[float]) -> Table:
        """Each free parameter with its coordinate at the start, between its bounds."""
        numbers = (start, self.lower.tolist(), self.upper.tolist())
        rows = zip(self.names, *(map(format_rounded, column) for column in numbers), units, strict=True)
        return Table(columns=("parameter", "start", "lower", "upper", "unit"), rows=[*rows])
