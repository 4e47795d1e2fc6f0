"""A plain search for the settings of a law: a grid at several largest currents, then steps about the best."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from mrwork.closed_loop import Device
from mrwork.control import ControlLaw, Design, DesignProblem, control_law, settings_of
from mrwork.errors import SettingError
from studies.chapter_6.tried_settings import CURRENTS, MANY_CURRENTS, NETWORK, Settings, about, grid
from studies.common.frame import FRAME, LARGEST_CURRENT, LEVELS, Bench, Figures, figures, pair

_STEPS_ABOUT = 48


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuned:
    """Settings of a law with the largest current that it may send [A]."""

    law: str
    settings: Settings
    largest_current: float

    @property
    def device(self) -> Device:
        """The pair that is driven so far and no further, or one actuator in its place."""
        return _device(self.law, self.largest_current)


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """The least score at each level, the settings that have it, and how many were tried.

    `both` is the one set with the least mean over the levels, `both_score` what it has at each.
    """

    at_level: tuple[Tuned, ...]
    scores: tuple[float, ...]
    both: Tuned
    both_score: tuple[float, ...]
    tried: int


def control_law_of(tuned: Tuned, sample_time: float = 1e-3) -> ControlLaw:
    """The law with its finished numbers."""
    return _law(
        tuned.law, [_design(tuned.law, tuned.settings, tuned.largest_current, sample_time)], tuned.device
    )


def search(
    over: Bench,
    law: str,
    *,
    rng: np.random.Generator,
    start: Sequence[Tuned] = (),
    admitted: Callable[[Figures], np.ndarray] = lambda found: np.ones_like(found.score, dtype=bool),
) -> Found:
    """Try the grid at every largest current, then steps about the best of each level, and of both together.

    Parameters
    ----------
    start
        Settings that take the place of the grid, such as those of a similar law.
    admitted
        Whether a candidate is admitted at a level; all are by default.
    """
    chosen = grid(law)
    currents = MANY_CURRENTS if chosen == [{}] else (LARGEST_CURRENT,) if law == "active" else CURRENTS
    first = (
        [(each.largest_current, [each.settings]) for each in start]
        if start
        else [(current, chosen) for current in currents]
    )
    tried, scores = _tried(over, law, first, admitted)
    if chosen != [{}]:
        second: list[tuple[float, Sequence[Settings]]] = []
        for best in {int(place): None for place in (*scores.argmin(axis=0), scores.mean(axis=1).argmin())}:
            settings, current = tried[best].settings, tried[best].largest_current
            near = [current] if law == "active" else [current * factor for factor in (0.7, 0.85, 1.0, 1.2)]
            near = sorted({min(LARGEST_CURRENT, float(f"{value:.3g}")) for value in near})
            second += [
                (value, [settings, *about(settings, _STEPS_ABOUT // len(near), rng)]) for value in near
            ]
        more, more_scores = _tried(over, law, second, admitted)
        tried, scores = tried + more, np.vstack([scores, more_scores])
    best_at = scores.argmin(axis=0)
    both = int(scores.mean(axis=1).argmin())
    return Found(
        at_level=tuple(tried[int(place)] for place in best_at),
        scores=tuple(float(value) for value in scores.min(axis=0)),
        both=tried[both],
        both_score=tuple(float(value) for value in scores[both]),
        tried=len(tried),
    )


def _tried(
    over: Bench,
    law: str,
    batches: Iterable[tuple[float, Sequence[Settings]]],
    admitted: Callable[[Figures], np.ndarray],
) -> tuple[list[Tuned], np.ndarray]:
    """Every setting at its largest current, and its score at each level; those that make no law are left out."""
    tried: list[Tuned] = []
    scores = [np.zeros((0, len(LEVELS)))]
    for current, candidates in batches:
        designs = []
        device = _device(law, current)
        for settings in candidates:
            try:
                designs.append(_design(law, settings, current, 1e-3))
            except SettingError:
                continue
            tried.append(Tuned(law=law, settings=settings, largest_current=current))
        if designs:
            found = figures(over, _law(law, designs, device), device=device)
            scores.append(np.where(admitted(found), found.score, np.inf))
    return tried, np.vstack(scores)


def _design(law: str, settings: Settings, current: float, sample_time: float) -> Design:
    if law == "inverse_network":
        network = tuple((name, value) for name, value in settings.items() if name in NETWORK)
        regulator = {name: value for name, value in settings.items() if name not in NETWORK}
        gains = _design("clipped_optimal", regulator, current, sample_time).gains
        return replace(_trained(network, current, sample_time), gains=gains)
    return settings_of(law, settings).design(_problem(law, current, sample_time))


@cache
def _trained(network: tuple[tuple[str, float], ...], current: float, sample_time: float) -> Design:
    settings = settings_of("inverse_network", {**dict(network), "control_weight": 1e-6})
    return settings.design(_problem("inverse_network", current, sample_time))


def _problem(law: str, current: float, sample_time: float) -> DesignProblem:
    return DesignProblem(building=FRAME, devices=(_device(law, current),), sample_time=sample_time)


def _device(law: str, current: float) -> Device:
    # The ideal force of the place is one actuator's, not shared between two in opposition.
    return replace(pair(current), differential=law != "active")


def _law(name: str, designs: Sequence[Design], device: Device) -> ControlLaw:
    """One candidate for each design; what it looks up is the same for all."""
    gains = {
        gain.name: np.stack([np.asarray(design.gains[gain.name]) for design in designs])
        for gain in control_law(name).gains
    }
    curve = None
    if control_law(name).needs_curve:
        curve = DesignProblem(building=FRAME, devices=(device,), sample_time=1e-3).curve
    return ControlLaw(name=name, gains=gains, tables=designs[0].tables, curve=curve)
