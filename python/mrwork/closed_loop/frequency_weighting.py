"""Frequency weighting of vibration that people feel: the filter W_k of ISO 2631-1, as ISO 8041-1 defines it."""

from __future__ import annotations

from typing import Final, Literal

import numpy as np

from mrwork.base.arguments import Positive, checked
from mrwork.base.values import Floats
from mrwork.errors import SettingError

Weighting = Literal["wk"]
"""Frequency weighting: W_k of vertical vibration through seat or feet."""

# f1 to f6 [Hz] of each weighting, and Q4, Q5 and Q6.
_STAGES: Final[dict[Weighting, tuple[tuple[float, ...], tuple[float, ...]]]] = {
    "wk": ((0.4, 100.0, 12.5, 12.5, 2.37, 3.35), (0.63, 0.91, 0.91)),
}
# Q of a Butterworth filter.
_FLAT: Final = 0.5**0.5


@checked
def frequency_weighted(
    acceleration: Floats,
    dt: Positive,
    weighting: Weighting = "wk",
) -> Floats:
    """The acceleration behind the filter W_k, whose rms is that of ISO 2631-1.

    The filter is the product of four stages over s = 2 pi i f (ISO 8041-1:2017, 5.6 and table 3): a high pass
    `s^2 / (s^2 + sqrt(2) w1 s + w1^2)` at 0.4 Hz and a low pass `w2^2 / (s^2 + sqrt(2) w2 s + w2^2)` at 100 Hz, the
    transition `(w4^2 / w3) (s + w3) / (s^2 + w4 / Q4 s + w4^2)` at 12.5 Hz, Q4 = 0.63, and the upward step
    `(s^2 + w5 / Q5 s + w5^2) / (s^2 + w6 / Q6 s + w6^2)` from 2.37 to 3.35 Hz, Q5 = Q6 = 0.91. It is applied exactly to
    straight lines between the samples, from rest.

    Parameters
    ----------
    acceleration
        Acceleration [m/s^2], shape (n_time,) or (n_time, n): as `History.acceleration`, or a column of it.
    dt
        Time between two samples [s], 1 ms or less for a W_k that is right up to 100 Hz.

    Returns
    -------
    array
        Weighted acceleration [m/s^2], of the shape of `acceleration`.

    Examples
    --------
    >>> import numpy as np
    >>> time = 0.001 * np.arange(20_000)
    >>> weighted = frequency_weighted(np.sin(2.0 * np.pi * 8.0 * time), 0.001)
    >>> round(float(np.sqrt(2.0 * np.mean(weighted[5000:] ** 2))), 2)
    1.04
    """
    from scipy.signal import lfilter  # slow to load

    if not acceleration.size:
        raise SettingError("`acceleration` has no samples; give a history")
    poles, residues = _partial_fractions(weighting)
    weighted = np.zeros_like(acceleration)
    for pole, residue in zip(poles, residues, strict=True):
        z = np.exp(pole * dt)
        # Of a straight line over a step: the share of its end, and the share of its start.
        end = (z - 1.0 - pole * dt) / (pole**2 * dt)
        start = (z - 1.0) / pole - end
        rest = -end * acceleration[:1]
        states = lfilter([end, start], [1.0, -z], acceleration.astype(np.complex128), axis=0, zi=rest)[0]
        weighted += 2.0 * (residue * states).real
    return weighted


def _partial_fractions(weighting: Weighting) -> tuple[list[complex], list[complex]]:
    """Poles of the upper half plane [rad/s] and their residues: the filter is the sum with the conjugate ones."""
    frequencies, (q4, q5, q6) = _STAGES[weighting]
    w1, w2, w3, w4, w5, w6 = (2.0 * np.pi * frequency for frequency in frequencies)
    high, low, transition, step = (
        np.poly1d([1.0, w / q, w**2]) for w, q in ((w1, _FLAT), (w2, _FLAT), (w4, q4), (w6, q6))
    )
    above = np.poly1d([w2**2, 0.0, 0.0]) * np.poly1d([w4**2 / w3, w4**2]) * np.poly1d([1.0, w5 / q5, w5**2])
    slope = (high * low * transition * step).deriv()
    roots = [complex(root) for stage in (high, low, transition, step) for root in stage.roots]
    poles = [root for root in roots if root.imag > 0.0]
    return poles, [complex(above(pole) / slope(pole)) for pole in poles]
