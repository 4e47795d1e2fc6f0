"""Noise models: probability densities of the residuals between measured force and model.

Residuals and noise are in units of the standard deviation of a test's measured force, so that tests of different
strength share one set of noise parameters. On real tests the residuals are mostly model error, which repeats from cycle
to cycle: how well a noise model predicts the errors on another excitation has to be measured.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, ClassVar

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.keys import check_known
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
    """A noise model for batches: residual and force (n_batch, n_time), noise parameters (n_batch, n_noise).

    The likelihood of `correlated` noise, conditional on earlier residuals, needs no tempering. `differentiable`
    densities accept JAX arrays. Noise `of_sum_of_squares` depends on the residuals through their sum of squares alone.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    parameters: ClassVar[tuple[NoiseParameter, ...]]
    correlated: ClassVar[bool] = False
    differentiable: ClassVar[bool] = True
    of_sum_of_squares: ClassVar[bool] = False

    def log_densities(self, residual: Floats, force: Floats, noise: Floats) -> Floats:
        """Log density of each sample given the earlier ones, (n_batch, n_time), in deviations of the test's force."""
        return self._log_densities(residual, force, noise)

    def draw(self, force: Floats, noise: Floats, rng: np.random.Generator) -> Floats:
        """Noise to add to a force of the model, shape (n_batch, n_time), for parameters (n_batch, n_noise)."""
        return self._draw(force, noise, rng)

    def estimate(self, residual: Floats, force: Floats) -> Floats:
        """Moment estimates of the noise parameters, shape (n_noise,), from the residuals of a fit, (n_time,)."""
        lower, upper = np.array([(each.lower, each.upper) for each in self.parameters]).T
        return np.clip(self._estimate(residual, force), lower, upper)

    def log_likelihood_of_sum(self, squared: Floats, n_time: int, noise: Floats) -> Floats:
        """Log-likelihood from sums of squared residuals, shape (n_batch,), of noise that is `of_sum_of_squares`."""
        raise NotImplementedError(f"{self.name} noise needs the residuals themselves")

    @abstractmethod
    def _log_densities(self, residual: Floats, force: Floats, noise: Floats) -> Floats: ...

    @abstractmethod
    def _draw(self, force: Floats, noise: Floats, rng: np.random.Generator) -> Floats: ...

    @abstractmethod
    def _estimate(self, residual: Floats, force: Floats) -> Floats: ...


def _gaussian(residual: Floats, deviation: Floats) -> Floats:
    xp = deviation.__array_namespace__()
    result: Floats = -0.5 * (residual / deviation) ** 2 - xp.log(deviation) - 0.5 * _LOG_2_PI
    return result


def _log_gamma(values: Floats) -> Floats:
    """Logarithm of the gamma function of NumPy or JAX arrays; it is not part of the array API."""
    of_numpy = values.__array_namespace__() is np
    # Imported by name, because both are slow to load and JAX is optional.
    special: Any = import_module("scipy.special" if of_numpy else "jax.scipy.special")
    result: Floats = special.gammaln(values)
    return result


def _rms(residual: Floats) -> float:
    return float(np.sqrt(np.mean(residual**2)))


class Iid(Noise):
    """Independent Gaussian noise of constant variance."""

    name = "iid"
    title = "independent Gaussian"
    of_sum_of_squares = True
    parameters = (_SIGMA,)

    def _log_densities(self, residual: Floats, force: Floats, noise: Floats) -> Floats:
        return _gaussian(residual, noise[:, :1])

    def log_likelihood_of_sum(self, squared: Floats, n_time: int, noise: Floats) -> Floats:
        """Log-likelihood from sums of squared residuals, shape (n_batch,)."""
        sigma = noise[:, 0]
        # What is no deviation has no likelihood.
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            return np.asarray(-0.5 * squared / sigma**2 - n_time * (np.log(sigma) + 0.5 * _LOG_2_PI))

    def _draw(self, force: Floats, noise: Floats, rng: np.random.Generator) -> Floats:
        return np.asarray(noise[:, :1] * rng.standard_normal(force.shape))

    def _estimate(self, residual: Floats, force: Floats) -> Floats:
        return np.array([_rms(residual)])


class StudentT(Noise):
    """Independent noise with heavy tails: Student's t with `nu` degrees of freedom and scale `sigma`."""

    name = "student_t"
    title = "Student's t"
    parameters = (
        _SIGMA,
        NoiseParameter(name="nu", lower=1.0, upper=200.0, log=True, description="degrees of freedom"),
    )

    def _log_densities(self, residual: Floats, force: Floats, noise: Floats) -> Floats:
        sigma, nu = noise[:, :1], noise[:, 1:2]
        xp = residual.__array_namespace__()
        constant = (
            _log_gamma(0.5 * (nu + 1.0)) - _log_gamma(0.5 * nu) - 0.5 * xp.log(np.pi * nu) - xp.log(sigma)
        )
        result: Floats = constant - 0.5 * (nu + 1.0) * xp.log1p((residual / sigma) ** 2 / nu)
        return result

    def _draw(self, force: Floats, noise: Floats, rng: np.random.Generator) -> Floats:
        return noise[:, :1] * rng.standard_t(noise[:, 1:2], size=force.shape)

    def _estimate(self, residual: Floats, force: Floats) -> Floats:
        # The kurtosis of the t distribution is 3 + 6/(nu - 4), its variance sigma^2 nu/(nu - 2).
        excess = float(np.mean(residual**4)) / max(_rms(residual) ** 4, 1e-300) - 3.0
        nu = min(4.0 + 6.0 / excess, 100.0) if excess > 0.06 else 100.0
        return np.array([_rms(residual) * np.sqrt((nu - 2.0) / nu), nu])


class Amplitude(Noise):
    """Independent Gaussian noise whose variance grows with the force: sigma^2 + (share force)^2."""

    name = "amplitude"
    title = "force-dependent Gaussian"
    parameters = (
        _SIGMA,
        NoiseParameter(
            name="share",
            lower=1e-5,
            upper=2.0,
            log=True,
            description="deviation per unit of the model's force",
        ),
    )

    def _log_densities(self, residual: Floats, force: Floats, noise: Floats) -> Floats:
        return _gaussian(residual, self._deviation(force, noise))

    def _draw(self, force: Floats, noise: Floats, rng: np.random.Generator) -> Floats:
        return np.asarray(self._deviation(force, noise) * rng.standard_normal(force.shape))

    def _estimate(self, residual: Floats, force: Floats) -> Floats:
        # Linear regression of squared residuals on squared forces, with both coefficients positive.
        squares = np.stack([np.ones_like(force), force**2], axis=1)
        intercept, slope = np.linalg.lstsq(squares, residual**2, rcond=None)[0]
        floor = 0.01 * float(np.mean(residual**2))
        return np.sqrt(np.maximum([intercept, slope], floor))

    @staticmethod
    def _deviation(force: Floats, noise: Floats) -> Floats:
        result: Floats = force.__array_namespace__().hypot(noise[:, :1], noise[:, 1:2] * force)
        return result


_PHI = NoiseParameter(
    name="phi", lower=-0.99999, upper=0.99999, log=False, description="autoregressive coefficient"
)


class Ar1(Noise):
    """First-order autoregressive noise r_t = phi r_(t-1) + e_t; `sigma` is the standard deviation of r, not of e."""

    name = "ar1"
    title = "AR(1)"
    correlated = True
    parameters = (_SIGMA, _PHI)

    def _log_densities(self, residual: Floats, force: Floats, noise: Floats) -> Floats:
        xp = residual.__array_namespace__()
        sigma, phi = noise[:, :1], noise[:, 1:2]
        first = _gaussian(residual[:, :1], sigma)
        innovation = residual[:, 1:] - phi * residual[:, :-1]
        result: Floats = xp.concat([first, _gaussian(innovation, sigma * xp.sqrt(1.0 - phi**2))], axis=1)
        return result

    def _draw(self, force: Floats, noise: Floats, rng: np.random.Generator) -> Floats:
        from scipy.signal import lfilter

        white = rng.standard_normal(force.shape)
        return np.array(
            [
                sigma
                * lfilter([np.sqrt(1.0 - phi**2)], [1.0, -phi], row, zi=[phi * rng.standard_normal()])[0]
                for (sigma, phi), row in zip(noise, white, strict=True)
            ]
        )

    def _estimate(self, residual: Floats, force: Floats) -> Floats:
        return np.array([_rms(residual), _lag_one(residual)])


class Arma11(Noise):
    """Noise r_t = phi r_(t-1) + e_t + theta e_(t-1), such as AR(1) plus white noise; `sigma` is the deviation of r."""

    name = "arma11"
    title = "ARMA(1,1)"
    correlated = True
    # The density is a recursion, computed by SciPy's filter.
    differentiable = False
    parameters = (
        _SIGMA,
        _PHI,
        NoiseParameter(
            name="theta", lower=-0.99999, upper=0.99999, log=False, description="moving-average coefficient"
        ),
    )

    def _log_densities(self, residual: Floats, force: Floats, noise: Floats) -> Floats:
        from scipy.signal import lfilter

        sigma, phi, theta = noise.T
        per_innovation = 1.0 + (phi + theta) ** 2 / (1.0 - phi**2)
        deviation = sigma / np.sqrt(per_innovation)
        result = np.empty_like(residual)
        for row, values in enumerate(residual):
            # The first innovation is set to its expectation given the first residual; the prediction error is then
            # taken as stationary, which it is within a few samples.
            first = values[0] / per_innovation[row]
            state = [-phi[row] * values[0] - theta[row] * first]
            innovation = lfilter([1.0, -phi[row]], [1.0, theta[row]], values[1:], zi=state)[0]
            result[row, 0] = _gaussian(values[:1], sigma[row : row + 1])[0]
            result[row, 1:] = _gaussian(innovation, deviation[row : row + 1])
        return result

    def _draw(self, force: Floats, noise: Floats, rng: np.random.Generator) -> Floats:
        from scipy.signal import lfilter

        # Long enough for the initial transient to decay.
        warm_up = 500
        white = rng.standard_normal((force.shape[0], warm_up + force.shape[1]))
        rows = []
        for (sigma, phi, theta), row in zip(noise, white, strict=True):
            deviation = sigma / np.sqrt(1.0 + (phi + theta) ** 2 / (1.0 - phi**2))
            rows.append(deviation * lfilter([1.0, theta], [1.0, -phi], row)[warm_up:])
        return np.array(rows)

    def _estimate(self, residual: Floats, force: Floats) -> Floats:
        # rho_1 and rho_2 = phi rho_1 give phi; theta then solves a quadratic, of which rho_1 - phi is a rough solution.
        rho_1 = _lag_one(residual)
        rho_2 = float(
            np.clip(residual[2:] @ residual[:-2] / max(float(residual @ residual), 1e-300), -0.99, 0.9999)
        )
        phi = float(np.clip(rho_2 / rho_1 if abs(rho_1) > 0.05 else rho_1, -0.999, 0.9999))
        return np.array([_rms(residual), phi, 0.5 * float(np.clip(rho_1 - phi, -0.9, 0.9))])


def _lag_one(residual: Floats) -> float:
    return float(
        np.clip(residual[1:] @ residual[:-1] / max(float(residual @ residual), 1e-300), -0.999, 0.9999)
    )


NOISES: dict[str, Noise] = {each.name: each for each in (Iid(), StudentT(), Ar1(), Arma11(), Amplitude())}


def names_in_words(noises: Sequence[Noise]) -> str:
    """Names of noise models as an enumeration: "iid, student_t or ar1"."""
    *names, last = [each.name for each in noises]
    return f"{', '.join(names)} or {last}"


@checked
def noise_model(name: str) -> Noise:
    """The noise model of that name.

    Raises
    ------
    UnknownNameError
        Where there is none.
    """
    check_known(name, NOISES, f"there is no noise model {name!r}")
    return NOISES[name]
