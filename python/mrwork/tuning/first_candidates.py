"""Candidates that are tried before a search: equal, published and convex weights; else the middle of the ranges."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mrwork.control.law_settings import SETTINGS, RegulatorSettings
from mrwork.control.lqr import PUBLISHED_REGULATORS
from mrwork.control.setting_base import Magnitudes
from mrwork.control.weights import CostWeights
from mrwork.tuning.problem import Bench
from mrwork.tuning.space import LARGEST, Candidate, FreeSetting, SettingSpace

_STEPS = 12
_WEIGHT = "control_weight"


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstCandidate:
    """A candidate and where it is from, in words."""

    candidate: Candidate
    origin: str


def first_candidates(space: SettingSpace, bench: Bench, magnitudes: Magnitudes) -> list[FirstCandidate]:
    """Candidates of a law that are tried before the search, at the largest command of the dampers.

    Weights are only given to laws whose weights the table does not hold. The size of R is scanned for each shape of
    weights: a damper saturates, so no design tells it.
    """
    kind = SETTINGS[space.law]
    middle = {
        each.name: each.value(0.5)
        for each in space.free
        if each.name != LARGEST and not _is_weight(each.name) and each.name != _WEIGHT
    }
    found: list[FirstCandidate] = []

    def add(settings: Mapping[str, Any], origin: str) -> None:
        candidate = Candidate(settings=dict(settings), largest_command=space.largest_command)
        if all(candidate != each.candidate for each in found):
            found.append(FirstCandidate(candidate=candidate, origin=origin))

    scanned = next((each for each in space.free if each.name == _WEIGHT), None)
    for shape, origin in _shapes(space, bench):
        for R in _sizes(scanned, shape, space, magnitudes):
            add({**shape, **middle, **R}, origin)
    if not issubclass(kind, CostWeights):
        add({**space.held, **middle}, "middle of the ranges")
    return found


def _shapes(space: SettingSpace, bench: Bench) -> Iterator[tuple[dict[str, Any], str]]:
    """Weights by name, and where they are from; the first are those that the table holds."""
    kind = SETTINGS[space.law]
    if not issubclass(kind, CostWeights):
        return
    equal = space.held == kind.weighed_by_default
    yield dict(space.held), "equal drift weights" if equal else "weights of the study"
    if not equal:
        return
    others = {name: value for name, value in space.held.items() if not _is_weight(name)}
    yield others, "energy of the building"
    n_floors = len(bench.study.building.floor_names)
    if issubclass(kind, RegulatorSettings):
        for published in PUBLISHED_REGULATORS:
            if published.n_floors == n_floors:
                weights = [0.0] * n_floors
                for floor, weight in published.weighed:
                    weights[floor - 1] = weight
                yield (
                    {**others, "accelerations": tuple(weights), _WEIGHT: published.control_weight},
                    f"published weights {published.name}",
                )


def _sizes(
    scanned: FreeSetting | None, shape: Mapping[str, Any], space: SettingSpace, magnitudes: Magnitudes
) -> list[dict[str, float]]:
    """Sizes of R of a shape of weights, logarithmically over its range; about that of the shape where it has one."""
    kind = SETTINGS[space.law]
    if scanned is None or not issubclass(kind, CostWeights):
        return [{}]
    if _WEIGHT in shape:
        return [{_WEIGHT: _rounded(shape[_WEIGHT] * factor)} for factor in np.geomspace(1e-2, 1e2, 5)]
    # The range of R is that of the weights that are held; another shape costs more or less.
    factor = kind.cost(_weights(shape), magnitudes) / kind.cost(_weights(space.held), magnitudes)
    return [{_WEIGHT: _rounded(factor * scanned.value(step))} for step in np.linspace(0.0, 1.0, _STEPS + 1)]


def _weights(settings: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in settings.items() if _is_weight(name)}


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")


def _is_weight(name: str) -> bool:
    return name in CostWeights.__dataclass_fields__
