"""Stability margins of the linear loop of a gain, with the sampling, the delay and the drivers of a study."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import NotNegative, Positive, checked
from mrwork.base.summary import Summarised, Summary
from mrwork.base.values import Floats, array_dataclass
from mrwork.control.linear.plant import Plant, hold_input
from mrwork.errors import SettingError

Complexes = NDArray[np.complex128]

# States of the sampled loop with its chain of past commands up to which its poles are found.
_MOST_STATES = 1200
_FREQUENCIES = 2000
# Decay of a pole in a sample below which it is rounding, and a gain below which the loop counts as open.
_NO_DECAY, _LEAST_GAIN = 1e-12, 1e-6
# Frequencies that are evaluated together, for the memory.
_AT_ONCE = 2048
# Places about each pole, in half widths of its resonance.
_ABOUT = np.sinh(np.linspace(-6.0, 6.0, 61))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DeviceMargins(Summarised):
    """Margins of the loop broken at the force of one device.

    The loop reaches its limit of stability if its gain is multiplied by `gain_up` or `gain_down`, if `phase` [degrees]
    is taken from it, or if `delay` [s] is added; infinite, or 0 for `gain_down`, where no such change does. The
    frequencies [Hz] belong to the oscillation that begins; NaN where there is none.
    """

    _made_by: ClassVar[str] = "mr.control.loop_margins(plant, gain)"

    device: str
    gain_up: float
    gain_up_frequency: float
    gain_down: float
    phase: float
    phase_frequency: float
    delay: float

    @property
    def in_words(self) -> str:
        """Gain as a factor and in dB, phase in degrees, with their frequencies, and delay, in words."""
        parts = []
        if math.isfinite(self.gain_up):
            decibels = 20.0 * math.log10(self.gain_up)
            parts.append(f"gain x{self.gain_up:.3g} ({decibels:.3g} dB) at {self.gain_up_frequency:.3g} Hz")
        else:
            parts.append("gain without limit")
        if self.gain_down > 0.0:
            parts.append(f"down to x{self.gain_down:.3g}")
        if math.isfinite(self.phase):
            parts.append(f"phase {self.phase:.3g} degrees at {self.phase_frequency:.3g} Hz")
            parts.append(f"delay {1e3 * self.delay:.3g} ms")
        else:
            parts.append("phase and delay without limit, since its gain is below 1 at all frequencies")
        return f"{self.device}: {', '.join(parts)}"

    def _summary(self) -> Summary:
        return Summary(title="Stability margins", notes=(self.in_words,))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LoopMargins(Summarised):
    """Margins of a linear loop at each device; none if the loop is not stable.

    `sample_time` and `delay` [s] belong to the loop; `driver_rates` [1/s] are the rates of the lags of the drivers,
    `None` for a driver without lag.
    """

    _made_by: ClassVar[str] = "mr.control.loop_margins(plant, gain)"

    sample_time: float
    delay: float
    driver_rates: tuple[float | None, ...]
    stable: bool
    devices: tuple[DeviceMargins, ...]

    @property
    def in_words(self) -> str:
        """Sentences on the margins, their loop, and what they do not cover."""
        rates = dict.fromkeys(self.driver_rates)
        lags = ", ".join("no lag" if rate is None else f"lag {rate:.3g} 1/s" for rate in rates)
        loop = f"samples of {1e3 * self.sample_time:g} ms, delay {1e3 * self.delay:g} ms, driver with {lags}"
        if not self.stable:
            return (
                f"The linear loop of this gain is not stable with the hardware of the study ({loop}), so it has no "
                "margins."
            )
        others = ", the loops of the others closed" if len(self.devices) > 1 else ""
        margins = "; ".join(device.in_words for device in self.devices)
        return (
            f"Margins of the linear loop, broken at the force of a device{others} ({loop}): {margins}. Ideal forces of "
            "either sign; clipping, saturation and the force of the damper at i = 0 are not covered."
        )

    def _summary(self) -> Summary:
        return Summary(title="Stability margins", notes=(self.in_words,))


@checked
def loop_margins(
    plant: Plant,
    gain: Floats,
    *,
    sample_time: Positive = 1e-3,
    delay: NotNegative = 0.0,
    driver_rates: Sequence[Positive | None] = (),
) -> LoopMargins:
    """Gain, phase and delay margin of `f_c = -K s` at the force of each device, in the sampled loop.

    Between samples the command is held and the driver lags, `f' = rate (f_c - f)`; the transition over a sample is
    exact. With the loops of the other devices closed, `L = H_jj - H_jo (1 + H_oo)^-1 H_oj` of `H = K (z - F)^-1 G(z)`
    is the transfer around the break at device j. Where L crosses the negative real axis, -1 / L is a gain margin; where
    `|L|` = 1, its angle from -1 is a phase margin, and that angle over the frequency a delay margin (Astrom and Murray,
    Feedback Systems, 2008, sect. 9.3). The observer of a study measures the forces, so that, but for their
    sampling, the loop with it has the same margins.

    Parameters
    ----------
    gain
        K [N/m and N s/m], shape (n_devices, 2n).
    sample_time, delay
        Of the loop [s].
    driver_rates
        Rate of the lag of the driver of each device [1/s]; none by default.

    Raises
    ------
    SettingError
        If the gain has another shape.

    Examples
    --------
    >>> import mrwork as mr
    >>> frame = mr.building("uts")
    >>> plant = mr.control.plant_of(frame, frame.storeys[:1])
    >>> regulator = mr.control.regulator_of_outputs(plant, mr.control.drifts(plant), 1.0, 1e-11)
    >>> mr.control.loop_margins(plant, regulator.gain).devices[0].phase > 60.0
    True
    """
    K = np.asarray(gain, dtype=np.float64)
    m = plant.n_devices
    if K.shape != (m, 2 * plant.n_coordinates):
        raise SettingError(f"`gain` has shape {K.shape}; give {(m, 2 * plant.n_coordinates)}")
    rates = tuple(driver_rates) or (None,) * m
    if len(rates) != m:
        raise SettingError(
            f"`driver_rates` has {len(rates)} rates, and there are {m} devices; give one for each"
        )
    loop = _SampledLoop.of(plant, K, sample_time, delay, rates)
    stable, poles = loop.closed_poles()
    devices: tuple[DeviceMargins, ...] = ()
    if stable:
        angles = loop.angles(poles)
        devices = tuple(
            _margins(name, sample_time, partial(loop.transfer, device=number), angles)
            for number, name in enumerate(plant.device_names)
        )
    return LoopMargins(
        sample_time=sample_time, delay=delay, driver_rates=rates, stable=stable, devices=devices
    )


@array_dataclass()
class _SampledLoop:
    """`x_{k+1} = F x_k + G_new u_{k-d} + G_old u_{k-d-1}` with u = -K x, and its modes F V = V diag(poles)."""

    F: Floats
    G_new: Floats
    G_old: Floats
    K: Floats
    delay: int
    poles: Complexes
    seen: Complexes
    pushed: tuple[Complexes, Complexes]

    @staticmethod
    def of(
        plant: Plant, gain: Floats, sample_time: float, delay: float, rates: Sequence[float | None]
    ) -> _SampledLoop:
        T = plant.scaling
        A: Floats = np.linalg.solve(T, plant.A @ T).astype(np.float64)
        B: Floats = np.linalg.solve(T, plant.B).astype(np.float64)
        K = gain @ T
        lagged = [number for number, rate in enumerate(rates) if rate is not None]
        lag = np.array([rate for rate in rates if rate is not None])
        n, m = B.shape
        A = np.block([[A, B[:, lagged]], [np.zeros((len(lagged), n)), -np.diag(lag)]])
        B = np.vstack([B, np.zeros((len(lagged), m))])
        B[:n, lagged] = 0.0
        B[n + np.arange(len(lagged)), lagged] = lag
        K = np.hstack([K, np.zeros((m, len(lagged)))])
        whole = math.floor(delay / sample_time + 1e-9)
        rest = max(0.0, delay - whole * sample_time)
        F, held = hold_input(A, B, sample_time)
        newest = hold_input(A, B, sample_time - rest)[1]
        poles, V = np.linalg.eig(F)
        try:
            pushed = np.linalg.solve(V, np.hstack([newest, held - newest]).astype(np.complex128))
        except np.linalg.LinAlgError as error:
            raise SettingError(
                "the building has a motion without stiffness and damping, and its loop no margins; give it either"
            ) from error
        return _SampledLoop(
            F=F,
            G_new=newest,
            G_old=held - newest,
            K=K,
            delay=whole,
            poles=poles.astype(np.complex128),
            seen=K @ V,
            pushed=(pushed[:, :m], pushed[:, m:]),
        )

    def closed_poles(self) -> tuple[bool, Complexes]:
        """Whether the closed loop is stable, and its poles."""
        n, m = self.G_new.shape
        past = self.delay + 1
        if n + past * m > _MOST_STATES:
            raise SettingError(
                f"the loop has {n + past * m} states with its past commands; margins are found up to {_MOST_STATES}"
            )
        closed = np.zeros((n + past * m, n + past * m))
        closed[:n, :n] = self.F
        # The chain has the newest command last; the command of this sample enters behind it.
        inputs = np.zeros((n, (past + 1) * m))
        inputs[:, : 2 * m] = np.hstack([self.G_old, self.G_new])
        closed[:n, n:] = inputs[:, : past * m]
        closed[:n, :n] -= inputs[:, past * m :] @ self.K
        closed[n : n + (past - 1) * m, n + m :] = np.eye((past - 1) * m)
        closed[n + (past - 1) * m :, :n] = -self.K
        poles = np.linalg.eigvals(closed).astype(np.complex128)
        return bool(np.abs(poles).max() < 1.0 - _NO_DECAY), poles

    def angles(self, closed: Complexes) -> Floats:
        """Angles of z between 0 and pi, dense about the poles of the open and of the closed loop, shape (n,)."""
        logarithms = np.log(np.concatenate([self.poles, closed[np.abs(closed) > 1e-3]]))
        near = np.abs(logarithms.imag)[:, None] + np.abs(logarithms.real)[:, None] * _ABOUT
        slowest = max(float(np.abs(np.log(self.poles)).min()), 1e-9)
        wide = np.geomspace(1e-3 * slowest, np.pi, _FREQUENCIES)
        every = np.unique(np.concatenate([near.ravel(), wide]))
        return np.asarray(every[(every > 0.0) & (every < np.pi)])

    def transfer(self, angles: Floats, device: int) -> Complexes:
        """L at the break of a device, in the shape of the angles, the loops of the others closed."""
        points = np.ravel(angles)
        parts = [self._transfer(points[n : n + _AT_ONCE], device) for n in range(0, points.size, _AT_ONCE)]
        return np.concatenate(parts).reshape(np.shape(angles))

    def _transfer(self, angles: Floats, device: int) -> Complexes:
        z = np.exp(1j * angles)
        new, old = self.pushed
        # At a pole, to rounding, it is infinite.
        with np.errstate(divide="ignore", invalid="ignore"):
            modes = self.seen[None, :, :] / (z[:, None, None] - self.poles)
            H = (modes @ new + modes @ old / z[:, None, None]) * (z**-self.delay)[:, None, None]
        others = [number for number in range(len(self.K)) if number != device]
        L: Complexes = H[:, device, device]
        if others:
            closed = np.eye(len(others)) + H[:, others][:, :, others]
            back = np.linalg.solve(closed, H[:, others, device][:, :, None])[:, :, 0]
            L = L - np.einsum("ki,ki->k", H[:, device][:, others], back)
        return L


def _margins(
    name: str, sample_time: float, transfer: Callable[[Floats], Complexes], angles: Floats
) -> DeviceMargins:
    L = transfer(angles)
    to_hertz = 1.0 / (2.0 * np.pi * sample_time)
    crossings = list(_roots(lambda angle: float(transfer(np.array(angle)).imag), angles, L.imag))
    # At both ends the transfer is real.
    points = [(angle, float(transfer(np.array(angle)).real)) for angle in (*crossings, 0.0, np.pi)]
    factors = [(-1.0 / value, angle) for angle, value in points if math.isfinite(value) and value < 0.0]
    up = min(((k, angle) for k, angle in factors if k > 1.0), default=(math.inf, math.nan))
    down = max((k for k, _ in factors if _LEAST_GAIN < k <= 1.0), default=0.0)
    with np.errstate(divide="ignore"):
        levels = np.log(np.abs(L))
    units = np.array(
        list(_roots(lambda angle: float(np.log(np.abs(transfer(np.array(angle))))), angles, levels))
    )
    turned = np.angle(-transfer(units)) if units.size else np.empty(0)
    nearest = int(np.argmin(np.abs(turned))) if units.size else None
    return DeviceMargins(
        device=name,
        gain_up=float(up[0]),
        gain_up_frequency=float(up[1]) * to_hertz,
        gain_down=float(down),
        phase=math.inf if nearest is None else float(np.degrees(abs(turned[nearest]))),
        phase_frequency=math.nan if nearest is None else float(units[nearest]) * to_hertz,
        delay=float(np.min(np.mod(turned, 2.0 * np.pi) / units, initial=math.inf)) * sample_time,
    )


def _roots(of: Callable[[float], float], angles: Floats, values: Floats) -> Iterable[float]:
    """Angles where a function changes its sign, refined between the given ones."""
    from scipy.optimize import brentq  # takes a quarter of a second to load

    signs = np.sign(values)
    finite = np.isfinite(values)
    for k in np.flatnonzero((signs[1:] != signs[:-1]) & finite[1:] & finite[:-1] & (signs[:-1] != 0.0)):
        yield float(brentq(of, angles[k], angles[k + 1], xtol=1e-15, rtol=1e-12))
