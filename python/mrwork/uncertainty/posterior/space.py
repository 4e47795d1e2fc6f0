"""Coordinates in which a posterior is sampled: parameters and noise parameters together, each of range about 1.

A coordinate runs over [0, 1] as its parameter runs over its bounds, on the scale of the parameter. One pair is
different: of a spring force k (x - x0) the data determine the stiffness k and the product k x0, an offset of the force.
Where k may be zero, the posterior of x0 follows a hyperbola that samplers cannot explore, and a prior that is uniform
in x0 over metres would favour k = 0. There k x0 is the coordinate in place of x0, with a uniform prior by default.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mrwork.dampers.coordinates import Box
from mrwork.errors import SettingError, UnknownNameError
from mrwork.identification.equivalent import Form
from mrwork.uncertainty.noise import Noise
from mrwork.uncertainty.posterior.prior import Prior

# NumPy or JAX, as in `coordinates`.
Array = Any

NOISE = "noise."
# Tolerance for parameters on a face of the box, whose logarithm is rounded.
_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Space:
    """Positions, shape (..., n_dim), of the free parameters and the noise parameters of a `box` over both.

    `pair` holds the coordinates of k and of k x0, `None` where x0 is its own coordinate. `priors` are by coordinate,
    `None` where uniform.
    """

    box: Box
    n_params: int
    pair: tuple[int, int] | None
    priors: tuple[Prior | None, ...]

    @classmethod
    def of(cls, form: Form, noise: Noise, priors: Mapping[str, Prior]) -> Space:
        """The space of a model in its identifiable form, with priors by name; those of the noise as `noise.sigma`.

        Raises
        ------
        UnknownNameError
            Where a prior names an unknown parameter.
        SettingError
            Where a prior names a parameter that is held fixed.
        """
        own = form.box
        box = Box(
            names=own.names + tuple(NOISE + each.name for each in noise.parameters),
            lower=own.lower + tuple(each.lower for each in noise.parameters),
            upper=own.upper + tuple(each.upper for each in noise.parameters),
            log=own.log + tuple(each.log for each in noise.parameters),
        )
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
            n_params=len(own.names),
            pair=(pair[0], pair[1]) if pair else None,
            priors=tuple(priors.get(name) for name in names),
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, one for each coordinate."""
        return tuple(self.box.names[index] for index in self.box.free)

    @property
    def n_dim(self) -> int:
        """Number of coordinates."""
        return len(self.box.free)

    def values(self, position: Array) -> tuple[Array, Array]:
        """Parameters and noise parameters, shape (..., n_params + n_noise), and whether they lie in the box, (...).

        The values of a position outside the box are undefined.
        """
        xp = position.__array_namespace__()
        unit = self._unit(position)
        # x0 is undefined for zero stiffness: `unit` is then NaN, hence not inside.
        inside = xp.all((unit >= -_ROUNDING) & (unit <= 1.0 + _ROUNDING), axis=-1)
        return self.box.theta_from_unit(xp.clip(xp.where(inside[..., None], unit, 0.5), 0.0, 1.0)), inside

    def position(self, values: Array) -> Array:
        """Position of values, shape (..., n_dim)."""
        unit = self.box.unit_from_theta(values)
        if self.pair is None:
            return unit
        xp = values.__array_namespace__()
        product = values[..., self._of_box(0)] * values[..., self._of_box(1)] / self._product_span
        return xp.stack(
            [product if index == self.pair[1] else unit[..., index] for index in range(self.n_dim)], axis=-1
        )

    def reflected(self, position: Array) -> Array:
        """Positions reflected at the faces of the box; the product k x0 has no faces of its own."""
        folded = np.abs(position)
        folded = np.where(folded > 1.0, 2.0 - folded, folded)
        if self.pair is not None:
            folded[:, self.pair[1]] = position[:, self.pair[1]]
        return folded

    def slope(self, values: Array) -> Array:
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

    def log_prior(self, values: Array) -> Array:
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

    def _unit(self, position: Array) -> Array:
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
        """Index in the box of k (which=0) or x0 (which=1)."""
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
