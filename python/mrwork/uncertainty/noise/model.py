"""What a noise model is, and what all of them use."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from importlib import import_module
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

NoiseName = Literal["iid", "student_t", "ar1", "arma11", "amplitude"]

Array = NDArray[np.float64]

LOG_2_PI = float(np.log(2.0 * np.pi))


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseParameter:
    """One number of a noise model: its range, and whether it is spread evenly in its logarithm."""

    name: str
    lower: float
    upper: float
    log: bool
    description: str


SIGMA = NoiseParameter(
    name="sigma",
    lower=1e-5,
    upper=10.0,
    log=True,
    description="standard deviation, per deviation of the force",
)


class Noise(ABC):
    """A noise model. Batches are rows: residual and force (n_batch, n_time), noise parameters (n_batch, n_noise).

    `correlated` noise depends on the residuals before: its likelihood counts the samples for what they are worth. The
    density of `differentiable` noise is written on the array API and takes JAX arrays as well.
    """

    name: ClassVar[NoiseName]
    title: ClassVar[str]
    parameters: ClassVar[tuple[NoiseParameter, ...]]
    correlated: ClassVar[bool] = False
    differentiable: ClassVar[bool] = True

    def log_densities(self, residual: Array, force: Array, noise: Array) -> Array:
        """Log density of each sample given those before it, shape (n_batch, n_time); a row's sum is its log-likelihood.

        Parameters
        ----------
        residual
            Model less measured force, in deviations of the test's force.
        force
            Force of the model about the mean of the measured one, in the same unit.
        """
        return self._log_densities(residual, force, noise)

    def draw(self, force: Array, noise: Array, rng: np.random.Generator) -> Array:
        """Noise to add to a force of the model, shape (n_batch, n_time)."""
        return self._draw(force, noise, rng)

    def estimate(self, residual: Array, force: Array) -> Array:
        """Noise parameters from the residuals of a fit, (n_time,), by their moments, shape (n_noise,)."""
        lower, upper = np.array([(each.lower, each.upper) for each in self.parameters]).T
        return np.clip(self._estimate(residual, force), lower, upper)

    @abstractmethod
    def _log_densities(self, residual: Array, force: Array, noise: Array) -> Array: ...

    @abstractmethod
    def _draw(self, force: Array, noise: Array, rng: np.random.Generator) -> Array: ...

    @abstractmethod
    def _estimate(self, residual: Array, force: Array) -> Array: ...


def gaussian(residual: Array, deviation: Array) -> Array:
    """Log density of a normal residual of this deviation."""
    xp = deviation.__array_namespace__()
    result: Array = -0.5 * (residual / deviation) ** 2 - xp.log(deviation) - 0.5 * LOG_2_PI
    return result


def log_gamma(values: Array) -> Array:
    """Logarithm of the gamma function, for arrays of NumPy or JAX: the array API has none."""
    of_numpy = values.__array_namespace__() is np
    # By name, for both are slow to load, and JAX is not to be needed.
    special: Any = import_module("scipy.special" if of_numpy else "jax.scipy.special")
    result: Array = special.gammaln(values)
    return result


def rms(residual: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(residual**2)))
