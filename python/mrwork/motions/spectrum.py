"""Demand of a ground motion: its elastic response spectrum, its intensity, and what it takes of a shake table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.base.arguments import NotNegative, Positive, checked
from mrwork.base.hints import SMALLEST, Within
from mrwork.base.numbers import format_rounded
from mrwork.base.plotted import Plotted
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Column, Table
from mrwork.base.units import STANDARD_GRAVITY
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import SettingError
from mrwork.motions.ground_motion import (
    GroundMotion,
    refuse_forces,
    replace_samples,
    resampled,
    scaled,
    scaled_level,
)

Complexes = NDArray[np.complex128]
Ratio = Annotated[float, Within(least=0.0, below=1.0)]

# Points per period at which peaks are evaluated; the error of a peak is at most 1 - cos(pi / 64) = 0.12 %.
_PER_PERIOD = 64
# Least number of points in a step: with damping, kinks of the ground acceleration appear in the acceleration of the
# oscillator.
_FEWEST_PLACES = 4
# Most points in a step: a much faster oscillator follows the linear pieces, and more points find no higher peak.
_MOST_PLACES = 64
# Points of all oscillators in memory at once [16 bytes each].
_AT_ONCE = 1 << 20


@array_dataclass(repr=False)
class ResponseSpectrum(Plotted, Summarised):
    """Peak responses, each of shape (n_periods,), at one damping ratio.

    Parameters
    ----------
    periods
        Undamped periods [s].
    damping
        Damping ratio.
    displacement, velocity
        Relative to the ground [m], [m/s].
    acceleration
        Absolute [m/s^2].
    """

    periods: Floats
    damping: float
    displacement: Floats
    velocity: Floats
    acceleration: Floats

    @property
    def pseudo_velocity(self) -> Floats:
        """Circular frequency times peak displacement [m/s]."""
        return 2.0 * np.pi / self.periods * self.displacement

    @property
    def pseudo_acceleration(self) -> Floats:
        """Circular frequency squared times peak displacement [m/s^2]."""
        return (2.0 * np.pi / self.periods) ** 2 * self.displacement

    def _summary(self) -> Summary:
        columns = [
            Column("", heading, unit, shown=format_rounded, of=values.item)
            for heading, unit, values in (
                ("period", "s", self.periods),
                ("displacement", "m", self.displacement),
                ("velocity", "m/s", self.velocity),
                ("acceleration", "m/s^2", self.acceleration),
            )
        ]
        shown = np.unique(np.linspace(0, len(self.periods) - 1, 9).astype(int))
        return Summary(
            title=f"Response spectrum at {100.0 * self.damping:g} % damping, {len(self.periods)} periods",
            tables=[Table.of(columns, shown)],
        )


@checked
def response_spectrum(motion: GroundMotion, periods: ArrayLike, *, damping: Ratio = 0.05) -> ResponseSpectrum:
    """Response spectrum of a motion, by the exact recurrence for piecewise linear ground acceleration.

    `x'' + 2 zeta w x' + w^2 x = -a_g` from rest is one complex equation of first order, `z' = lambda z - a_g`, with
    `lambda = -zeta w + i w_d` and `z = x' + zeta w x + i w_d x`. Over a step h in which a_g is linear from a to b,
    `z(h) = e^(lambda h) z(0) - a (phi_1 - phi_2) - b phi_2`, exactly: the recurrence of Nigam and Jennings (Bull.
    Seismol. Soc. Am. 59, 1969, 909-922). The same formula gives the points within a step.

    Parameters
    ----------
    periods
        Undamped periods [s], shape (n_periods,), positive.
    damping
        Damping ratio, from 0 to below 1.

    Examples
    --------
    >>> from mrwork.motions.synthetic import synthetic_motion
    >>> spectrum = response_spectrum(synthetic_motion(), [0.2, 0.5, 1.0])
    >>> spectrum.pseudo_acceleration.shape
    (3,)
    """
    if not motion.peak:
        refuse_forces(motion, "a response spectrum")
    period = np.atleast_1d(np.asarray(periods, dtype=np.float64))
    if period.ndim != 1 or period.size == 0 or not (period >= SMALLEST).all():
        raise SettingError(
            "periods of a response spectrum must be positive numbers; give one or more in seconds"
        )
    places = np.clip(np.ceil(_PER_PERIOD * motion.dt / period), _FEWEST_PLACES, _MOST_PLACES).astype(int)
    peaks = np.empty((3, period.size))
    block = max(1, _AT_ONCE // motion.n_time)
    for number in np.unique(places):
        alike = np.flatnonzero(places == number)
        for start in range(0, alike.size, block):
            chosen = alike[start : start + block]
            peaks[:, chosen] = _peaks(motion, 2.0 * np.pi / period[chosen], damping, int(number))
    return ResponseSpectrum(
        periods=period, damping=damping, displacement=peaks[0], velocity=peaks[1], acceleration=peaks[2]
    )


def _peaks(motion: GroundMotion, w: Floats, zeta: float, places: int) -> Floats:
    """Peak displacement, velocity and absolute acceleration of oscillators of circular frequency w, shape (3, n)."""
    a, h = motion.acceleration, motion.dt
    eigenvalue = -zeta * w + 1j * w * np.sqrt(1.0 - zeta * zeta)
    decay, first, second = _oscillator_step(eigenvalue, h)
    # The input of each step first, then the recurrence.
    at_samples = np.zeros((a.size, eigenvalue.size), dtype=np.complex128)
    at_samples[1:] = -first * a[:-1, None] - second * np.diff(a)[:, None]
    for k in range(1, a.size):
        at_samples[k] += decay * at_samples[k - 1]
    peaks = _largest(at_samples, eigenvalue, w, zeta)
    rise = np.diff(a)[:, None]
    for index in range(1, places):
        part = index / places
        decay, first, second = _oscillator_step(eigenvalue, part * h)
        between = decay * at_samples[:-1] - first * a[:-1, None] - second * part * rise
        peaks = np.maximum(peaks, _largest(between, eigenvalue, w, zeta))
    return peaks


def _oscillator_step(eigenvalue: Complexes, h: float) -> tuple[Complexes, Complexes, Complexes]:
    """`e^(lambda h)`, and the integrals of `e^(lambda (h - s))` and of that times s / h, over s from 0 to h."""
    product = eigenvalue * h
    grown: Complexes = np.expm1(product)
    # For a small product the difference suffers cancellation; the series is exact to rounding.
    small = np.abs(product) < 1e-3
    series = 0.5 + product / 6.0 + product**2 / 24.0 + product**3 / 120.0
    second = h * np.asarray(np.where(small, series, (grown - product) / product**2), dtype=np.complex128)
    decay: Complexes = grown + 1.0
    return decay, grown / eigenvalue, second


def _largest(z: Complexes, eigenvalue: Complexes, w: Floats, zeta: float) -> Floats:
    displacement = z.imag / eigenvalue.imag
    velocity = z.real - zeta * w * displacement
    acceleration = 2.0 * zeta * w * velocity + w * w * displacement
    return np.array([np.abs(peak).max(axis=0) for peak in (displacement, velocity, acceleration)])


Measure = Literal["pga", "sa", "force"]
"""Measure of intensity: peak ground acceleration, spectral acceleration Sa, or the peak sum of forces on floors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Intensity:
    """Intensity of a ground motion [m/s^2]; of the measure "sa" at an undamped period [s] and a damping ratio.

    Of the measure "force" it is in newtons.

    Sa is the pseudo-acceleration `(2 pi / T)^2` times the peak displacement of the oscillator.
    """

    measure: Measure
    value: NotNegative
    period: Positive | None = None
    damping_ratio: NotNegative | None = None

    @property
    def name(self) -> str:
        """The measure in words, such as "Sa(0.8 s, 5 %)"."""
        if self.measure == "force":
            return "Peak force"
        if self.period is None or self.damping_ratio is None:
            return "PGA"
        return f"Sa({self.period:.3g} s, {100.0 * self.damping_ratio:.3g} %)"

    @property
    def unit(self) -> str:
        """Unit of the value."""
        return "N" if self.measure == "force" else "m/s^2"

    @property
    def shown(self) -> tuple[str, float]:
        """Unit in which tables have it, and the factor to that unit."""
        return ("kN", 1e-3) if self.measure == "force" else ("g", 1.0 / STANDARD_GRAVITY)

    @property
    def in_words(self) -> str:
        """Text such as "0.3 g"."""
        unit, per = self.shown
        return f"{per * self.value:.3g} {unit}"


def spectral_intensity(motion: GroundMotion, period: float, damping: float) -> Intensity:
    """Sa of a motion at a period [s] and a damping ratio."""
    value = float(response_spectrum(motion, [period], damping=damping).pseudo_acceleration[0])
    return Intensity(measure="sa", value=value, period=period, damping_ratio=damping)


def scaled_from(motion: GroundMotion, found: Intensity, value: float) -> GroundMotion:
    """Scale a motion from the intensity `found` to another value [m/s^2]."""
    return scaled_level(motion, found.value, value, "a peak" if found.measure == "pga" else found.name)


TableLimit = Literal["stroke", "velocity", "acceleration"]

# Points per period of the corner frequency: between them the motion is drawn straight, which errs by 0.5 % there.
_TABLE_STEPS = 32
# A motion that was scaled to a limit may exceed it by rounding.
_ROUNDED = 1.0 + 1e-9
# A factor that is told with three digits is not rounded up beyond the limit.
_SAFE = 0.995


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TableDemand(Summarised):
    """Peaks of a motion on a shake table; `limit` is the one nearest, or farthest exceeded, by the `share`."""

    _units: ClassVar[Mapping[str, str]] = {"stroke": "m", "velocity": "m/s", "acceleration": "m/s^2"}

    stroke: float
    velocity: float
    acceleration: float
    limit: TableLimit
    share: float

    @property
    def within(self) -> bool:
        """Whether the table can run the motion."""
        return self.share <= _ROUNDED


@checked
class ShakeTable:
    """A shake table: an actuator with limits and a bandwidth, on which the specimen has no effect.

    The table follows a command as a low-pass filter of second order, `a'' + 2 zeta w a' + w^2 a = w^2 a_command`: at
    the corner frequency its gain is `1 / (2 zeta)`. The limits hold for the motion of the table, from rest in its
    middle. The defaults are our definition of a table of medium size with a specimen of some hundred kilograms; they
    describe no particular machine.

    Parameters
    ----------
    stroke, velocity
        Largest displacement from the middle [m] and largest velocity [m/s].
    acceleration
        Largest acceleration with the specimen [m/s^2]: the force of the actuator over the mass that it moves.
    bandwidth
        Corner frequency [Hz], `w / (2 pi)`.
    damping
        Damping ratio zeta of the low-pass; by default its gain falls without a peak (Butterworth).

    Examples
    --------
    >>> import mrwork as mr
    >>> table = mr.motions.ShakeTable()
    >>> strong = mr.synthetic_motion(peak=6.0)
    >>> table.demand(strong).limit
    'stroke'
    >>> given = table.driven(strong, beyond="scale")
    >>> table.demand(strong).share > 1.0 > given.peak / strong.peak
    True
    """

    stroke: Positive = 0.1
    velocity: Positive = 0.6
    acceleration: Positive = 12.0
    bandwidth: Positive = 30.0
    damping: Annotated[float, Within(above=0.0, below=1.0)] = math.sqrt(0.5)

    @checked
    def demand(self, motion: GroundMotion) -> TableDemand:
        """Demand of a commanded motion on the table, whether the table can run it or not."""
        return self._measure_demand(self._follow(motion))

    @checked
    def driven(self, motion: GroundMotion, *, beyond: Literal["refuse", "scale"] = "refuse") -> GroundMotion:
        """The motion that the specimen gets from a command, of the same length on a finer or equal step.

        Parameters
        ----------
        motion
            The command. Records keep no baseline, and one that drifts takes stroke: see `baseline_corrected` and
            `brought_to_rest`.
        beyond
            What becomes of a motion beyond a limit: "refuse" it, or "scale" it down to the limit; its `changes` then
            name the limit and the factor.

        Raises
        ------
        SettingError
            If the motion exceeds a limit and is not to be scaled, or its step on the table would take too many
            samples.
        """
        result = self._follow(motion)
        taken = self._measure_demand(result)
        if taken.within:
            return result
        limit, most, unit = taken.limit, getattr(self, taken.limit), TableDemand._units[taken.limit]
        if beyond == "refuse":
            raise SettingError(
                f"ground motion {motion.name}: takes a {limit} of {getattr(taken, limit):.3g} {unit}, and the "
                f"table has {most:.3g}; scale the motion by {_SAFE / taken.share:.3g} or less, or set `beyond` "
                "to 'scale'"
            )
        reason = f"scaled to the {limit} of the table, {most:.3g} {unit}"
        smaller = scaled(result, 1.0 / taken.share)
        return replace_samples(result, smaller.acceleration, result.dt, f"{reason}: {smaller.changes[-1]}")

    def _follow(self, motion: GroundMotion) -> GroundMotion:
        """The command after the low-pass, exact for a command that runs straight between its samples."""
        from scipy.signal import lfilter  # slow to load

        refuse_forces(motion, "a shake table")
        times = max(1, math.ceil(_TABLE_STEPS * self.bandwidth * motion.dt * (1.0 - 1e-9)))
        command = resampled(motion, motion.dt / times) if times > 1 else motion
        w = 2.0 * np.pi * self.bandwidth
        # The oscillator of `response_spectrum`, z' = lambda z + a_command; wanted is w^2 times its displacement.
        pole = np.array([w * complex(-self.damping, math.sqrt(1.0 - self.damping**2))])
        decay, first, second = _oscillator_step(pole, command.dt)
        a = command.acceleration
        inputs = np.concatenate(([0.0], first * a[:-1] + second * np.diff(a)))
        state = lfilter([1.0], [1.0, -complex(decay[0])], inputs)
        return replace_samples(
            command,
            np.ascontiguousarray(w * w * state.imag / pole.imag),
            command.dt,
            f"followed by a table of {self.bandwidth:g} Hz",
        )

    def _measure_demand(self, motion: GroundMotion) -> TableDemand:
        peaks: dict[TableLimit, float] = {
            "stroke": float(np.abs(motion.displacement).max()),
            "velocity": float(np.abs(motion.velocity).max()),
            "acceleration": motion.peak,
        }
        shares = {name: peak / getattr(self, name) for name, peak in peaks.items()}
        limit = max(shares, key=lambda name: shares[name])
        return TableDemand(**peaks, limit=limit, share=shares[limit])
