"""Noise models: probability densities of the residuals between measured force and model.

Residuals and noise are in units of the standard deviation of a test's measured force, so that tests of different
strength share one set of noise parameters. On real tests the residuals are mostly model error, which repeats from cycle
to cycle: a noise model says little about the errors on another excitation, for which bands are calibrated.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mrwork.base.arguments import Count, checked
from mrwork.base.keys import look_up
from mrwork.base.values import Floats

_LOG_2_PI = float(np.log(2.0 * np.pi))


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseParameter:
    """Parameter of a noise model: its range, and whether its default prior is uniform in the logarithm."""

    name: str
    lower: float
    upper: float
    log: bool
    description: str


_SIGMA = NoiseParameter(
    name="sigma",
    lower=1e-5,
    upper=10.0,
    log=True,
    description="standard deviation, per deviation of the force",
)


class Noise(ABC):
    """A noise model for batches: residuals (n_batch, n_time), noise parameters (n_batch, n_noise).

    The likelihood of `correlated` noise, conditional on earlier residuals, needs no tempering.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    parameters: ClassVar[tuple[NoiseParameter, ...]]
    correlated: ClassVar[bool]

    @abstractmethod
    def log_densities(self, residual: Floats, noise: Floats) -> Floats:
        """Log density of each sample given the earlier ones, (n_batch, n_time); arrays of NumPy or JAX."""

    @abstractmethod
    def draw(self, n_time: Count, noise: Floats, rng: np.random.Generator) -> Floats:
        """Noise for parameters (n_batch, n_noise), shape (n_batch, n_time)."""

    def estimate(self, residual: Floats) -> Floats:
        """Moment estimates of the noise parameters, shape (n_noise,), from the residuals of a fit, (n_time,)."""
        lower, upper = np.array([(parameter.lower, parameter.upper) for parameter in self.parameters]).T
        return np.clip(self._estimate(residual), lower, upper)

    @abstractmethod
    def _estimate(self, residual: Floats) -> Floats: ...


def _gaussian(residual: Floats, deviation: Floats) -> Floats:
    xp = deviation.__array_namespace__()
    result: Floats = -0.5 * (residual / deviation) ** 2 - xp.log(deviation) - 0.5 * _LOG_2_PI
    return result


def _rms(residual: Floats) -> float:
    return float(np.sqrt(np.mean(residual**2)))


class Iid(Noise):
    """Independent Gaussian noise of constant variance."""

    name = "iid"
    title = "independent Gaussian"
    parameters = (_SIGMA,)
    correlated = False

    def log_densities(self, residual: Floats, noise: Floats) -> Floats:
        """Log density of each sample, (n_batch, n_time)."""
        return _gaussian(residual, noise[:, :1])

    def log_likelihood_of_sum(self, squared: Floats, n_time: int, noise: Floats) -> Floats:
        """Log-likelihood from sums of squared residuals, shape (n_batch,)."""
        sigma = noise[:, 0]
        # What is no deviation has no likelihood.
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            return np.asarray(-0.5 * squared / sigma**2 - n_time * (np.log(sigma) + 0.5 * _LOG_2_PI))

    @checked
    def draw(self, n_time: Count, noise: Floats, rng: np.random.Generator) -> Floats:
        """White noise, shape (n_batch, n_time)."""
        return np.asarray(noise[:, :1] * rng.standard_normal((len(noise), n_time)))

    def _estimate(self, residual: Floats) -> Floats:
        return np.array([_rms(residual)])


class Ar1(Noise):
    """First-order autoregressive noise r_t = phi r_(t-1) + e_t; `sigma` is the standard deviation of r, not of e."""

    name = "ar1"
    title = "AR(1)"
    parameters = (
        _SIGMA,
        NoiseParameter(
            name="phi", lower=-0.99999, upper=0.99999, log=False, description="autoregressive coefficient"
        ),
    )
    correlated = True

    def log_densities(self, residual: Floats, noise: Floats) -> Floats:
        """Log density of each sample given the one before, (n_batch, n_time)."""
        xp = residual.__array_namespace__()
        sigma, phi = noise[:, :1], noise[:, 1:2]
        first = _gaussian(residual[:, :1], sigma)
        innovation = residual[:, 1:] - phi * residual[:, :-1]
        result: Floats = xp.concat([first, _gaussian(innovation, sigma * xp.sqrt(1.0 - phi**2))], axis=1)
        return result

    @checked
    def draw(self, n_time: Count, noise: Floats, rng: np.random.Generator) -> Floats:
        """Stationary noise, shape (n_batch, n_time)."""
        from scipy.signal import lfilter

        white = rng.standard_normal((len(noise), n_time))
        return np.array(
            [
                sigma
                * lfilter([np.sqrt(1.0 - phi**2)], [1.0, -phi], row, zi=[phi * rng.standard_normal()])[0]
                for (sigma, phi), row in zip(noise, white, strict=True)
            ]
        )

    def _estimate(self, residual: Floats) -> Floats:
        product = residual[1:] @ residual[:-1]
        phi = float(np.clip(product / max(float(residual @ residual), 1e-300), -0.999, 0.9999))
        return np.array([_rms(residual), phi])


NOISES: dict[str, Noise] = {noise.name: noise for noise in (Iid(), Ar1())}


@checked
def noise_model(name: str) -> Noise:
    """The noise model of that name, "iid" or "ar1".

    Raises
    ------
    UnknownNameError
        Where there is none.
    """
    return look_up(name, NOISES, f"there is no noise model {name!r}")
