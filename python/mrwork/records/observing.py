"""Observation model of a test from the words of a setting: a moving average that was detected, or given values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import isfinite
from typing import Final

from mrwork.arguments import checked
from mrwork.errors import SettingError
from mrwork.records.damper_test import DamperTest
from mrwork.records.motion import spectrum
from mrwork.records.observation import AS_IT_IS, Observation

DETECT: Final = "detect"
NONE: Final = "none"

_FIELDS: Final = {
    "average": "average_seconds",
    "lowpass": "lowpass_hz",
    "delay": "delay_seconds",
    "gain": "gain",
    "offset": "offset",
}
# Least and largest value of each. An average and a delay are also shorter than the record.
_RANGES: Final = {
    "average": (0.0, 1e6, "s"),
    "lowpass": (1e-3, 1e6, "Hz"),
    "delay": (-1e6, 1e6, "s"),
    "gain": (-1e6, 1e6, ""),
    "offset": (-1e9, 1e9, "N"),
}
VALUES_IN_WORDS: Final = "; ".join(
    f"{name} from {least:g} to {most:g} {unit}".rstrip() for name, (least, most, unit) in _RANGES.items()
)
"""The range of each value, for help."""
# Quantities that may be given as a share of the dominant period.
_OF_PERIOD: Final = ("average", "delay")


def as_words(observe: str | Sequence[str]) -> tuple[str, ...]:
    """The words of an observation setting, checked: `detect`, `none` or WHAT=VALUE each.

    Raises
    ------
    SettingError
        Where there is no word, a word or a value is not understood, or `none` is not alone.
    """
    words = (observe,) if isinstance(observe, str) else tuple(observe)
    if not words or (NONE in words and len(words) > 1):
        raise SettingError(
            f"--observe is {' and '.join(words) or 'empty'}; give {DETECT}, {NONE} alone, or WHAT=VALUE"
        )
    for word in words:
        if word not in (DETECT, NONE):
            _value(word, period=1.0)
    return words


@checked
def observed(test: DamperTest, observe: Sequence[str]) -> DamperTest:
    """The test with the observation model that the words ask for; a model that the test already has is kept.

    `detect` averages over the window that was found in the force of the whole record, see `detect_smoothing`; where
    none was found it has no effect.

    Raises
    ------
    SettingError
        Where a word is not understood, or its value is impossible for this record.
    """
    if test.observation != AS_IT_IS:
        return test
    values: dict[str, float] = {}
    for word in observe:
        if word == DETECT:
            # With a window in the displacement alone, the force was not averaged.
            if test.smoothing is not None and "force" in test.smoothing.channels:
                values["average_seconds"] = test.smoothing.window_seconds
        elif word != NONE:
            name, value = _value(word, period=_period(test) if word.endswith("T") else 1.0)
            if name in _OF_PERIOD and abs(value) >= (duration := (test.n_time - 1) * test.dt):
                raise SettingError(
                    f"{test.label}: --observe is {word!r}, the record lasts {duration:.4g} s; give less"
                )
            values[_FIELDS[name]] = value
    return replace(test, observation=Observation(**values)) if values else test


def _period(test: DamperTest) -> float:
    return 1.0 / (test.frequency or spectrum(test.displacement, test.dt).dominant)


def _value(word: str, *, period: float) -> tuple[str, float]:
    """Name and value of WHAT=VALUE, or WHAT=VALUET with a share of the period [s]."""
    name, _, text = word.partition("=")
    if name not in _FIELDS:
        raise SettingError(
            f"--observe is {word!r}; give {DETECT}, {NONE}, or {', '.join(f'{key}=VALUE' for key in _FIELDS)}"
        )
    share = text.endswith("T") and name in _OF_PERIOD
    try:
        value = float(text[:-1] if share else text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise SettingError(f"{text!r} in --observe {word} is not a number; write it as 0.002, or 0.1T")
    value = value * period if share else value
    least, most, unit = _RANGES[name]
    if not least <= value <= most:
        raise SettingError(f"--observe is {word!r}; give {name} from {least:g} to {most:g} {unit}".rstrip())
    Observation(**{_FIELDS[name]: value})
    return name, value
