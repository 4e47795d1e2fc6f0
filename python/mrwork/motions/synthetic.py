"""Computed ground motions: synthetic earthquakes from a spectral density, suites of them, sines and pulses.

A controller that is tuned on some motions is judged on others, so a study needs many of them. A motion of a suite is
`synthetic_motion` of a Clough-Penzien spectrum, with a near-fault pulse in half of them, brought to rest at its end.

========================  =========================================================  ==================================
what is drawn             distribution                                               source
========================  =========================================================  ==================================
frequency of the ground   lognormal, median of the soil, 0.3, within two sigma       medians [1], 30 rad/s for rock
                                                                                     ours; spread ours
damping of the ground     lognormal, median of the soil, 0.25, within two sigma      medians [1]; spread ours
second filter             a tenth of the frequency of the ground, damping 0.6        [1]
5-95 % duration           beta on 5 to 45 s, mean 17.3 s, standard deviation 9.31 s  [2]; redrawn above 30 s (15 s with
                                                                                     a pulse), ours
shape of the envelope     gamma, uniform from 3 to 8                                 form [3]; range ours, 45 % of the
                                                                                     energy after 0.4 to 0.8 durations
magnitude                 uniform from 6.0 to 7.2                                    ours
period of the pulse       lognormal, ln T = -5.73 + 0.99 M, 0.56, within 1.5 sigma   [4]; redrawn above 5 s, ours
cycles and phase          uniform from 1.2 to 2.5, and from 0 to 2 pi                form [5]; ranges ours
velocity of the pulse     lognormal over the peak acceleration of the rest, median   ours; no more acceleration than the
                          0.2 s, 0.3                                                 peak of the rest
middle of the pulse       after 10 to 40 % of the energy of the rest, uniform        ours
========================  =========================================================  ==================================

The frequency content does not change during a motion, and amplitudes are meant to be scaled. References: [1] Der
Kiureghian and Neuenhofer, Earthq. Eng. Struct. Dyn. 21 (1992) 713-740. [2] Rezaeian and Der Kiureghian, Earthq. Eng.
Struct. Dyn. 39 (2010) 1155-1180. [3] Saragoni and Hart, Earthq. Eng. Struct. Dyn. 2 (1974) 249-267. [4] Shahi and
Baker, Bull. Seismol. Soc. Am. 101 (2011) 742-755. [5] Mavroeidis and Papageorgiou, Bull. Seismol. Soc. Am. 93 (2003)
1099-1131.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Final, Literal, get_args

import numpy as np

from mrwork.base.arguments import NotNegative, Positive, Seed, checked
from mrwork.base.hints import Says, Within
from mrwork.base.values import Floats
from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion, brought_to_rest, check_samples, scaled_to_peak
from mrwork.motions.spectral_density import CloughPenzien, KanaiTajimi, SoilSpectrum

AboveOne = Annotated[float, Within(above=1.0)]
# Run-in time of the filter before the motion begins, in its longest time constant.
_RUN_IN = 8.0
# A filter that decays slower [1/s] would want a run-in of months.
_SLOWEST = 1e-6


@checked
def synthetic_motion(
    spectrum: SoilSpectrum | None = None,
    *,
    rng: np.random.Generator | Seed = 1940,
    duration: float = 30.0,
    dt: float = 0.01,
    envelope: Envelope | GammaEnvelope | None = None,
    peak: float | None = None,
    name: str = "synthetic",
) -> GroundMotion:
    """Draw a motion from a spectral density; without arguments, the motion of the demo and the tests.

    White noise up to half the sampling rate is filtered in the frequency domain by the transfer function of the soil,
    so that the plateau has the exact density, without discretisation error, and is multiplied by the envelope.

    Parameters
    ----------
    spectrum
        `KanaiTajimi` or `CloughPenzien`; by default `CloughPenzien` on firm soil.
    rng
        Random generator, or its seed.
    duration, dt
        Length and step [s].
    envelope
        Type B of Jennings by default.
    peak
        Peak ground acceleration [m/s^2] to which the motion is scaled; by default it is not scaled.

    Examples
    --------
    >>> motion = synthetic_motion(peak=3.0)
    >>> motion.n_time, round(motion.peak, 6)
    (3001, 3.0)
    """
    spectrum = CloughPenzien() if spectrum is None else spectrum
    envelope = Envelope() if envelope is None else envelope
    time = _time(duration, dt)
    seed = f"seed {rng}" if isinstance(rng, int) else "a generator that was passed"
    generator = np.random.default_rng(rng)
    run_in = _RUN_IN * _memory(spectrum)
    check_samples(duration + run_in, dt)
    n_run_in = math.ceil(run_in / dt)
    n_noise = time.size + n_run_in
    # Samples of white noise of two-sided density S0 over circular frequency have the variance 2 pi S0 / dt.
    noise = math.sqrt(2.0 * math.pi * spectrum.intensity / dt) * generator.standard_normal(n_noise)
    w = np.asarray(2.0 * np.pi * np.fft.rfftfreq(n_noise, dt), dtype=np.float64)
    stationary = np.fft.irfft(np.fft.rfft(noise) * spectrum.transfer(w), n_noise)[n_run_in:]
    motion = GroundMotion(
        name=name,
        dt=dt,
        acceleration=stationary * envelope.at(time),
        source=f"{spectrum.name} filtered white noise, {seed}",
    )
    return motion if peak is None else scaled_to_peak(motion, peak)


def _memory(spectrum: SoilSpectrum) -> float:
    """Longest time constant of the filter [s]."""
    slowest = float(np.abs(np.linalg.eigvals(spectrum.filter_matrices().state).real).min())
    if slowest < _SLOWEST:
        raise SettingError(
            f"the filter of {spectrum.name} noise decays at {slowest:g} 1/s; give a larger damping ratio or frequency"
        )
    return 1.0 / slowest


@checked
class Envelope:
    """Envelope `(t / rise)^2` up to `rise` [s], 1 up to `plateau_end` [s], then `exp(-decay (t - plateau_end))`.

    The defaults are type B of Jennings, Housner and Tsai (Simulated Earthquake Motions, California Institute of
    Technology, 1968), for magnitudes about 7, with the exponential continued in place of their parabola after 30 s.
    """

    rise: float = 4.0
    plateau_end: float = 15.0
    decay: NotNegative = 0.0992

    def __post_init__(self) -> None:
        if not 0.0 <= self.rise <= self.plateau_end < np.inf:
            raise SettingError(
                f"envelope rises until {self.rise} s and stays until {self.plateau_end} s; give times in that order"
            )

    @checked
    def at(self, time: Floats) -> Floats:
        """Values between 0 and 1 at times [s], in the shape of `time`."""
        rising = np.minimum(time / self.rise, 1.0) ** 2 if self.rise > 0.0 else np.ones_like(time)
        return rising * np.exp(-self.decay * np.maximum(time - self.plateau_end, 0.0))


@checked
class GammaEnvelope:
    """Envelope whose square is a gamma density in time, `t^(shape - 1) exp(-t / scale)`, with a peak of 1.

    G. R. Saragoni and G. C. Hart, Earthq. Eng. Struct. Dyn. 2 (1974) 249-267. The energy of a motion then grows as the
    gamma distribution, from 5 to 95 % in `significant_duration` [s].
    """

    significant_duration: Positive
    shape: AboveOne = 5.0

    @property
    def scale(self) -> float:
        """Scale of the gamma density [s]."""
        from scipy.special import gammaincinv  # slow to load

        first, last = gammaincinv(self.shape, np.array([0.05, 0.95]))
        return float(self.significant_duration / (last - first))

    @checked
    def time_of(self, share: float) -> float:
        """Time until which a share of the energy has come [s]."""
        from scipy.special import gammaincinv

        return float(self.scale * gammaincinv(self.shape, share))

    @checked
    def at(self, time: Floats) -> Floats:
        """Values between 0 and 1 at times [s], in the shape of `time`."""
        over_peak = time / ((self.shape - 1.0) * self.scale)
        power = 0.5 * (self.shape - 1.0)
        return np.asarray(over_peak**power * np.exp(power * (1.0 - over_peak)), dtype=np.float64)


@checked
def sine(*, amplitude: float, frequency: Positive, cycles: float, dt: float = 0.001) -> GroundMotion:
    """Sinusoidal acceleration of `amplitude` [m/s^2] and `frequency` [Hz] for a number of cycles, from zero."""
    if not frequency * dt < 0.5:
        raise SettingError(
            f"frequency is {frequency:g} Hz, and samples every {dt:g} s hold nothing above {0.5 / dt:g} Hz; give less, "
            "or a shorter `dt`"
        )
    acceleration = amplitude * np.sin(2.0 * np.pi * frequency * _time(cycles / frequency, dt))
    return GroundMotion(name=f"sine {frequency:g} Hz", dt=dt, acceleration=acceleration, source="computed")


@checked
def near_fault_pulse(
    *, amplitude: float, period: Positive, cycles: AboveOne = 1.5, phase: float = 0.0, dt: float = 0.01
) -> GroundMotion:
    """Near-fault pulse of ground velocity: a cosine of `period` [s] in a cosine bell `cycles` periods long.

    `v = A / 2 (1 + cos(2 pi t / (cycles T))) cos(2 pi t / T + phase)`, t from its middle, with the amplitude A [m/s],
    more than one cycle and the phase [rad]. The velocity returns to zero, the displacement need not (Mavroeidis and
    Papageorgiou, Bull. Seismol. Soc. Am. 93, 2003, 1099-1131, equations 2 and 3).
    """
    time = _time(cycles * period, dt)
    w = 2.0 * np.pi / period
    t = time - 0.5 * time[-1]
    bell = np.where(np.abs(t) <= 0.5 * cycles * period, 1.0 + np.cos(w * t / cycles), 0.0)
    slope = np.where(bell > 0.0, np.sin(w * t / cycles) / cycles, 0.0)
    acceleration = -0.5 * amplitude * w * (slope * np.cos(w * t + phase) + bell * np.sin(w * t + phase))
    source = f"pulse of {period:.2f} s, {abs(amplitude):.3g} m/s, {cycles:.2f} cycles, phase {phase:.2f}"
    return GroundMotion(
        name=f"near-fault pulse {period:g} s", dt=dt, acceleration=acceleration, source=source
    )


def _time(duration: float, dt: float) -> Floats:
    if not (math.isfinite(duration) and 0.0 < dt <= duration):
        raise SettingError(f"a motion of {duration} s every {dt} s; give a positive step below the duration")
    check_samples(duration, dt)
    return dt * np.arange(round(duration / dt) + 1, dtype=np.float64)


MOST_OF_A_SUITE = 100_000
"""Most motions of a suite."""

Soil = Literal["firm", "medium", "soft", "rock"]
"""Grounds of a suite; rock is drawn on request only."""

Pulses = Literal["both", "with", "without"]
"""Whether motions of a suite have a near-fault pulse: half of them, all or none."""

_SOILS: Final[tuple[Soil, ...]] = get_args(Soil)
USUAL_SOILS: Final[tuple[Soil, ...]] = ("firm", "medium", "soft")
"""Soils of a suite where none are given."""
# Frequency [rad/s] and damping of the ground, of which the second filter follows.
_GROUND: Final[dict[Soil, tuple[float, float]]] = {
    "firm": (15.0, 0.6), "medium": (10.0, 0.4), "soft": (5.0, 0.2), "rock": (30.0, 0.6),
}  # fmt: skip
_LONGEST_SHAKING, _LONGEST_WITH_PULSE = 30.0, 15.0
_LONGEST_PERIOD = 5.0


@checked
def suite(
    soil: Annotated[
        Soil | Sequence[Soil],
        Says(
            "soils of the motions; rock, the fourth, is that of records rich in high frequencies, which raise the "
            "accelerations of the higher modes",
            named="soils",
        ),
    ] = USUAL_SOILS,
    n: Annotated[
        int,
        Within(least=1, most=MOST_OF_A_SUITE),
        Says(
            "number of motions; if no multiple of the strata, the first ones have one more", named="motions"
        ),
    ] = 24,
    *,
    rng: np.random.Generator | Seed,
    pulses: Annotated[
        Pulses, Says("whether half of the motions of each soil have a near-fault pulse, all or none")
    ] = "both",
    peak: float | None = None,
    dt: float = 0.01,
    name: str = "",
) -> tuple[GroundMotion, ...]:
    """Synthetic motions, equally many of each soil, with and without a near-fault pulse.

    A motion depends on the seed, its soil, whether it has a pulse, and its number among motions of its kind: a longer
    suite of the same seed begins with the same motions. The docstring of this module states distributions and sources.

    Parameters
    ----------
    rng
        Seed, or a random generator, from which a seed is drawn.
    peak
        Peak ground acceleration [m/s^2] to which all are scaled; by default they are not scaled.
    dt
        Step [s].
    name
        Prefix of the names, to tell suites apart.

    Returns
    -------
    tuple of GroundMotion
        Motions ordered by soil; `groups` have soil and pulse, `source` all drawn numbers.

    Examples
    --------
    >>> motions = suite("firm", 4, rng=2)
    >>> [motion.name for motion in motions]
    ['Firm 1', 'Firm 2', 'Firm pulse 1', 'Firm pulse 2']
    """
    soils: tuple[Soil, ...] = (soil,) if isinstance(soil, str) else tuple(dict.fromkeys(soil))
    if not soils:
        raise SettingError("a suite has motions on a soil; give one or several")
    seed = rng if isinstance(rng, int) else int(rng.integers(2**32))
    strata = [
        (soil, pulse)
        for soil in soils
        for pulse in {"both": (False, True), "with": (True,), "without": (False,)}[pulses]
    ]
    motions = [
        _suite_motion(*stratum, number, seed, dt, name)
        for place, stratum in enumerate(strata)
        for number in range(1, len(range(place, n, len(strata))) + 1)
    ]
    return tuple(motions if peak is None else (scaled_to_peak(motion, peak) for motion in motions))


def _suite_motion(
    soil: Soil, has_pulse: bool, number: int, seed: int, dt: float, prefix: str
) -> GroundMotion:
    # The random numbers of one motion do not depend on any other motion.
    key = (seed, _SOILS.index(soil), int(has_pulse), number)
    rng = np.random.default_rng(np.random.SeedSequence(key))
    words = "rock" if soil == "rock" else f"{soil} soil"
    frequency, damping = _GROUND[soil]
    ground = KanaiTajimi(
        frequency=frequency * _lognormal(rng, 0.3, limit=2.0),
        damping=damping * _lognormal(rng, 0.25, limit=2.0),
    )
    spectrum = CloughPenzien(soil=ground, frequency=0.1 * ground.frequency, damping=0.6)
    envelope = GammaEnvelope(
        significant_duration=_duration(rng, _LONGEST_WITH_PULSE if has_pulse else _LONGEST_SHAKING),
        shape=rng.uniform(3.0, 8.0),
    )
    parts = [
        f"{words} of {ground.frequency / (2.0 * math.pi):.2f} Hz and damping {ground.damping:.2f}",
        f"5-95 % duration {envelope.significant_duration:.1f} s, envelope of shape {envelope.shape:.1f}",
    ]
    rest = synthetic_motion(spectrum, rng=rng, duration=envelope.time_of(0.999), dt=dt, envelope=envelope)
    acceleration = rest.acceleration
    if has_pulse:
        pulse = _pulse(rng, rest)
        parts.append(pulse.source)
        length = pulse.n_time
        first = max(0, round(envelope.time_of(rng.uniform(0.1, 0.4)) / dt) - length // 2)
        acceleration = np.pad(acceleration, (0, max(0, first + length - acceleration.size)))
        acceleration[first : first + length] += pulse.acceleration
    kind = f"{soil.capitalize()}{' pulse' if has_pulse else ''}"
    motion = GroundMotion(
        name=f"{prefix + ', ' if prefix else ''}{kind[:1].lower() + kind[1:] if prefix else kind} {number}",
        dt=dt,
        acceleration=acceleration,
        source=f"suite, seed {seed}, {kind.lower()} {number}: {'; '.join(parts)}",
        groups=(words, "near-fault pulse" if has_pulse else "no pulse"),
    )
    return replace(brought_to_rest(motion), changes=())


def _pulse(rng: np.random.Generator, rest: GroundMotion) -> GroundMotion:
    period = math.inf
    while period > _LONGEST_PERIOD:
        magnitude = rng.uniform(6.0, 7.2)
        period = math.exp(-5.73 + 0.99 * magnitude) * _lognormal(rng, 0.56, limit=1.5)
    velocity = 0.2 * _lognormal(rng, 0.3, limit=2.0) * rest.peak
    cycles, phase = rng.uniform(1.2, 2.5), rng.uniform(0.0, 2.0 * math.pi)

    def with_velocity(amplitude: float) -> GroundMotion:
        return near_fault_pulse(amplitude=amplitude, period=period, cycles=cycles, phase=phase, dt=rest.dt)

    full = with_velocity(velocity)
    return with_velocity(velocity * min(1.0, rest.peak / full.peak))


def _duration(rng: np.random.Generator, longest: float) -> float:
    """5-95 % duration [s] from the beta distribution of its mean and standard deviation, redrawn above `longest`."""
    low, high = 5.0, 45.0
    mean, deviation = (17.3 - low) / (high - low), 9.31 / (high - low)
    total = mean * (1.0 - mean) / deviation**2 - 1.0
    while True:
        duration = low + (high - low) * rng.beta(mean * total, (1.0 - mean) * total)
        if duration <= longest:
            return duration


def _lognormal(rng: np.random.Generator, sigma: float, *, limit: float) -> float:
    """A factor with median 1 and logarithmic standard deviation `sigma`, within `limit` standard deviations."""
    deviate = math.inf
    while abs(deviate) > limit:
        deviate = rng.standard_normal()
    return math.exp(sigma * deviate)
