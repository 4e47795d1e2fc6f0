"""Shake table: the motion that a specimen gets from a command, and the limits of the actuator."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.arguments import Positive, Within, checked
from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion, changed, resampled, scaled
from mrwork.motions.spectrum import oscillator_step
from mrwork.summary import Summarised

TableLimit = Literal["stroke", "velocity", "acceleration"]

# Points per period of the corner frequency: between them the motion is drawn straight, which errs by 0.5 % there.
_PER_PERIOD = 32
# A motion that was scaled to a limit may exceed it by rounding.
_ROUNDED = 1.0 + 1e-9
# A factor that is told with three digits is not rounded up beyond the limit.
_SAFE = 0.995
_UNITS: dict[TableLimit, str] = {"stroke": "m", "velocity": "m/s", "acceleration": "m/s^2"}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TableDemand(Summarised):
    """What a motion takes of a shake table: peaks of its displacement, velocity and acceleration.

    `limit` is the one that is nearest, or farthest exceeded, and `share` the peak over it.
    """

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
@dataclass(frozen=True, slots=True, kw_only=True)
class ShakeTable:
    """A shake table: an actuator with limits and a bandwidth, on which the specimen has no effect.

    The table follows a command as a low-pass filter of second order, `a'' + 2 zeta w a' + w^2 a = w^2 a_command`: at
    the corner frequency its gain is `1 / (2 zeta)`. The limits hold for what the table does, from rest in its middle.
    The defaults are our definition of a table of medium size with a specimen of some hundred kilograms; they are those
    of no particular machine.

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

    _made_by: ClassVar[str] = "mr.motions.ShakeTable(stroke=...)"

    stroke: Positive = 0.1
    velocity: Positive = 0.6
    acceleration: Positive = 12.0
    bandwidth: Positive = 30.0
    damping: Annotated[float, Within(above=0.0, below=1.0)] = math.sqrt(0.5)

    @checked
    def gain(self, frequency: ArrayLike) -> NDArray[np.complex128]:
        """Complex gain from the commanded to the given acceleration, in the shape of `frequency` [Hz]."""
        ratio = np.asarray(frequency, dtype=np.float64) / self.bandwidth
        return np.asarray(1.0 / (1.0 - ratio**2 + 2j * self.damping * ratio), dtype=np.complex128)

    @checked
    def demand(self, motion: GroundMotion) -> TableDemand:
        """What a commanded motion takes of the table, whether the table can run it or not."""
        return self._taken_by(self._followed(motion))

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
        given = self._followed(motion)
        taken = self._taken_by(given)
        if taken.within:
            return given
        limit, most = taken.limit, getattr(self, taken.limit)
        if beyond == "refuse":
            raise SettingError(
                f"ground motion {motion.name}: takes a {limit} of {getattr(taken, limit):.3g} {_UNITS[limit]}, and the "
                f"table has {most:.3g}; scale the motion by {_SAFE / taken.share:.3g} or less, or set `beyond` "
                "to 'scale'"
            )
        reason = f"scaled to the {limit} of the table, {most:.3g} {_UNITS[limit]}"
        smaller = scaled(given, 1.0 / taken.share)
        return changed(given, smaller.acceleration, given.dt, f"{reason}: {smaller.changes[-1]}")

    def _followed(self, motion: GroundMotion) -> GroundMotion:
        """The command after the low-pass, exact for a command that runs straight between its samples."""
        from scipy.signal import lfilter  # slow to load

        times = max(1, math.ceil(_PER_PERIOD * self.bandwidth * motion.dt * (1.0 - 1e-9)))
        command = resampled(motion, motion.dt / times) if times > 1 else motion
        w = 2.0 * np.pi * self.bandwidth
        # The oscillator of `response_spectrum`, z' = lambda z + a_command; wanted is w^2 times its displacement.
        pole = np.array([w * complex(-self.damping, math.sqrt(1.0 - self.damping**2))])
        decay, first, second = oscillator_step(pole, command.dt)
        a = command.acceleration
        inputs = np.concatenate(([0.0], first * a[:-1] + second * np.diff(a)))
        state = lfilter([1.0], [1.0, -complex(decay[0])], inputs)
        return changed(
            command,
            np.ascontiguousarray(w * w * state.imag / pole.imag),
            command.dt,
            f"followed by a table of {self.bandwidth:g} Hz",
        )

    def _taken_by(self, given: GroundMotion) -> TableDemand:
        peaks: dict[TableLimit, float] = {
            "stroke": float(np.abs(given.displacement).max()),
            "velocity": float(np.abs(given.velocity).max()),
            "acceleration": given.peak,
        }
        shares = {name: peak / getattr(self, name) for name, peak in peaks.items()}
        limit = max(shares, key=lambda name: shares[name])
        return TableDemand(**peaks, limit=limit, share=shares[limit])
