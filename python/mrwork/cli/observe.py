"""Options that say what happened to the force on its way into a record."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import get_args

from mrwork.errors import SettingError
from mrwork.identification.nuisance import NuisanceName
from mrwork.records import DamperTest, Observation
from mrwork.records.detectors.smoothing import detect_smoothing
from mrwork.records.motion import spectrum

_FIELDS = {
    "average": "average_seconds",
    "lowpass": "lowpass_hz",
    "delay": "delay_seconds",
    "gain": "gain",
    "offset": "offset",
}
_DETECT = "detect"


def add_observation(parser: argparse.ArgumentParser) -> None:
    """--observe and --nuisance."""
    parser.add_argument(
        "--observe",
        action="append",
        default=[],
        metavar="WHAT=VALUE",
        help="what the rig did to the force, done to the model's before the two are compared: average=S (or 0.1T, a "
        "share of the period), lowpass=HZ, delay=S, gain=G, offset=N; or detect, which looks for a moving average",
    )
    parser.add_argument(
        "--nuisance",
        action="append",
        default=[],
        choices=get_args(NuisanceName),
        help="what may differ from test to test without being the damper's, estimated from each",
    )


def nuisances_of(options: argparse.Namespace) -> tuple[NuisanceName, ...]:
    """The nuisance parameters asked for, each once."""
    return tuple(name for name in get_args(NuisanceName) if name in options.nuisance)


def observed(test: DamperTest, options: argparse.Namespace) -> DamperTest:
    """The test with the observation model that the command line gives.

    Raises
    ------
    SettingError
        Where an observation is not of the form WHAT=VALUE, or makes no sense.
    """
    values: dict[str, float] = {}
    for text in options.observe:
        if text == _DETECT:
            smoothing = detect_smoothing(test)
            if smoothing is not None:
                values["average_seconds"] = smoothing.window_seconds
            continue
        name, _, value = text.partition("=")
        if name not in _FIELDS:
            raise SettingError(
                f"--observe is {text!r}; give {_DETECT}, or {', '.join(f'{key}=VALUE' for key in _FIELDS)}"
            )
        values[_FIELDS[name]] = _number(value, text, test)
    return replace(test, observation=Observation(**values)) if values else test


def _number(value: str, text: str, test: DamperTest) -> float:
    period = 1.0
    if value.endswith("T") and text.startswith(("average", "delay")):
        frequency = test.frequency or spectrum(test.displacement, test.dt).dominant
        value, period = value[:-1], 1.0 / frequency
    try:
        return float(value) * period
    except ValueError:
        raise SettingError(
            f"{value!r} in --observe {text} is not a number; write it as 0.002, or 0.1T"
        ) from None
