"""Detectors of what a recorder does to a signal: spikes, and a moving average.

A spike is a few samples far beyond all others, as of a loose contact or a lost telegram. A moving average leaves nulls
in the spectrum of the noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats
from mrwork.records.damper_test import Channel, DamperTest, Finding, Measured, Smoothing
from mrwork.records.motion import SmoothMotion, spectrum
from mrwork.records.window import Signals

# Samples of the longest spike, and largest share of a record in spikes; what takes longer may be part of the test.
_LONGEST_SPIKE: Final = 5
_MOST: Final = 0.02
_FEWEST: Final = 50
# Percentiles within which a channel lies without its spikes, and the distance beyond, and the leap there and back
# between two samples, of a spike, in ranges between these percentiles. A sine reaches 0.001 beyond.
_WITHIN: Final = (2.0, 98.0)
_BEYOND: Final = 0.5


def spikes_of(samples: Floats) -> NDArray[np.bool_]:
    """Samples of a channel that lie in a spike, shape (n_time,).

    A spike is at most five samples long and lies beyond the range of the other samples by half of that range; the
    channel leaps by as much from one sample to the next, there and back.
    """
    is_spike = np.zeros(samples.size, dtype=np.bool_)
    low, high = np.percentile(samples, _WITHIN)
    reach = _BEYOND * (high - low)
    far = (samples < low - reach) | (samples > high + reach)
    if reach == 0.0 or samples.size < _FEWEST or np.count_nonzero(far) > _MOST * samples.size:
        return is_spike
    edges = np.flatnonzero(np.diff(np.concatenate([[False], far, [False]])))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        leaps = np.abs(np.diff(samples[max(first - 1, 0) : last + 1]))
        there = first == 0 or leaps[0] > reach
        back = last == samples.size or leaps[-1] > reach
        is_spike[first:last] = last - first <= _LONGEST_SPIKE and there and back
    return is_spike


def without_spikes(signals: Signals) -> tuple[Signals, NDArray[np.bool_], tuple[Finding, ...]]:
    """Signals with straight lines across the spikes, except in commands, and which samples these are."""
    bridged = np.zeros(signals.time.size, dtype=np.bool_)
    bridges: dict[str, Any] = {}
    findings = []
    for name, samples in signals.measured.items():
        spiky = spikes_of(samples)
        if not spiky.any():
            continue
        line = np.interp(signals.time, signals.time[~spiky], samples[~spiky])
        findings.append(_finding(name, signals.time[spiky], samples[spiky]))
        bridges[name] = line
        bridged |= spiky
    return replace(signals, **bridges), bridged, tuple(findings)


_SEARCHED: Final = {"displacement": "m", "velocity": "m/s", "force": "N"}


def _finding(name: str, time: Floats, samples: Floats) -> Finding:
    largest = float(samples[np.argmax(np.abs(samples))])
    plural = "a sample" if samples.size == 1 else f"{samples.size} samples, the first"
    return Finding.warning(
        "spikes",
        f"the {name} has spikes to {largest:.4g} {_SEARCHED[name]} in {plural} at {time[0]:.6g} s; they were bridged "
        "by straight lines, and are neither compared nor part of the tested ranges",
        action=f"check the channel of the {name}",
        measured=Measured(value=largest, unit=_SEARCHED[name]),
    )


_DIFFERENCES: Final = 2
_HARMONICS: Final = np.arange(1, 5)
# Shortest window [samples]; with fewer, the only null is at or near the Nyquist frequency, as with a low-pass filter.
_SHORTEST: Final = 4
# A transform of a long signal takes some twenty times as long where its length has a large prime factor.
_LONG: Final = 1 << 16
# Longest window, in periods; longer averages are not used in practice, and harmonics interfere there.
_LONGEST: Final = 0.5
# Least depth relative to that of a moving average; rounding after the average fills the nulls a little. Combs of
# harmonics can reach the same mean depth, but not equally at w and 2 w.
_DEPTH: Final = 0.6
_EACH: Final = (0.5, 1.5)
# In standard deviations of the mean depth due to periodogram scatter.
_SIGNIFICANT: Final = 6.0
# Factor by which a Hann taper raises the variance of the cepstrum, since neighbouring spectral lines are correlated.
_TAPER: Final = 1.94


def detect_smoothing(test: DamperTest, frequency: float | None = None) -> Smoothing | None:
    """Detect a moving average applied to displacement and force of a test; `None` if there is none.

    If the two windows differ, that of the force is returned, which has the higher harmonics. Windows of less than 4
    samples, or of more than an eighth of the record or half a period, cannot be detected, nor any in a record without
    noise. `frequency` is the dominant one of the motion [Hz], where it is known.
    """
    if frequency is None:
        frequency = spectrum(test.displacement, test.dt).dominant
    channels: tuple[tuple[Channel, Floats], ...] = (
        ("force", test.force),
        ("displacement", test.displacement),
    )
    windows = {name: detect_average(samples) for name, samples in channels}
    period = round(1.0 / (frequency * test.dt))
    for name, n_window in windows.items():
        if n_window is not None and n_window > _LONGEST * period:
            windows[name] = None
    if len(set(windows.values())) > 1:
        # A pulse in every cycle has the spectrum of an average; the difference between cycles does not contain it.
        for name, samples in channels:
            if detect_average(samples[period:] - samples[:-period]) != windows[name]:
                windows[name] = None
    seen = [n_window for n_window in windows.values() if n_window is not None]
    if not seen:
        return None
    return Smoothing(
        window_seconds=seen[0] * test.dt,
        kind="moving_average",
        channels=tuple(name for name, n_window in windows.items() if n_window == seen[0]),
    )


def smoothing_finding(test: DamperTest, motion: SmoothMotion) -> Iterator[Finding]:
    """Warn of a moving average, with the fraction of a cycle that it covers."""
    smoothing = test.smoothing
    if smoothing is None:
        return
    window = smoothing.window_seconds
    share = window * motion.frequency
    message = (
        f"{' and '.join(smoothing.channels)} passed a moving average over {1e3 * window:.4g} ms "
        f"({round(window / test.dt)} samples, {share:.2g} of the dominant period), which rounds the corners of the loop"
    )
    measured = Measured(value=window, standard_error=test.dt, unit="s")
    if "force" in smoothing.channels:
        message += "; identify applies the same average to the model's force"
        yield Finding.note("moving_average", message, measured=measured)
    else:
        action = "use the original record, for the force shows none"
        yield Finding.warning("moving_average", message, action=action, measured=measured)


def detect_average(samples: Floats) -> int | None:
    """Window in samples of a moving average applied to a signal, shape (n_time,); `None` if there is none.

    A moving average over w samples multiplies the spectrum by sin(pi f w dt) / (w sin(pi f dt)), which is
    zero at every multiple of 1/(w dt). In the logarithm of the power, log |1 - exp(-i w omega)|^2
    = -2 sum_j cos(j w omega) / j, so the cepstrum has spikes of -1/j at j w (Bogert, Healy and Tukey 1963). Their depth
    does not depend on the level or colour of the noise, and the cepstrum of smooth spectra is concentrated near the
    origin. The spikes at w, 2 w, 3 w and 4 w are combined. Odd harmonics of a motion of period T are distinguished by
    their alternating sign at multiples of T/2.
    """
    samples = samples[: _transformed_length(samples.size)]
    windows = np.arange(_SHORTEST, (samples.size // 2 - 2) // int(_HARMONICS[-1]))
    if windows.size == 0:
        return None
    cepstrum = _cepstrum(samples)
    spikes = np.zeros_like(cepstrum)
    spikes[1:-1] = 0.5 * (cepstrum[:-2] + cepstrum[2:]) - cepstrum[1:-1]
    weight = 1.0 / _HARMONICS
    depth = spikes[_HARMONICS * windows[:, np.newaxis]] @ weight / np.sum(weight**2)
    best = int(np.argmax(depth))
    # A log periodogram has the variance pi^2 / 6; the difference from the mean of two neighbours has 1.5 times that.
    scatter = np.pi * np.sqrt(_TAPER * 1.5 / (6.0 * samples.size * np.sum(weight**2)))
    deep = depth[best] > max(_DEPTH, _SIGNIFICANT * scatter)
    window = int(windows[best])
    each = spikes[window * _HARMONICS[:2]] * _HARMONICS[:2]
    alike = bool(np.all((each > _EACH[0]) & (each < _EACH[1])))
    # The edge of a steep low-pass filter gives a wave in the cepstrum, not a spike.
    beside = np.abs(spikes[window + 2 : min(2 * window - 1, window + 6)])
    return window if deep and alike and beside.max() < _EACH[0] else None


def _transformed_length(n_time: int) -> int:
    """Samples of a signal whose cepstrum is looked at: of a long one, so many that the Fourier transform is fast."""
    if n_time < _LONG:
        return n_time
    # An even length without prime factors above 5, of the differences.
    n_odd: list[int] = [3**three * 5**five for three in range(20) for five in range(14)]
    left = n_time - _DIFFERENCES
    return _DIFFERENCES + max(odd << ((left // odd).bit_length() - 1) for odd in n_odd if 2 * odd <= left)


def _cepstrum(samples: Floats) -> Floats:
    """Power cepstrum of a signal, for quefrencies from 0 to half its number of samples."""
    # Differences raise the noise to the level of the motion; their own cepstrum, -1/k each, is added back.
    steep = np.diff(samples, _DIFFERENCES)
    power = np.abs(np.fft.rfft((steep - steep.mean()) * np.hanning(steep.size))) ** 2
    # Of an arc without noise all differences are zero.
    floor = max(float(np.finfo(np.float64).eps ** 2 * power.max()), float(np.finfo(np.float64).tiny))
    cepstrum = np.fft.irfft(np.log(np.maximum(power, floor)))[: samples.size // 2 - 1]
    cepstrum[1:] += _DIFFERENCES / np.arange(1, cepstrum.size)
    return np.asarray(cepstrum, dtype=np.float64)
