"""Whether somebody smoothed a record by a moving average before it came to us, seen in what its noise lacks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.records.damper_test import DamperTest, Finding, Measured
from mrwork.records.motion import spectrum

Channel = Literal["displacement", "force"]

_DIFFERENCES: Final = 2
_HARMONICS: Final = np.arange(1, 5)
# One sample less and the spectrum of the noise has a single null, at the Nyquist frequency or near it, that a
# low-pass filter makes as well.
_SHORTEST: Final = 4
# Of a period. Nobody averages over more, and harmonics repeat themselves there.
_LONGEST: Final = 0.5
# Of the depth that a moving average gives; what the noise is averaged over before it is rounded again fills the
# nulls a little. Combs of harmonics can be as deep in the mean, but not at w and 2 w alike.
_DEPTH: Final = 0.6
_EACH: Final = (0.5, 1.5)
# Standard deviations of the mean depth, from periodogram scatter alone.
_SIGNIFICANT: Final = 6.0
# A Hann taper raises the variance of the cepstrum, for neighbouring lines of the spectrum scatter together.
_TAPER: Final = 1.94


@dataclass(frozen=True, slots=True, kw_only=True)
class Smoothing:
    """A moving average over `window_seconds` [s] that the named channels passed before they were recorded."""

    window_seconds: float
    kind: Literal["moving_average"]
    channels: tuple[Channel, ...]


def detect_smoothing(test: DamperTest) -> Smoothing | None:
    """Moving average that displacement and force of a test passed, or `None` where none is seen.

    Where the two were averaged over different windows, that of the force is given, which has the higher
    harmonics. A window of less than 4 samples, or of more than an eighth of the record or half a period, is
    not seen; nor is one in a record without noise.
    """
    channels: tuple[tuple[Channel, NDArray[np.float64]], ...] = (
        ("force", test.force),
        ("displacement", test.displacement),
    )
    windows = {name: averaged_over(samples) for name, samples in channels}
    period = round(1.0 / (spectrum(test.displacement, test.dt).dominant * test.dt))
    for name, n_window in windows.items():
        if n_window is not None and n_window > _LONGEST * period:
            windows[name] = None
    if len(set(windows.values())) > 1:
        # A pulse in every cycle has the spectrum of an average; what differs from cycle to cycle has not.
        for name, samples in channels:
            if averaged_over(samples[period:] - samples[:-period]) != windows[name]:
                windows[name] = None
    seen = [n_window for n_window in windows.values() if n_window is not None]
    if not seen:
        return None
    return Smoothing(
        window_seconds=seen[0] * test.dt,
        kind="moving_average",
        channels=tuple(name for name, n_window in windows.items() if n_window == seen[0]),
    )


def smoothing_finding(test: DamperTest) -> tuple[Finding, ...]:
    """Note a moving average, and how much of a cycle it covers."""
    smoothing = detect_smoothing(test)
    if smoothing is None:
        return ()
    window = smoothing.window_seconds
    share = window * spectrum(test.displacement, test.dt).dominant
    message = (
        f"{' and '.join(smoothing.channels)} passed a moving average over {1e3 * window:.4g} ms "
        f"({round(window / test.dt)} samples, {share:.2g} of the dominant period), which rounds the corners of "
        "the loop; a model is to be compared after the same average, or use the record as measured"
    )
    measured = Measured(value=window, standard_error=test.dt, unit="s")
    return (Finding(code="moving_average", severity="warning", message=message, measured=measured),)


def averaged_over(samples: NDArray[np.float64]) -> int | None:
    """Count the samples of the moving average that a signal of shape (n_time,) passed; `None` if it did not.

    A moving average over w samples multiplies the spectrum by sin(pi f w dt) / (w sin(pi f dt)), which is
    null at every multiple of 1/(w dt). In the logarithm of the power, log |1 - exp(-i w omega)|^2
    = -2 sum_j cos(j w omega) / j, so the cepstrum has spikes of -1/j at j w (Bogert, Healy and Tukey 1963): of
    known depth, whatever the noise and its colour, while smooth spectra stay near the origin. The spikes are
    weighed at w, 2 w, 3 w, 4 w. Odd harmonics of a motion of period T alternate in sign at multiples of T/2,
    which tells them apart.
    """
    windows = np.arange(_SHORTEST, (samples.size // 2 - 2) // int(_HARMONICS[-1]))
    if windows.size == 0:
        return None
    cepstrum = _cepstrum(samples)
    spikes = np.zeros_like(cepstrum)
    spikes[1:-1] = 0.5 * (cepstrum[:-2] + cepstrum[2:]) - cepstrum[1:-1]
    weight = 1.0 / _HARMONICS
    depth = spikes[_HARMONICS * windows[:, np.newaxis]] @ weight / np.sum(weight**2)
    best = int(np.argmax(depth))
    # The log of a periodogram scatters by pi / sqrt(6); the contrast with two neighbours adds half as much again.
    scatter = np.pi * np.sqrt(_TAPER * 1.5 / (6.0 * samples.size * np.sum(weight**2)))
    deep = depth[best] > max(_DEPTH, _SIGNIFICANT * scatter)
    window = int(windows[best])
    each = spikes[window * _HARMONICS[:2]] * _HARMONICS[:2]
    alike = bool(np.all((each > _EACH[0]) & (each < _EACH[1])))
    # The edge of a steep low-pass filter is a wave in the cepstrum, not a spike.
    beside = np.abs(spikes[window + 2 : min(2 * window - 1, window + 6)])
    return window if deep and alike and beside.max() < _EACH[0] else None


def _cepstrum(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cepstrum of the power of a signal, for quefrencies of 0 to half its samples."""
    # Differences bring the noise up to the motion; their own cepstrum, -1/k each, is added back.
    steep = np.diff(samples, _DIFFERENCES)
    power = np.abs(np.fft.rfft((steep - steep.mean()) * np.hanning(steep.size))) ** 2
    floor = np.finfo(np.float64).eps ** 2 * power.max()
    cepstrum = np.fft.irfft(np.log(np.maximum(power, floor)))[: samples.size // 2 - 1]
    cepstrum[1:] += _DIFFERENCES / np.arange(1, cepstrum.size)
    return np.asarray(cepstrum, dtype=np.float64)
