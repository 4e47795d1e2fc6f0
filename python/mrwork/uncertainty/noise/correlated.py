"""Noise that remembers: each residual takes over part of the one before."""

from __future__ import annotations

import numpy as np

from mrwork.uncertainty.noise.model import SIGMA, Array, Noise, NoiseParameter, gaussian, rms

_PHI = NoiseParameter(
    name="phi",
    lower=-0.99999,
    upper=0.99999,
    log=False,
    description="share of a residual that the next one keeps",
)


class Ar1(Noise):
    """First-order autoregressive: r_t = phi r_(t-1) + e_t; `sigma` is the deviation of r, not of e."""

    name = "ar1"
    title = "AR(1)"
    correlated = True
    parameters = (SIGMA, _PHI)

    def _log_densities(self, residual: Array, force: Array, noise: Array) -> Array:
        xp = residual.__array_namespace__()
        sigma, phi = noise[:, :1], noise[:, 1:2]
        first = gaussian(residual[:, :1], sigma)
        innovation = residual[:, 1:] - phi * residual[:, :-1]
        result: Array = xp.concat([first, gaussian(innovation, sigma * xp.sqrt(1.0 - phi**2))], axis=1)
        return result

    def _draw(self, force: Array, noise: Array, rng: np.random.Generator) -> Array:
        from scipy.signal import lfilter

        white = rng.standard_normal(force.shape)
        return np.array(
            [
                sigma
                * lfilter([np.sqrt(1.0 - phi**2)], [1.0, -phi], row, zi=[phi * rng.standard_normal()])[0]
                for (sigma, phi), row in zip(noise, white, strict=True)
            ]
        )

    def _estimate(self, residual: Array, force: Array) -> Array:
        return np.array([rms(residual), _lag_one(residual)])


class Arma11(Noise):
    """r_t = phi r_(t-1) + e_t + theta e_(t-1), `sigma` the deviation of r: so is an AR(1) with white noise on top."""

    name = "arma11"
    title = "ARMA(1,1)"
    correlated = True
    # A recursion, left to SciPy's filter.
    differentiable = False
    parameters = (
        SIGMA,
        _PHI,
        NoiseParameter(
            name="theta", lower=-0.99999, upper=0.99999, log=False, description="share of the last innovation"
        ),
    )

    def _log_densities(self, residual: Array, force: Array, noise: Array) -> Array:
        from scipy.signal import lfilter

        sigma, phi, theta = noise.T
        per_innovation = 1.0 + (phi + theta) ** 2 / (1.0 - phi**2)
        deviation = sigma / np.sqrt(per_innovation)
        result = np.empty_like(residual)
        for row, values in enumerate(residual):
            # The first innovation is taken at its expectation given the first residual; the prediction error then
            # counts as settled, which it is within a few samples.
            first = values[0] / per_innovation[row]
            state = [-phi[row] * values[0] - theta[row] * first]
            innovation = lfilter([1.0, -phi[row]], [1.0, theta[row]], values[1:], zi=state)[0]
            result[row, 0] = gaussian(values[:1], sigma[row : row + 1])[0]
            result[row, 1:] = gaussian(innovation, deviation[row : row + 1])
        return result

    def _draw(self, force: Array, noise: Array, rng: np.random.Generator) -> Array:
        from scipy.signal import lfilter

        # Enough samples before the first that what they began with is forgotten.
        warm_up = 500
        white = rng.standard_normal((force.shape[0], warm_up + force.shape[1]))
        rows = []
        for (sigma, phi, theta), row in zip(noise, white, strict=True):
            deviation = sigma / np.sqrt(1.0 + (phi + theta) ** 2 / (1.0 - phi**2))
            rows.append(deviation * lfilter([1.0, theta], [1.0, -phi], row)[warm_up:])
        return np.array(rows)

    def _estimate(self, residual: Array, force: Array) -> Array:
        # rho_1 and rho_2 = phi rho_1 give phi; theta then solves a quadratic. Half of its size is a safe start.
        rho_1 = _lag_one(residual)
        rho_2 = float(
            np.clip(residual[2:] @ residual[:-2] / max(float(residual @ residual), 1e-300), -0.99, 0.9999)
        )
        phi = float(np.clip(rho_2 / rho_1 if abs(rho_1) > 0.05 else rho_1, -0.999, 0.9999))
        return np.array([rms(residual), phi, 0.5 * float(np.clip(rho_1 - phi, -0.9, 0.9))])


def _lag_one(residual: Array) -> float:
    return float(
        np.clip(residual[1:] @ residual[:-1] / max(float(residual @ residual), 1e-300), -0.999, 0.9999)
    )
