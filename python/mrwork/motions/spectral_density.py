"""Power spectral densities of ground acceleration: white noise filtered by the soil; fits to one motion and to many.

Densities are two-sided in circular frequency: the variance is the integral over w from minus to plus infinity. One
motion is fitted by likelihood; the stationary ground of a design has the mean square and the shape of many motions.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import Positive, Whole, checked
from mrwork.base.hints import Says, Within
from mrwork.base.summary import Summarised, Summary
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import MrworkWarning, RecordError, SettingError
from mrwork.motions.ground_motion import GroundMotion

Complexes = NDArray[np.complex128]


@array_dataclass()
class FilterMatrices:
    """Shaping filter `s' = state s + noise w`, `a_g = output s`, with white noise w of density `intensity`.

    Of a road the output is the velocity v_g of the ground.
    """

    state: Floats
    noise: Floats
    output: Floats
    of_velocity: bool = False


@checked
class KanaiTajimi:
    """Kanai-Tajimi spectrum: white noise at the bedrock filtered by one layer of soil (Kanai 1957, Tajimi 1960).

    `S(w) = S0 (w_g^4 + 4 zeta_g^2 w_g^2 w^2) / ((w_g^2 - w^2)^2 + 4 zeta_g^2 w_g^2 w^2)`. The defaults are firm soil
    (Der Kiureghian and Neuenhofer, Earthq. Eng. Struct. Dyn. 21, 1992, 713-740); the intensity is our choice, for peaks
    of about 0.3 g.
    """

    name: ClassVar[str] = "Kanai-Tajimi"
    frequency: Annotated[Positive, Says("frequency w_g of the ground", unit="rad/s")] = 15.0
    damping: Annotated[Positive, Says("damping ratio zeta_g of the ground", usual=(0.02, 2.0))] = 0.6
    intensity: Annotated[
        Positive, Says("spectral density S0 of the bedrock, two-sided in circular frequency", unit="m2/s3")
    ] = 0.01

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

    `S(w) = S_KT(w) w^4 / ((w_f^2 - w^2)^2 + 4 zeta_f^2 w_f^2 w^2)` (Clough and Penzien, Dynamics of
    Structures, 1975). The defaults are firm soil as in `KanaiTajimi`.
    """

    name: ClassVar[str] = "Clough-Penzien"
    soil: KanaiTajimi = KanaiTajimi()
    frequency: Annotated[
        Positive, Says("frequency w_f of the second filter", unit="rad/s", named="high_pass_frequency")
    ] = 1.5
    damping: Annotated[
        Positive, Says("damping ratio zeta_f of the second filter", named="high_pass_damping")
    ] = 0.6

    @property
    def intensity(self) -> float:
        """S0 [m^2/s^3] of the white noise."""
        return self.soil.intensity

    @checked
    def transfer(self, w: Floats) -> Complexes:
        """Transfer function from bedrock to ground acceleration at circular frequencies w [rad/s], shape of w."""
        w_f, zeta_f = self.frequency, self.damping
        return self.soil.transfer(w) * -(w**2) / (w_f**2 - w**2 + 2j * zeta_f * w_f * w)

    @checked
    def density(self, w: Floats) -> Floats:
        """Two-sided density [m^2/s^3] at circular frequencies w [rad/s], in the shape of w."""
        return self.soil.intensity * np.abs(self.transfer(w)) ** 2

    def filter_matrices(self) -> FilterMatrices:
        """State-space form of both filters, with the states of the soil first."""
        w_f, zeta_f = self.frequency, self.damping
        soil = self.soil.filter_matrices()
        high_pass = np.array([[0.0, 1.0], [-(w_f**2), -2.0 * zeta_f * w_f]])
        state = np.block([[soil.state, np.zeros((2, 2))], [np.zeros((2, 2)), high_pass]])
        state[3, :2] = soil.output
        return FilterMatrices(
            state=state, noise=np.concatenate((soil.noise, np.zeros(2))), output=state[3].copy()
        )


@checked
class RoadVelocity:
    """A road under a vehicle: a velocity that is white up to its shortest waves; heights have S0 / w^2 (ISO 8608).

    `S(w) = S0 / (1 + (w / w_c)^4)` of the velocity, white noise through a Butterworth filter of second order.
    """

    name: ClassVar[str] = "road"
    intensity: Annotated[
        Positive, Says("spectral density S0 of the velocity, two-sided in circular frequency", unit="m2/s")
    ]
    frequency: Annotated[Positive, Says("frequency w_c of the shortest waves", unit="rad/s")]

    def filter_matrices(self) -> FilterMatrices:
        """State-space form of the filter: the velocity of the ground and its derivative."""
        w_c = self.frequency
        return FilterMatrices(
            state=np.array([[0.0, 1.0], [-(w_c**2), -math.sqrt(2.0) * w_c]]),
            noise=np.array([0.0, w_c**2]),
            output=np.array([1.0, 0.0]),
            of_velocity=True,
        )

    @property
    def mean_square(self) -> float:
        """Mean square of the velocity [m^2/s^2]."""
        return math.pi / math.sqrt(2.0) * self.intensity * self.frequency


SoilSpectrum = KanaiTajimi | CloughPenzien
SpectralDensity = SoilSpectrum | RoadVelocity


def mean_square_of(spectrum: SoilSpectrum) -> float:
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


SpectrumKind = Literal["kanai_tajimi", "clough_penzien"]

# Shares of the Arias intensity between which a motion counts as strong.
_STRONG = (0.05, 0.95)
_HIGHEST = 25.0
_FEWEST_STRONG = 50
# Largest logarithm of a number of a spectrum, and the share of it from which on a search has ended there.
_END, _NEAR_END = 8.0, 0.98
# Frequency and damping ratio of the ground where a fit begins.
_STARTS = ((6.0, 0.4), (15.0, 0.6), (30.0, 0.6))


@checked
def fitted_spectrum(motion: GroundMotion, kind: SpectrumKind = "kanai_tajimi") -> SoilSpectrum:
    """Spectrum of the strong part of a motion, by Whittle's likelihood.

    The strong part lasts from 5 to 95 % of the Arias intensity. Minimises `sum log S(w) + I(w) / S(w)` over the
    frequencies of its periodogram I up to 25 Hz (P. Whittle, Bull. Int. Statist. Inst. 39, 1962); the intensity follows
    in closed form. The motion is taken for stationary over that part, which no earthquake is.

    Raises
    ------
    RecordError
        If the motion is zero, or its strong part has too few samples.

    Warns
    -----
    MrworkWarning
        If the likelihood has no maximum that the record determines, as of a single line in its periodogram.

    Examples
    --------
    >>> import mrwork as mr
    >>> fitted = mr.motions.fitted_spectrum(mr.synthetic_motion(mr.motions.KanaiTajimi(frequency=10.0)))
    >>> 7.0 < fitted.frequency < 14.0
    True
    """
    strong = strong_part(motion)
    n = len(strong)
    w = np.asarray(2.0 * np.pi * np.fft.rfftfreq(n, motion.dt))
    periodogram = motion.dt / (2.0 * np.pi * n) * np.abs(np.fft.rfft(strong - strong.mean())) ** 2
    used = (w > 0.0) & (w <= 2.0 * np.pi * _HIGHEST)
    w, periodogram = w[used], periodogram[used]

    def make_density(shape: Floats, intensity: float = 1.0) -> SoilSpectrum:
        frequency, damping, *filter_shape = np.exp(shape)
        soil = KanaiTajimi(frequency=float(frequency), damping=float(damping), intensity=intensity)
        if not filter_shape:
            return soil
        return CloughPenzien(soil=soil, frequency=float(filter_shape[0]), damping=float(filter_shape[1]))

    rest = () if kind == "kanai_tajimi" else (1.5, 0.6)
    starts = [np.log([*start, *rest]) for start in _STARTS]
    success, best = _likeliest(make_density, w, periodogram, starts)
    numbers = np.exp(best)
    # The soil is a line, narrower than two frequencies of the periodogram, or the search has ended at its end.
    if not success or numbers[0] * numbers[1] < w[0] or np.abs(best).max() > _NEAR_END * _END:
        warnings.warn(
            f"ground motion {motion.name}: the likelihood of the {kind} spectrum has no maximum that the record "
            f"determines; the search ended at {', '.join(f'{each:.3g}' for each in numbers)} (rad/s, damping ratio). "
            "Take another kind, or state frequency and damping",
            MrworkWarning,
            stacklevel=2,
        )
    return make_density(best, float(np.mean(periodogram / make_density(best).density(w))))


def _likeliest(
    make: Callable[[Floats], SoilSpectrum],
    w: Floats,
    densities: Floats,
    starts: Sequence[Floats],
    bounds: Sequence[tuple[float, float]] | None = None,
) -> tuple[bool, Floats]:
    """Maximise the likelihood of Whittle whatever the intensity: whether the search has converged, and its result.

    The result are logarithms of the numbers of the spectrum.
    """
    from scipy.optimize import minimize  # takes a quarter of a second to load

    def misfit(logarithms: Floats) -> float:
        if np.any(np.abs(logarithms) > _END):
            return math.inf
        density = make(logarithms).density(w)
        return float(np.mean(np.log(density)) + np.log(np.mean(densities / density)))

    results = (minimize(misfit, start, method="Nelder-Mead", bounds=bounds) for start in starts)
    best = min(results, key=lambda result: float(result.fun))
    return bool(best.success), np.asarray(best.x)


def strong_part(motion: GroundMotion) -> Floats:
    """Samples from 5 to 95 % of the Arias intensity [m/s^2]; a motion that is zero or has too few is refused."""
    energy = np.cumsum(motion.acceleration**2)
    if not energy[-1] > 0.0:
        raise RecordError(f"ground motion {motion.name} is zero; a spectrum needs a motion")
    first, last = (int(np.searchsorted(energy, share * energy[-1])) for share in _STRONG)
    part = motion.acceleration[first : last + 1]
    if len(part) < _FEWEST_STRONG:
        raise RecordError(
            f"ground motion {motion.name}: its strong part has {len(part)} samples, a spectrum needs {_FEWEST_STRONG}; "
            "give a longer record, or one of a finer step"
        )
    return part


# Edges of the bands [rad/s], equally wide on a logarithmic axis as the frequencies of buildings are.
_EDGES = 2.0 * np.pi * np.geomspace(0.1, 25.0, 65)
_CENTRES = np.sqrt(_EDGES[1:] * _EDGES[:-1])
# Bodies of vehicles move from 0.5 Hz on.
_LOWEST_OF_VEHICLES = 2.0 * math.pi * 0.5
_FREQUENCIES = (0.5, 2.0 * math.pi * 25.0)
_DAMPINGS = (0.02, 2.0)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class StationaryGround(Summarised):
    """A spectrum with the mean square [m^2/s^4] of the strong parts of `n_motions` ground motions.

    `narrow` says that the motions are nearly harmonic: their spectrum is narrower than the filter's with the least
    damping ratio, 0.02.
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
    """The numbers of a spectrum, and its rms acceleration, of a road its rms velocity."""
    if isinstance(spectrum, RoadVelocity):
        return (
            f"road, velocity white up to {spectrum.frequency:.4g} rad/s, intensity {spectrum.intensity:.4g} m2/s, rms "
            f"{math.sqrt(spectrum.mean_square):.3g} m/s"
        )
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
    over the bands, the likelihood of P. Whittle (Bull. Int. Statist. Inst. 39, 1962). The intensity then gives the mean
    over the motions of their mean squares, for Kanai-Tajimi `2 zeta_g E a^2 / (pi w_g (1 + 4 zeta_g^2))` (Lai, Bull.
    Seismol. Soc. Am. 72, 1982, 259-274, fits the filter to moments likewise). A motion is taken for stationary over its
    strong part, which no earthquake is: rms responses of lightly damped modes are too large for short motions.

    Of roads alone the ground is a `RoadVelocity` of the mean density of their velocities from 0.5 to 25 Hz, where body
    and wheels of vehicles move, with the mean of their mean squares. Beside other motions roads are left out.

    Parameters
    ----------
    kind
        Kanai-Tajimi, or Clough-Penzien with the high-pass of its defaults.
    frequency, damping
        w_g [rad/s] and zeta_g of the ground where they are known; the others are fitted.

    Raises
    ------
    SettingError
        If no motion has a strong part that is long enough, as one that is zero, or numbers of a soil are given for a
        road.

    Examples
    --------
    >>> import mrwork as mr
    >>> ground = mr.motions.stationary_ground([mr.synthetic_motion(mr.motions.KanaiTajimi(frequency=10.0))])
    >>> 7.0 < ground.spectrum.frequency < 14.0
    True
    """
    parts, reason = [], "no motion is given"
    roads = [motion for motion in motions if motion.is_road]
    if roads and len(roads) == len(motions):
        if not (frequency is None and damping is None):
            raise SettingError("a road has no frequency and damping of a soil; leave them out")
        return _stationary_road(roads)
    for motion in (motion for motion in motions if not motion.is_road):
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


def _stationary_road(roads: Sequence[GroundMotion]) -> StationaryGround:
    velocities = [(road.velocity - road.velocity.mean(), road.dt) for road in roads]
    mean_square = float(np.mean([np.mean(np.square(velocity)) for velocity, _ in velocities]))
    densities = np.mean([np.mean(v**2) * _band_densities(v, dt) for v, dt in velocities], axis=0)
    intensity = float(np.mean(densities[_LOWEST_OF_VEHICLES <= _CENTRES]))
    if not intensity > 0.0:
        raise SettingError("the ground of the motions is not known: the road is level")
    # The filter of this density has the mean square.
    frequency = math.sqrt(2.0) * mean_square / (math.pi * intensity)
    return StationaryGround(
        spectrum=RoadVelocity(intensity=intensity, frequency=frequency),
        mean_square=float(np.mean([np.mean(np.square(road.acceleration)) for road in roads])),
        n_motions=len(roads),
        narrow=False,
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
    parameters = (frequency, damping)
    free = [number for number in range(2) if parameters[number] is None]

    def make_shape(logarithms: Floats) -> KanaiTajimi:
        numbers = [1.0 if parameter is None else parameter for parameter in parameters]
        for number, logarithm in zip(free, logarithms, strict=True):
            numbers[number] = math.exp(logarithm)
        return KanaiTajimi(frequency=numbers[0], damping=numbers[1], intensity=1.0)

    if not free:
        return make_shape(np.empty(0)), False
    spans = [(_FREQUENCIES, _DAMPINGS)[number] for number in free]
    bounds = [(math.log(lower), math.log(upper)) for lower, upper in spans]
    starts = [np.array([math.log(start[number]) for number in free]) for start in _STARTS]
    shape = make_shape(_likeliest(make_shape, _CENTRES, densities, starts, bounds)[1])
    return shape, damping is None and shape.damping <= 1.01 * _DAMPINGS[0]
