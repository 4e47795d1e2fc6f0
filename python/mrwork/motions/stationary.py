"""The stationary ground of a design: filtered white noise with the strength and the shape of some ground motions.

It is apart from `spectrum`, which fits one record by likelihood: a design wants the mean square of many motions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from mrwork.arguments import Positive, Whole, checked
from mrwork.errors import RecordError, SettingError
from mrwork.hints import Within
from mrwork.motions.ground_motion import GroundMotion
from mrwork.motions.spectral_density import CloughPenzien, KanaiTajimi, SpectralDensity, mean_square_of
from mrwork.motions.spectrum import SpectrumKind, strong_part
from mrwork.summary import Summarised, Summary
from mrwork.values import Floats

# Edges of the bands [rad/s], equally wide on a logarithmic axis as the frequencies of buildings are.
_EDGES = 2.0 * np.pi * np.geomspace(0.1, 25.0, 65)
_CENTRES = np.sqrt(_EDGES[1:] * _EDGES[:-1])
_FREQUENCIES = (0.5, 2.0 * math.pi * 25.0)
_DAMPINGS = (0.02, 2.0)
_STARTS = ((6.0, 0.4), (15.0, 0.6), (30.0, 0.6))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class StationaryGround(Summarised):
    """A spectrum with the mean square [m^2/s^4] of the strong parts of `n_motions` ground motions.

    `narrow` says that the motions are nearly harmonic: their spectrum is narrower than that of the filter with the
    least damping ratio, 0.02.
    """

    _made_by: ClassVar[str] = "mr.motions.stationary_ground(motions)"

    spectrum: SpectralDensity
    mean_square: Positive
    n_motions: Whole
    narrow: bool

    def _summary(self) -> Summary:
        return Summary(
            title=f"Stationary ground of {self.n_motions} motions: {ground_in_words(self.spectrum)}"
        )


def ground_in_words(spectrum: SpectralDensity) -> str:
    """The numbers of a spectrum, and its rms acceleration."""
    soil = spectrum.soil if isinstance(spectrum, CloughPenzien) else spectrum
    return (
        f"{spectrum.name}, {soil.frequency:.4g} rad/s, damping ratio {soil.damping:.3g}, intensity "
        f"{soil.intensity:.4g} m2/s3, rms {math.sqrt(mean_square_of(spectrum)):.3g} m/s2"
    )


@checked
def stationary_ground(
    motions: Sequence[GroundMotion],
    kind: SpectrumKind = "kanai_tajimi",
    *,
    frequency: Annotated[float, Within(least=1e-3, most=1e4)] | None = None,
    damping: Annotated[float, Within(least=1e-4, most=1e3)] | None = None,
) -> StationaryGround:
    """Filtered white noise with the mean square and the spectral shape of the strong parts of ground motions.

    The strong part of a motion lasts from 5 to 95 % of its Arias intensity (Trifunac and Brady, Bull. Seismol. Soc. Am.
    65, 1975, 581-626). Each periodogram is divided by its mean square, so that strong motions do not decide the shape,
    and averaged over 64 bands from 0.1 to 25 Hz. Frequency and damping ratio of the ground minimise `sum log S + I / S`
    over the bands, the likelihood of P. Whittle (Bull. Int. Statist. Inst. 39, 1962). The intensity is then that of the
    mean over the motions of the mean squares, for Kanai-Tajimi `2 zeta_g E a^2 / (pi w_g (1 + 4 zeta_g^2))` (Lai, Bull.
    Seismol. Soc. Am. 72, 1982, 259-274, fits the filter to moments likewise). A motion is taken for stationary over its
    strong part, which no earthquake is: rms responses of lightly damped modes are too large for short motions.

    Parameters
    ----------
    kind
        Kanai-Tajimi, or Clough-Penzien with the high-pass of its defaults.
    frequency, damping
        w_g [rad/s] and zeta_g of the ground where they are known; the others are fitted.

    Raises
    ------
    SettingError
        If no motion has a strong part that is long enough, as one that is zero.

    Examples
    --------
    >>> import mrwork as mr
    >>> ground = mr.motions.stationary_ground([mr.synthetic_motion(mr.motions.KanaiTajimi(frequency=10.0))])
    >>> 7.0 < ground.spectrum.frequency < 14.0
    True
    """
    parts, reason = [], "no motion is given"
    for motion in motions:
        try:
            parts.append((strong_part(motion), motion.dt))
        except RecordError as error:
            reason = str(error)
    if not parts:
        raise SettingError(f"the ground of the motions is not known: {reason}")
    mean_square = float(np.mean([np.mean(np.square(part)) for part, _ in parts]))
    shape, narrow = _fit_shape(
        np.mean([_band_densities(*part) for part in parts], axis=0), frequency, damping
    )
    spectrum = shape if kind == "kanai_tajimi" else CloughPenzien(soil=shape)
    return StationaryGround(
        spectrum=with_intensity(spectrum, mean_square / mean_square_of(spectrum)),
        mean_square=mean_square,
        n_motions=len(parts),
        narrow=narrow,
    )


def with_intensity(spectrum: SpectralDensity, intensity: float) -> SpectralDensity:
    """The spectrum with another intensity of its white noise [m^2/s^3]."""
    if isinstance(spectrum, CloughPenzien):
        return replace(spectrum, soil=replace(spectrum.soil, intensity=intensity))
    return replace(spectrum, intensity=intensity)


def _band_densities(strong: Floats, dt: float) -> Floats:
    """Mean density of each band for a mean square of 1, from the periodogram summed over frequency."""
    power = np.abs(np.fft.rfft(strong - strong.mean())) ** 2
    width = 2.0 * np.pi / (len(strong) * dt)
    ends = width * (np.arange(len(power) + 1) - 0.5)
    below = np.interp(_EDGES, ends, np.concatenate([[0.0], np.cumsum(power)]) / max(power.sum(), 1e-300))
    return np.asarray(0.5 * np.diff(below) / np.diff(_EDGES))


def _fit_shape(densities: Floats, frequency: float | None, damping: float | None) -> tuple[KanaiTajimi, bool]:
    """The filter of a shape, and whether the shape is narrower than any filter."""
    from scipy.optimize import minimize  # takes a quarter of a second to load

    given = (frequency, damping)
    free = [number for number in range(2) if given[number] is None]

    def make_shape(logarithms: Floats) -> KanaiTajimi:
        numbers = [1.0 if each is None else each for each in given]
        for number, logarithm in zip(free, logarithms, strict=True):
            numbers[number] = math.exp(logarithm)
        return KanaiTajimi(frequency=numbers[0], damping=numbers[1], intensity=1.0)

    def misfit(logarithms: Floats) -> float:
        density = make_shape(logarithms).density(_CENTRES)
        return float(np.mean(np.log(density)) + np.log(np.mean(densities / density)))

    if not free:
        return make_shape(np.empty(0)), False
    spans = [(_FREQUENCIES, _DAMPINGS)[number] for number in free]
    bounds = [(math.log(lower), math.log(upper)) for lower, upper in spans]
    best = min(
        (
            minimize(
                misfit, [math.log(start[number]) for number in free], method="Nelder-Mead", bounds=bounds
            )
            for start in _STARTS
        ),
        key=lambda each: float(each.fun),
    )
    shape = make_shape(best.x)
    return shape, damping is None and shape.damping <= 1.01 * _DAMPINGS[0]
