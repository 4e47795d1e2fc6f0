"""Noise without memory."""

from __future__ import annotations

import numpy as np

from mrwork.uncertainty.noise.model import (
    LOG_2_PI,
    SIGMA,
    Array,
    Noise,
    NoiseParameter,
    gaussian,
    log_gamma,
    rms,
)


class Iid(Noise):
    """Independent Gaussian noise of one size."""

    name = "iid"
    title = "independent Gaussian"
    parameters = (SIGMA,)

    def _log_densities(self, residual: Array, force: Array, noise: Array) -> Array:
        return gaussian(residual, noise[:, :1])

    @staticmethod
    def log_likelihood_of_sum(squared: Array, n_time: int, noise: Array) -> Array:
        """The log-likelihood from sums of squared residuals, shape (n_batch,): no residual need be kept."""
        sigma = noise[:, 0]
        return np.asarray(-0.5 * squared / sigma**2 - n_time * (np.log(sigma) + 0.5 * LOG_2_PI))

    def _draw(self, force: Array, noise: Array, rng: np.random.Generator) -> Array:
        return np.asarray(noise[:, :1] * rng.standard_normal(force.shape))

    def _estimate(self, residual: Array, force: Array) -> Array:
        return np.array([rms(residual)])


class StudentT(Noise):
    """Independent noise with heavy tails: Student's t with `nu` degrees of freedom, `sigma` its scale."""

    name = "student_t"
    title = "Student's t"
    parameters = (
        SIGMA,
        NoiseParameter(name="nu", lower=1.0, upper=200.0, log=True, description="degrees of freedom"),
    )

    def _log_densities(self, residual: Array, force: Array, noise: Array) -> Array:
        sigma, nu = noise[:, :1], noise[:, 1:2]
        xp = residual.__array_namespace__()
        constant = (
            log_gamma(0.5 * (nu + 1.0)) - log_gamma(0.5 * nu) - 0.5 * xp.log(np.pi * nu) - xp.log(sigma)
        )
        result: Array = constant - 0.5 * (nu + 1.0) * xp.log1p((residual / sigma) ** 2 / nu)
        return result

    def _draw(self, force: Array, noise: Array, rng: np.random.Generator) -> Array:
        return noise[:, :1] * rng.standard_t(noise[:, 1:2], size=force.shape)

    def _estimate(self, residual: Array, force: Array) -> Array:
        # The kurtosis of the t distribution is 3 + 6/(nu - 4), its variance sigma^2 nu/(nu - 2).
        excess = float(np.mean(residual**4)) / max(rms(residual) ** 4, 1e-300) - 3.0
        nu = min(4.0 + 6.0 / excess, 100.0) if excess > 0.06 else 100.0
        return np.array([rms(residual) * np.sqrt((nu - 2.0) / nu), nu])


class Amplitude(Noise):
    """Independent Gaussian noise that grows with the force: variance sigma^2 + (share force)^2."""

    name = "amplitude"
    title = "growing with the force"
    parameters = (
        SIGMA,
        NoiseParameter(
            name="share",
            lower=1e-5,
            upper=2.0,
            log=True,
            description="deviation per unit of the model's force",
        ),
    )

    def _log_densities(self, residual: Array, force: Array, noise: Array) -> Array:
        return gaussian(residual, self._deviation(force, noise))

    def _draw(self, force: Array, noise: Array, rng: np.random.Generator) -> Array:
        return np.asarray(self._deviation(force, noise) * rng.standard_normal(force.shape))

    def _estimate(self, residual: Array, force: Array) -> Array:
        # Squared residuals on squared forces, a straight line with both coefficients positive.
        squares = np.stack([np.ones_like(force), force**2], axis=1)
        intercept, slope = np.linalg.lstsq(squares, residual**2, rcond=None)[0]
        floor = 0.01 * float(np.mean(residual**2))
        return np.sqrt(np.maximum([intercept, slope], floor))

    @staticmethod
    def _deviation(force: Array, noise: Array) -> Array:
        result: Array = force.__array_namespace__().hypot(noise[:, :1], noise[:, 1:2] * force)
        return result
