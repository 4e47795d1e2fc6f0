"""The coordinates in which a posterior is sampled: parameters and noise together, each on a range of about one.

A coordinate runs over [0, 1] as its parameter does over its box, evenly on the scale of the parameter. One pair is
different: of a force k (x - x0) the data see the stiffness k and the product k x0, an offset of the force. Where k may
be zero, x0 alone runs away on a hyperbola that no sampler follows, and a prior that is even in x0 over metres would
draw k to zero. There the product takes the place of x0, and where nothing else is given the prior is even in it.
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
# A parameter on a face of its box is inside, whatever the last bits of its logarithm.
_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Space:
    """Positions, shape (..., n_dim), of the free parameters and the noise parameters of a `box` over both.

    `pair` holds the coordinates of k and x0, where the second is the product instead. `priors` are by coordinate.
    """

    box: Box
    n_params: int
    pair: tuple[int, int] | None
    priors: tuple[Prior | None, ...]

    @classmethod
    def of(cls, form: Form, noise: Noise, priors: Mapping[str, Prior]) -> Space:
        """The space of a model in its identifiable form, with the priors given by name; `noise.sigma` is the noise's.

        Raises
        ------
        UnknownNameError
            Where a prior is of a parameter that there is not.
        SettingError
            Where it is of one that is held fixed.
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
        """Names of the parameters behind the coordinates."""
        return tuple(self.box.names[index] for index in self.box.free)

    @property
    def n_dim(self) -> int:
        """Number of coordinates."""
        return len(self.box.free)

    def values(self, position: Array) -> tuple[Array, Array]:
        """Parameters and noise parameters, shape (..., n_params + n_noise), and whether they lie in the box, (...).

        The values of a position outside mean nothing.
        """
        xp = position.__array_namespace__()
        unit = self._unit(position)
        # Without stiffness there is no x0 with a product: then `unit` is not a number, and not inside.
        inside = xp.all((unit >= -_ROUNDING) & (unit <= 1.0 + _ROUNDING), axis=-1)
        return self.box.theta_from_unit(xp.clip(xp.where(inside[..., None], unit, 0.5), 0.0, 1.0)), inside

    def position(self, values: Array) -> Array:
        """The position of values, shape (..., n_dim)."""
        unit = self.box.unit_from_theta(values)
        if self.pair is None:
            return unit
        xp = values.__array_namespace__()
        product = values[..., self._of_box(0)] * values[..., self._of_box(1)] / self._product_span
        return xp.stack(
            [product if index == self.pair[1] else unit[..., index] for index in range(self.n_dim)], axis=-1
        )

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
        """Log prior density of values inside, shape (...), per volume of the position."""
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
            # A density of x0 is one of the product once it is divided by |k|.
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
        """Index in the box of k (0) or x0 (1)."""
        return self.box.free[self.pair[which]] if self.pair is not None else 0

    @property
    def _largest_stiffness(self) -> float:
        index = self._of_box(0)
        return max(abs(self.box.lower[index]), abs(self.box.upper[index]))

    @property
    def _product_span(self) -> float:
        """Width of the products k x0 that the box admits [N]."""
        index = self._of_box(1)
        return 2.0 * self._largest_stiffness * max(abs(self.box.lower[index]), abs(self.box.upper[index]))
