"""Power spectral densities of ground acceleration: white noise filtered by the soil.

Densities are two-sided in circular frequency: the variance is the integral over w from minus to plus infinity.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import checked
from mrwork.errors import SettingError
from mrwork.hints import SMALLEST
from mrwork.values import Floats, array_dataclass

Complexes = NDArray[np.complex128]


@array_dataclass()
class FilterMatrices:
    """Shaping filter `s' = state s + noise w`, `a_g = output s`, with white noise w of density `intensity`."""

    state: Floats
    noise: Floats
    output: Floats


def _refuse_not_positive(spectrum: SpectralDensity, *names: str) -> None:
    for name in names:
        value = getattr(spectrum, name)
        if not (math.isfinite(value) and value >= SMALLEST):
            raise SettingError(f"{name} of a {spectrum.name} spectrum is {value}; give a positive number")


@checked
class KanaiTajimi:
    """Kanai-Tajimi spectrum: white noise at the bedrock filtered by one layer of soil (Kanai 1957, Tajimi 1960).

    `S(w) = S0 (w_g^4 + 4 zeta_g^2 w_g^2 w^2) / ((w_g^2 - w^2)^2 + 4 zeta_g^2 w_g^2 w^2)`. The defaults are firm soil
    (Der Kiureghian and Neuenhofer, Earthq. Eng. Struct. Dyn. 21, 1992, 713-740); the intensity is our choice, for peaks
    of about 0.3 g.

    Parameters
    ----------
    frequency, damping
        w_g [rad/s] and zeta_g of the ground.
    intensity
        S0 [m^2/s^3], two-sided in circular frequency.
    """

    name: ClassVar[str] = "Kanai-Tajimi"
    frequency: float = 15.0
    damping: float = 0.6
    intensity: float = 0.01

    def __post_init__(self) -> None:
        _refuse_not_positive(self, "frequency", "damping", "intensity")

    @checked
    def transfer(self, w: Floats) -> Complexes:
        """Transfer function from bedrock to ground acceleration at circular frequencies w [rad/s], shape of w."""
        w_g, zeta_g = self.frequency, self.damping
        return (w_g**2 + 2j * zeta_g * w_g * w) / (w_g**2 - w**2 + 2j * zeta_g * w_g * w)

    @checked
    def density(self, w: Floats) -> Floats:
        """Two-sided density [m^2/s^3] at circular frequencies w [rad/s], in the shape of w."""
        return self.intensity * np.abs(self.transfer(w)) ** 2

    def filter_matrices(self) -> FilterMatrices:
        """State-space form of the filter: displacement and velocity of the layer relative to the bedrock."""
        w_g, zeta_g = self.frequency, self.damping
        return FilterMatrices(
            state=np.array([[0.0, 1.0], [-(w_g**2), -2.0 * zeta_g * w_g]]),
            noise=np.array([0.0, -1.0]),
            output=np.array([-(w_g**2), -2.0 * zeta_g * w_g]),
        )


@checked
class CloughPenzien:
    """Clough-Penzien spectrum: Kanai-Tajimi with a high-pass filter, which keeps ground displacements finite.

    `S(w) = S_KT(w) w^4 / ((w_f^2 - w^2)^2 + 4 zeta_f^2 w_f^2 w^2)`, w_f [rad/s] (Clough and Penzien, Dynamics of
    Structures, 1975). The defaults are firm soil as in `KanaiTajimi`.
    """

    name: ClassVar[str] = "Clough-Penzien"
    soil: KanaiTajimi = KanaiTajimi()
    frequency: float = 1.5
    damping: float = 0.6

    def __post_init__(self) -> None:
        _refuse_not_positive(self, "frequency", "damping")

    @property
    def intensity(self) -> float:
        """S0 [m^2/s^3] of the white noise."""
        return self.soil.intensity

    def transfer(self, w: Floats) -> Complexes:
        """Transfer function from bedrock to ground acceleration at circular frequencies w [rad/s], shape of w."""
        w_f, zeta_f = self.frequency, self.damping
        return self.soil.transfer(w) * -(w**2) / (w_f**2 - w**2 + 2j * zeta_f * w_f * w)

    def density(self, w: Floats) -> Floats:
        """Two-sided density [m^2/s^3] at circular frequencies w [rad/s], in the shape of w."""
        return self.soil.intensity * np.abs(self.transfer(w)) ** 2

    def filter_matrices(self) -> FilterMatrices:
        """State-space form of both filters, with the states of the soil first."""
        w_f, zeta_f = self.frequency, self.damping
        soil = self.soil.filter_matrices()
        own = np.array([[0.0, 1.0], [-(w_f**2), -2.0 * zeta_f * w_f]])
        state = np.block([[soil.state, np.zeros((2, 2))], [np.zeros((2, 2)), own]])
        state[3, :2] = soil.output
        return FilterMatrices(
            state=state, noise=np.concatenate((soil.noise, np.zeros(2))), output=state[3].copy()
        )


SpectralDensity = KanaiTajimi | CloughPenzien


def mean_square_of(spectrum: SpectralDensity) -> float:
    """Mean square of the ground acceleration [m^2/s^4].

    Of Kanai-Tajimi `pi S0 w_g (1 + 4 zeta_g^2) / (2 zeta_g)`, of Clough-Penzien by the Lyapunov equation of its filter.
    """
    if isinstance(spectrum, KanaiTajimi):
        zeta = spectrum.damping
        return math.pi * spectrum.intensity * spectrum.frequency * (1.0 + 4.0 * zeta**2) / (2.0 * zeta)
    filters = spectrum.filter_matrices()
    A, one = filters.state, np.eye(len(filters.state))
    noise = 2.0 * math.pi * spectrum.intensity * np.outer(filters.noise, filters.noise)
    X = np.linalg.solve(np.kron(A, one) + np.kron(one, A), -noise.ravel()).reshape(A.shape)
    return float(filters.output @ X @ filters.output)
