"""Observation model of a test from the words of a setting: a moving average that was detected, or given values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isfinite
from typing import Final

from mrwork.arguments import checked
from mrwork.errors import SettingError
from mrwork.records.damper_test import AS_IT_IS, RANGES, DamperTest, Observation
from mrwork.records.motion import spectrum

DETECT: Final = "detect"
NONE: Final = "none"

_FIELDS: Final = {
    "average": "average_seconds",
    "lowpass": "lowpass_hz",
    "delay": "delay_seconds",
    "gain": "gain",
    "offset": "offset",
}
VALUES_IN_WORDS: Final = "; ".join(
    f"{name} from {least:g} to {most:g} {unit}".rstrip()
    for name, (least, most, unit) in ((name, RANGES[field]) for name, field in _FIELDS.items())
)
"""The range of each value, for help."""
# Quantities that may be given as a share of the dominant period.
_OF_PERIOD: Final = ("average", "delay")


def as_words(observe: str | Sequence[str]) -> tuple[str, ...]:
    """The words of an observation setting, checked: `detect`, `none` or WHAT=VALUE each."""
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
        Where a word is not understood, or a value is impossible for this record.
    """
    if test.observation != AS_IT_IS:
        _check_fits(test, test.observation, {})
        return test
    values: dict[str, float] = {}
    said: dict[str, str] = {}
    for word in observe:
        if word == DETECT:
            # With a window in the displacement alone, the force was not averaged.
            if test.smoothing is not None and "force" in test.smoothing.channels:
                values["average_seconds"] = test.smoothing.window_seconds
        elif word != NONE:
            name, value = _value(word, period=_period(test) if word.endswith("T") else 1.0)
            if _FIELDS[name] in values:
                raise SettingError(f"--observe gives {name} twice, the second time as {word!r}; give it once")
            values[_FIELDS[name]] = value
            said[_FIELDS[name]] = f"--observe is {word!r}"
    if not values:
        return test
    observation = Observation(**values)
    _check_fits(test, observation, said)
    return replace(test, observation=observation)


def _check_fits(test: DamperTest, observation: Observation, said: Mapping[str, str]) -> None:
    """Refuse an average or a delay longer than the record, and a filter above what its samples hold."""
    for name in (_FIELDS[each] for each in _OF_PERIOD):
        value, duration = getattr(observation, name), (test.n_time - 1) * test.dt
        if abs(value) >= duration:
            given = said.get(name, f"`{name}` of its observation is {value:g}")
            raise SettingError(f"{test.label}: {given}, the record lasts {duration:.4g} s; give less")
    if observation.lowpass_hz >= (nyquist := 0.5 / test.dt):
        given = said.get("lowpass_hz", f"`lowpass_hz` of its observation is {observation.lowpass_hz:g}")
        raise SettingError(
            f"{test.label}: {given}, and samples every {test.dt:.4g} s hold nothing above {nyquist:.4g} Hz; "
            "give less, or leave it out"
        )


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
    least, most, unit = RANGES[_FIELDS[name]]
    if not least <= value <= most:
        raise SettingError(f"--observe is {word!r}; give {name} from {least:g} to {most:g} {unit}".rstrip())
    Observation(**{_FIELDS[name]: value})
    return name, value
