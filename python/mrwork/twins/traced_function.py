"""Functions of a point for JAX: coordinates of the point, its parameters, and arrays as operands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Self

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mrwork.base.numbers import format_rounded
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box, Coordinates, OfPoints
from mrwork.errors import SettingError
from mrwork.twins.model_twins import evaluate_on_processor

_OUTSIDE_BOX = 1e-12


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["data"],
    meta_fields=["title", "compute", "box", "units", "coordinates", "start", "held"],
)
# JAX keeps functions by weak references, and ends the process where an object allows none.
@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False, weakref_slot=True)
class TracedFunction(OfPoints, Summarised):
    """A function of a point, shape (n_free,), for JAX; of many, (..., n_free), it has so many values.

    A point gives the parameters `names`, or, with the coordinates "unit" or "latent", their places between the bounds,
    as in `mr.objective`. `start` is one; `held` says what a point does not decide. It is a pytree, whose leaves `data`
    are records, measured forces and weights; given as a second argument, they are operands of a compiled program and
    not constants in it.
    """

    title: str
    compute: Callable[[Array, Any], Array]
    box: Box
    units: tuple[str, ...]
    coordinates: Coordinates
    start: tuple[float, ...]
    held: str
    data: Any

    @classmethod
    def of(
        cls,
        title: str,
        compute: Callable[[Array, Any], Array],
        *,
        box: Box,
        units: tuple[str, ...],
        coordinates: Coordinates,
        start: Floats,
        data: Any,
        held: str = "",
    ) -> Self:
        """The function `compute` of all parameters and `data`, with these parameters, (n_params,), as its start."""
        fixed = sorted({*range(len(box.names))} - {*box.free})
        return cls(
            title=title,
            compute=compute,
            box=box,
            units=units,
            coordinates=coordinates,
            start=tuple(box.points_inside(start, coordinates).tolist()),
            held=held
            or ", ".join(f"{box.names[index]} {format_rounded(box.lower[index])}" for index in fixed),
            data=data,
        )

    def __call__(self, point: Any, data: Any = None) -> Array:
        """Value at a point, with these `data` in place of the data of the function, if given."""
        return self._value(self.compute, point, self.data if data is None else data)

    def parameters(self, point: Any) -> Array:
        """All parameters at a point, as the function takes them."""
        return self._value(_parameters, point, None)

    def _value(self, compute: Callable[[Array, Any], Array], point: Any, data: Any) -> Array:
        evaluate: Callable[[Array, Any], Array] = partial(_evaluate, compute, self.box, self.coordinates)
        return evaluate_on_processor(evaluate, self._checked(point), data)

    def _checked(self, point: Any) -> Array:
        array = point if isinstance(point, Array) else np.asarray(point)
        if array.dtype.kind not in "iuf":
            raise SettingError(f"the point is {type(point).__name__}; give ({len(self.names)},) numbers")
        values: Array = jnp.asarray(array, dtype=jnp.float64 if array.dtype.kind in "iu" else None)
        if values.dtype != jnp.float64:
            raise SettingError(
                f"the point has the data type {values.dtype}, and mr.jax takes float64, because derivatives of a "
                "simulation are wrong in 32 bits; make arrays after the first use of `mr.jax`, or call "
                "jax.config.update('jax_enable_x64', True) before"
            )
        if not values.ndim or values.shape[-1] != len(self.names):
            raise SettingError(
                f"the point has shape {values.shape}; give ({len(self.names)},): {list_names(self.names, 20)}"
            )
        return values

    def _summary(self) -> Summary:
        return Summary(
            title=f"{self.title}, for JAX",
            facts=(("coordinates", self.coordinates), ("held", self.held)),
            tables=[self._table(self.units, self.start)],
        )


def _parameters(theta: Array, _: Any) -> Array:
    return theta


@partial(jax.jit, static_argnums=(0, 1, 2))
def _evaluate(
    compute: Callable[[Array, Any], Array], box: Box, coordinates: Coordinates, points: Array, data: Any
) -> Array:
    def value(point: Array) -> Array:
        # What is no candidate fails, with derivatives of zero.
        none = jnp.isnan(point)
        if coordinates == "unit":
            none |= (point < -_OUTSIDE_BOX) | (point > 1.0 + _OUTSIDE_BOX)
        theta = box.theta_from(jnp.where(none, 0.5, point), coordinates)
        return compute(jnp.where(jnp.any(none), jnp.nan, theta), data)

    for _ in range(points.ndim - 1):
        value = jax.vmap(value)
    return value(points)
