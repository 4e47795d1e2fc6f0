"""Frequency and damping of a mode from the successive extremes of its free vibration (logarithmic decrement)."""

from __future__ import annotations

from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import Positive, Within, checked
from mrwork.buildings.free_vibration import ModeEstimate, fourier_peak, mode_estimate, record_in_band
from mrwork.errors import RecordError, SettingError

Floats = NDArray[np.float64]

# Half width of the parabola fit around an extreme, in periods.
_STRETCH: Final = 1.0 / 8.0
_FEWEST_EXTREMES: Final = 5
_FILTER_ORDER: Final = 3
# Least lower end of a band per half the sampling frequency; below it, the filter is singular to rounding.
_LOWEST: Final = 1e-6
# Settling time of the filter at the ends of the record, in inverse band widths; the rest is below 0.1 %.
_SETTLING: Final = 3.0


@checked
def logarithmic_decrement(
    signal: Floats,
    *,
    dt: Positive,
    band: tuple[float, float] | None = None,
    smallest: Annotated[float, Within(least=0.0, below=1.0)] = 0.05,
) -> ModeEstimate:
    """Estimate frequency and damping of a mode from the extremes of its free vibration.

    The extreme k at time t_k is `offset + (-1)^k a exp(-sigma t_k)`; offset, a and sigma are fitted together. This
    gives the logarithmic decrement `2 pi sigma / omega_d` from all extremes at once, with less weight on those close to
    the noise. The times follow `t_k = t_0 + k pi / omega_d`. Standard errors are those of the two fits.

    Parameters
    ----------
    signal
        Record from the release on, shape (n_time,), in any unit.
    dt
        Sampling step [s].
    band
        Pass band [Hz] around the mode, if the record contains other modes. The filter runs forwards and backwards and
        has no phase shift; its transients at both ends of the record are not used.
    smallest
        Extremes smaller than this fraction of the largest are not used.

    Raises
    ------
    RecordError
        If the record has no peak, or fewer than five clear extremes.
    SettingError
        If the step or the band is invalid.
    """
    signal, limits = record_in_band(signal, dt, band)
    start = fourier_peak(signal, dt=dt, band=band)
    period = 1.0 / start.frequency
    margin = 0.0
    if band is not None:
        from scipy.signal import butter, sosfiltfilt

        nyquist = 0.5 / dt
        if limits[0] < _LOWEST * nyquist:
            raise SettingError(
                f"free vibration: the band begins at {limits[0]:g} Hz, which no filter of samples every {dt:g} s can "
                f"tell from 0; give {_LOWEST * nyquist:.2g} Hz or more"
            )
        sections = butter(
            _FILTER_ORDER,
            (limits[0], min(limits[1], 0.999 * nyquist)),
            btype="bandpass",
            fs=1.0 / dt,
            output="sos",
        )
        signal = sosfiltfilt(sections, signal - signal.mean())
        margin = _SETTLING / (limits[1] - limits[0])
    times, values = _extremes(signal, dt, start, period, margin)
    kept = _n_clear(values, smallest)
    times, values = times[:kept], values[:kept]
    if kept < _FEWEST_EXTREMES:
        raise RecordError(
            f"free vibration: {kept} extremes of the mode at {start.frequency:g} Hz stand out; "
            f"{_FEWEST_EXTREMES} are needed, give a longer or quieter record"
        )
    sides = np.sign(values[0] - values[1]) * (-1.0) ** np.arange(kept)

    def envelope(time: Floats, offset: float, amplitude: float, decay: float) -> Floats:
        return np.asarray(offset + sides * amplitude * np.exp(-decay * time))

    first = (0.0, float(np.ptp(values)) / 2.0, start.decay)
    from scipy.optimize import curve_fit

    fitted, covariance = curve_fit(envelope, times - times[0], values, p0=first)
    residuals = values - envelope(times - times[0], *fitted)
    decay, decay_error = (
        float(fitted[2]),
        float(np.sqrt(covariance[2, 2])) * _correlation_factor(sides * residuals),
    )
    if decay <= 0.0:
        raise RecordError(
            f"free vibration: the extremes of the mode at {start.frequency:g} Hz do not decay; give the record from "
            "the release until it is at rest"
        )
    weights = np.exp(-decay * (times - times[0]))
    (half_period, _), spread = np.polyfit(np.arange(kept), times, 1, w=weights, cov=True)
    late = (times - np.polyval((half_period, _), np.arange(kept))) * weights
    omega = np.pi / half_period
    omega_error = omega / half_period * float(np.sqrt(spread[0, 0])) * _correlation_factor(late)
    return mode_estimate(
        "decrement",
        omega=float(omega),
        omega_error=float(omega_error),
        decay=decay,
        decay_error=decay_error,
        n_extremes=kept,
    )


def _extremes(
    signal: Floats, dt: float, start: ModeEstimate, period: float, margin: float
) -> tuple[Floats, Floats]:
    """Times and values of the extremes: expected from the phase of the mode, refined by a parabola fit."""
    time = dt * np.arange(signal.size)
    omega = 2.0 * np.pi * np.sqrt(1.0 - start.damping_ratio**2) / period
    decaying = np.exp(-start.decay * time)
    shapes = np.stack(
        [decaying * np.cos(omega * time), decaying * np.sin(omega * time), np.ones_like(time)], axis=1
    )
    cosine, sine, _ = np.linalg.lstsq(shapes, signal)[0]
    # The zeros of the derivative of exp(-sigma t) cos(omega t - phase) are half a period apart.
    first = (np.arctan2(sine, cosine) - np.arctan2(start.decay, omega)) / omega
    reach = _STRETCH * period
    earliest, latest = max(margin, reach), time[-1] - max(margin, reach)
    numbers = np.arange(
        np.ceil((earliest - first) / (period / 2.0)), np.floor((latest - first) / (period / 2.0)) + 1
    )
    times, values = [], []
    for middle in first + numbers * np.pi / omega:
        around = np.abs(time - middle) <= reach
        if around.sum() < 3 or not earliest <= middle <= latest:
            continue
        bend, slope, value = np.polyfit(time[around] - middle, signal[around], 2)
        moved = np.clip(-slope / (2.0 * bend), -reach, reach) if bend else 0.0
        times.append(middle + moved)
        # The value at the vertex would be biased outwards by noise, most for small extremes, and the decay too slow.
        values.append(value)
    return np.array(times), np.array(values)


def _n_clear(values: Floats, smallest: float) -> int:
    """Number of extremes before the first that is too small or not alternating."""
    if values.size < 2:
        return int(values.size)
    swings = np.diff(values)
    alternating = np.append(True, np.sign(swings[1:]) == -np.sign(swings[:-1]))
    large = np.abs(swings) >= smallest * np.abs(swings).max()
    clear = alternating & large
    return int(clear.size if clear.all() else clear.argmin()) + 1


def _correlation_factor(residuals: Floats) -> float:
    """Factor on a standard error for correlated residuals (narrow-band noise), from their lag-one correlation."""
    power = float(residuals @ residuals)
    if power == 0.0 or residuals.size < 3:
        return 1.0
    neighbours = float(residuals[1:] @ residuals[:-1]) / power
    correlation = min(max(neighbours, 0.0), 0.9)
    return float(np.sqrt((1.0 + correlation) / (1.0 - correlation)))
