"""Bands from draws of the posterior: of the parameters alone, and with the noise that a noise model adds.

The second is offered because everybody asks for it, and measured beside the calibrated one: on other excitations it
covers far less than it says.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SimulationError
from mrwork.identification.residual import ObservedTest
from mrwork.records import DamperTest
from mrwork.uncertainty.bands.band import Band
from mrwork.uncertainty.noise import Noise


def simulate_draws(
    spec: DamperSpec, theta: NDArray[np.float64], test: DamperTest, *, threads: int = 0
) -> NDArray[np.float64]:
    """Forces of all draws on a test, as the rig would have recorded them [N], shape (n_draws, n_time).

    Parameters
    ----------
    theta
        Draws of the parameters, shape (n_draws, n_params).

    Raises
    ------
    SimulationError
        Where more than a tenth of the draws cannot be simulated; fewer are left out.
    """
    forces, failed = ObservedTest.of(spec, test).forces(theta, threads=threads)
    if np.mean(~failed) < 0.9:
        raise SimulationError(
            f"{np.count_nonzero(failed)} of {len(theta)} draws cannot be simulated on {test.path or test.name}; "
            "the posterior reaches where the model is too stiff: narrow the prior, or sample the record more finely"
        )
    return forces[~failed]


def parameter_band(forces: NDArray[np.float64], level: float) -> Band:
    """Quantiles of what the draws make, shape (n_draws, n): the central share `level` of each column."""
    lower, upper = np.quantile(forces, [0.5 - 0.5 * level, 0.5 + 0.5 * level], axis=0)
    return Band(
        kind="parameter",
        level=level,
        lower=lower,
        upper=upper,
        basis=f"{len(forces)} draws of the parameters",
    )


def noise_band(
    forces: NDArray[np.float64],
    noise_draws: NDArray[np.float64],
    noise: Noise,
    level: float,
    *,
    deviation: float,
    mean: float,
    rng: np.random.Generator,
) -> Band:
    """The prediction band that a noise model promises, uncalibrated, shape (n,).

    Parameters
    ----------
    forces
        Of the draws [N], shape (n_draws, n).
    noise_draws
        Their noise parameters, shape (n_draws, n_noise).
    deviation, mean
        Of the force [N]: what noise parameters are relative to.
    """
    added = noise.draw((forces - mean) / deviation, noise_draws, rng)
    lower, upper = np.quantile(forces + deviation * added, [0.5 - 0.5 * level, 0.5 + 0.5 * level], axis=0)
    return Band(
        kind="prediction",
        level=level,
        lower=lower,
        upper=upper,
        basis=f"{noise.title} noise about {len(forces)} draws, not calibrated on any other test",
    )
