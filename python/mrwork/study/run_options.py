"""Arguments of functions that are slow to load, of which the help of the command line reads range and meaning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated

from mrwork.base.arguments import Level, Seed
from mrwork.base.hints import Says, Within

StudySeed = Annotated[Seed, Says("seed of noise and synthetic motions")]
CheckStep = Annotated[bool, Says("repeat every run with half the integration step at the end, and compare")]
FragilityLimit = Annotated[
    Mapping[str, float | str] | None,
    Says(
        "criterion and its limit, a number in SI or with a unit, as in peak_drift_ratio=1%; default: limit of [report] "
        "or drift_limit of [building] of the study, else collapse, peak_drift_ratio=10%"
    ),
]
BandLevel = Annotated[Level, Says("level of the bands")]
ModellingDispersion = Annotated[
    float, Within(least=0.0, most=10.0), Says("standard deviation of the logarithm that models add")
]
TunedLaws = Annotated[
    Sequence[str],
    Says("tune this law with all keys of [[tune]] at their defaults, instead of the tables of the study"),
]
