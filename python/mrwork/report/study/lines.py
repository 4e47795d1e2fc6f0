"""How the rows of a study are drawn, and how a long history is thinned for a drawing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.report import style
from mrwork.study.results import StudyResults

Floats = NDArray[np.float64]

# They differ in lightness too, as those of `style` do.
_HUES = (style.MODEL, style.RESIDUAL, "#3c8d5a", "#8a5aa8", "#c79a1e", "#3aa0b8", "#a83c5c", "#6b6b2a")
_PATTERNS = ("-", (0, (5, 1.6)), (0, (1.2, 1.4)))
_DOTTED, _DASHED = (0, (1.2, 1.6)), (0, (5, 2))


@dataclass(frozen=True, slots=True, kw_only=True)
class Stroke:
    """Colour, pattern and width [pt] of a row's lines."""

    colour: str
    pattern: str | tuple[int, tuple[float, ...]]
    width: float = 1.4


def strokes(results: StudyResults) -> tuple[Stroke, ...]:
    """One for each row: the building without dampers grey, i = 0 dark, each other row a hue of its own."""
    found: list[Stroke] = []
    number = 0
    for row in results.rows:
        if row.kind == "uncontrolled":
            found.append(Stroke(colour=style.DATA, pattern=_DOTTED, width=1.7))
        elif row.kind == "passive_off":
            found.append(Stroke(colour=style.INK, pattern=_DASHED, width=1.3))
        else:
            pattern = _PATTERNS[(number // len(_HUES)) % len(_PATTERNS)]
            found.append(Stroke(colour=_HUES[number % len(_HUES)], pattern=pattern))
            number += 1
    return tuple(found)


def envelope(time: Floats, signal: Floats, bins: int) -> tuple[Floats, Floats]:
    """The least and the largest of a signal in each of so many stretches of time, in their order: peaks stay."""
    length = len(time) // bins
    if length < 3:
        return time, signal
    whole = length * bins
    parts = signal[:whole].reshape(bins, length)
    at = np.sort(np.stack([parts.argmin(axis=1), parts.argmax(axis=1)], axis=1), axis=1)
    index = np.append((at + length * np.arange(bins)[:, None]).ravel(), np.arange(whole, len(time)))
    return time[index], signal[index]


def strong_part(time: Floats, signal: Floats, seconds: float) -> slice:
    """A stretch around the peak of a signal."""
    at = time[int(np.abs(signal).argmax())]
    end = min(max(at + seconds / 2.0, time[0] + seconds), time[-1])
    first, last = np.searchsorted(time, [end - seconds, end])
    return slice(int(first), int(last) + 1)
