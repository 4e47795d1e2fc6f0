"""A spectral density fitted to a recorded ground motion."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import checked
from mrwork.errors import RecordError
from mrwork.motions.ground_motion import GroundMotion
from mrwork.motions.spectral_density import CloughPenzien, KanaiTajimi, SpectralDensity

Floats = NDArray[np.float64]

SpectrumKind = Literal["kanai_tajimi", "clough_penzien"]

# Shares of the Arias intensity between which a motion counts as strong.
_STRONG = (0.05, 0.95)
_HIGHEST = 25.0
_FEWEST = 50
_STARTS = ((6.0, 0.4), (15.0, 0.6), (30.0, 0.6))


@checked
def fitted_spectrum(motion: GroundMotion, kind: SpectrumKind = "kanai_tajimi") -> SpectralDensity:
    """Spectrum of the strong part of a motion, by Whittle's likelihood.

    The strong part lasts from 5 to 95 % of the Arias intensity. Minimises `sum log S(w) + I(w) / S(w)` over the
    frequencies of its periodogram I up to 25 Hz (P. Whittle, Bull. Int. Statist. Inst. 39, 1962); the intensity follows
    in closed form. The motion is taken for stationary over that part, which no earthquake is.

    Raises
    ------
    RecordError
        If the motion is zero, or its strong part has too few samples.

    Examples
    --------
    >>> import mrwork as mr
    >>> fitted = mr.motions.fitted_spectrum(mr.synthetic_motion(mr.motions.KanaiTajimi(frequency=10.0)))
    >>> 7.0 < fitted.frequency < 14.0
    True
    """
    from scipy.optimize import minimize  # takes a quarter of a second to load

    strong = _strong_part(motion)
    n = len(strong)
    w = np.asarray(2.0 * np.pi * np.fft.rfftfreq(n, motion.dt))
    periodogram = motion.dt / (2.0 * np.pi * n) * np.abs(np.fft.rfft(strong - strong.mean())) ** 2
    used = (w > 0.0) & (w <= 2.0 * np.pi * _HIGHEST)
    w, periodogram = w[used], periodogram[used]

    def made(shape: Floats, intensity: float = 1.0) -> SpectralDensity:
        frequency, damping, *filter_shape = np.exp(shape)
        soil = KanaiTajimi(frequency=float(frequency), damping=float(damping), intensity=intensity)
        if not filter_shape:
            return soil
        return CloughPenzien(soil=soil, frequency=float(filter_shape[0]), damping=float(filter_shape[1]))

    def misfit(shape: Floats) -> float:
        if np.any(np.abs(shape) > 8.0):
            return math.inf
        density = made(shape).density(w)
        return float(np.mean(np.log(density)) + np.log(np.mean(periodogram / density)))

    rest = () if kind == "kanai_tajimi" else (1.5, 0.6)
    found = min(
        (
            minimize(misfit, np.log([*start, *rest]), method="Nelder-Mead", options={"xatol": 1e-4})
            for start in _STARTS
        ),
        key=lambda each: float(each.fun),
    )
    return made(found.x, float(np.mean(periodogram / made(found.x).density(w))))


def _strong_part(motion: GroundMotion) -> Floats:
    energy = np.cumsum(motion.acceleration**2)
    if not energy[-1] > 0.0:
        raise RecordError(f"ground motion {motion.name} is zero; a spectrum needs a motion")
    first, last = (int(np.searchsorted(energy, share * energy[-1])) for share in _STRONG)
    part = motion.acceleration[first : last + 1]
    if len(part) < _FEWEST:
        raise RecordError(
            f"ground motion {motion.name}: its strong part has {len(part)} samples, a spectrum needs {_FEWEST}; give a "
            "longer record, or one of a finer step"
        )
    return part
