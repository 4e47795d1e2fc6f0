"""Suites of synthetic ground motions: drawn from stated distributions, stratified by soil and near-fault pulse.

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
from dataclasses import dataclass, replace
from typing import Annotated, Final, Literal, get_args

import numpy as np

from mrwork.arguments import Seed, Within, checked
from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion, brought_to_rest, scaled_to_peak
from mrwork.motions.spectral_density import CloughPenzien, KanaiTajimi
from mrwork.motions.synthetic import GammaEnvelope, near_fault_pulse, synthetic_motion

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
    "firm": (15.0, 0.6),
    "medium": (10.0, 0.4),
    "soft": (5.0, 0.2),
    "rock": (30.0, 0.6),
}
_LONGEST, _LONGEST_WITH_PULSE = 30.0, 15.0
_LONGEST_PERIOD = 5.0


@checked
def suite(
    soil: Soil | Sequence[Soil] = USUAL_SOILS,
    n: Annotated[int, Within(most=MOST_OF_A_SUITE)] = 24,
    *,
    rng: np.random.Generator | Seed,
    pulses: Pulses = "both",
    peak: float | None = None,
    dt: float = 0.01,
    name: str = "",
) -> tuple[GroundMotion, ...]:
    """Draw `n` synthetic motions, equally many of each soil, with and without a near-fault pulse.

    A motion depends on the seed, its soil, whether it has a pulse, and its number among those alike: a longer suite of
    the same seed begins with the same motions. Distributions and sources are those of this module.

    Parameters
    ----------
    soil
        ``"firm"``, ``"medium"``, ``"soft"``, ``"rock"``, or several of them; the first three by default. Rock is that
        of records rich in high frequencies, which raise the accelerations of the higher modes.
    n
        Number of motions. If it is no multiple of the number of strata, the first ones have one motion more.
    rng
        Seed, or a random generator, from which a seed is drawn.
    pulses
        ``"both"``: half of the motions of each soil have a pulse; ``"with"`` and ``"without"``: all or none.
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

    Raises
    ------
    SettingError
        The number of motions, the step or the peak is not positive.

    Examples
    --------
    >>> motions = suite("firm", 4, rng=2)
    >>> [motion.name for motion in motions]
    ['Firm 1', 'Firm 2', 'Firm pulse 1', 'Firm pulse 2']
    """
    soils: tuple[Soil, ...] = (soil,) if isinstance(soil, str) else tuple(dict.fromkeys(soil))
    if not soils or n < 1:
        raise SettingError(f"a suite of {n} motions on {len(soils)} soils; give at least one of each")
    seed = rng if isinstance(rng, int) else int(rng.integers(2**32))
    strata = [
        Stratum(soil=each, pulse=pulse, seed=seed)
        for each in soils
        for pulse in {"both": (False, True), "with": (True,), "without": (False,)}[pulses]
    ]
    counts = [len(range(number, n, len(strata))) for number in range(len(strata))]
    motions = [
        _motion(stratum, number, dt, name)
        for stratum, count in zip(strata, counts, strict=True)
        for number in range(1, count + 1)
    ]
    return tuple(motions if peak is None else (scaled_to_peak(motion, peak) for motion in motions))


@dataclass(frozen=True, slots=True, kw_only=True)
class Stratum:
    """Soil and pulse that motions of a suite have in common, and the seed of the suite."""

    soil: Soil
    pulse: bool
    seed: int

    @property
    def ground(self) -> str:
        """The ground in words."""
        return "rock" if self.soil == "rock" else f"{self.soil} soil"

    def generator(self, number: int) -> np.random.Generator:
        """The random numbers of one motion, independent of all others."""
        place = (self.seed, _SOILS.index(self.soil), int(self.pulse), number)
        return np.random.default_rng(np.random.SeedSequence(place))


def _motion(stratum: Stratum, number: int, dt: float, prefix: str) -> GroundMotion:
    rng = stratum.generator(number)
    frequency, damping = _GROUND[stratum.soil]
    ground = KanaiTajimi(
        frequency=frequency * _lognormal(rng, 0.3, limit=2.0),
        damping=damping * _lognormal(rng, 0.25, limit=2.0),
    )
    spectrum = CloughPenzien(soil=ground, frequency=0.1 * ground.frequency, damping=0.6)
    envelope = GammaEnvelope(
        significant_duration=_duration(rng, _LONGEST_WITH_PULSE if stratum.pulse else _LONGEST),
        shape=rng.uniform(3.0, 8.0),
    )
    said = [
        f"{stratum.ground} of {ground.frequency / (2.0 * math.pi):.2f} Hz and damping {ground.damping:.2f}",
        f"5-95 % duration {envelope.significant_duration:.1f} s, envelope of shape {envelope.shape:.1f}",
    ]
    rest = synthetic_motion(spectrum, rng=rng, duration=envelope.time_of(0.999), dt=dt, envelope=envelope)
    acceleration = rest.acceleration
    if stratum.pulse:
        pulse = _pulse(rng, rest)
        said.append(pulse.source)
        length = pulse.n_time
        first = max(0, round(envelope.time_of(rng.uniform(0.1, 0.4)) / dt) - length // 2)
        acceleration = np.pad(acceleration, (0, max(0, first + length - acceleration.size)))
        acceleration[first : first + length] += pulse.acceleration
    kind = f"{stratum.soil.capitalize()}{' pulse' if stratum.pulse else ''}"
    motion = GroundMotion(
        name=f"{prefix + ', ' if prefix else ''}{kind[:1].lower() + kind[1:] if prefix else kind} {number}",
        dt=dt,
        acceleration=acceleration,
        source=f"suite, seed {stratum.seed}, {kind.lower()} {number}: {'; '.join(said)}",
        groups=(stratum.ground, "near-fault pulse" if stratum.pulse else "no pulse"),
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
    """A factor with median 1 and logarithmic standard deviation `sigma`, within `limit` of these."""
    deviate = math.inf
    while abs(deviate) > limit:
        deviate = rng.standard_normal()
    return math.exp(sigma * deviate)
