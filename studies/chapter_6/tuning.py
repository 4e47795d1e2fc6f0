"""Settings of a law: those tried, their search (a grid, then steps about its best), and the file of the tuned ones."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain, product
from pathlib import Path

import numpy as np

from mrwork.closed_loop import Device
from mrwork.control import ControlLaw, Design, DesignProblem, control_law, settings_of
from mrwork.errors import SettingError
from studies.former.frame import FRAME, LARGEST_CURRENT, LEVELS, Bench, Figures, figures, level_name, pair

Setting = float | tuple[float, ...]
Settings = Mapping[str, Setting]

CURRENTS = (0.5, 0.8, 1.2, 1.88)
"""Largest currents that are tried with every setting [A]."""
MANY_CURRENTS = tuple(float(current) for current in np.round(np.geomspace(0.15, 1.88, 12), 3))
"""Those tried with laws that have no settings."""

NETWORK = ("amplitude", "velocity", "hidden", "seed")
"""Settings of the training of an inverse network, which learns its damper and does not depend on the regulator."""

# What a regulator weighs, and the middle of the control weights that go with it [1/N^2]: there the outputs cost about
# as much as a force of 1 kN, with drifts of 1 mm, floor velocities of 0.05 m/s, accelerations of 1 m/s^2.
_WEIGHED: tuple[tuple[dict[str, Setting], float], ...] = (
    ({"energy": 1.0}, 1e-6),
    ({"drifts": 1.0}, 1e-12),
    ({"displacements": 1.0}, 1e-11),
    ({"velocities": 1.0}, 1e-8),
    ({"accelerations": 1.0}, 1e-6),
    ({"drifts": 1.0, "accelerations": 1e-7}, 1e-12),
    ({"drifts": 1.0, "accelerations": 1e-6}, 1e-12),
    ({"drifts": 1.0, "velocities": 1e-4}, 1e-12),
    ({"velocities": 1.0, "accelerations": 1e-2}, 1e-8),
)


def grid(law: str) -> list[Settings]:
    """The settings tried first; one empty one for a law that has none."""
    return list(_GRIDS[law]()) if law in _GRIDS else [{}]


def about(settings: Settings, count: int, rng: np.random.Generator) -> list[Settings]:
    """`count` settings about the given ones, every number multiplied by exp(N(0, 0.4^2)); those of a network stay."""
    return [
        {name: value if name in NETWORK else _moved(value, rng) for name, value in settings.items()}
        for _ in range(count)
    ]


def _moved(value: Setting, rng: np.random.Generator) -> Setting:
    if isinstance(value, tuple):
        return tuple(_rounded(number * np.exp(0.4 * rng.standard_normal())) for number in value)
    return _rounded(value * np.exp(0.4 * rng.standard_normal()))


def _rounded(value: float) -> float:
    # Three digits are what a study file would state.
    return float(f"{value:.3g}")


def _every(**values: Iterable[float]) -> Iterator[Settings]:
    """Every combination of the values of each setting, those of the last changing fastest."""
    for chosen in product(*values.values()):
        yield dict(zip(values, map(_rounded, chosen), strict=True))


def _regulators(steps: int = 13, reach: float = 4.0) -> Iterator[Settings]:
    for weighed, middle in _WEIGHED:
        for exponent in np.linspace(-reach, reach, steps):
            yield {**weighed, "control_weight": _rounded(middle * 10.0**exponent)}


def _clipped() -> Iterator[Settings]:
    for settings, force in product(_regulators(7), (300.0, 1000.0, 3000.0)):
        yield {**settings, "full_force": force}


def _lyapunov() -> Iterator[Settings]:
    """Diagonals of Q_P: displacements against velocities, lower floors against upper, and drawn ones."""
    yield {}
    weights = []
    # A displacement beside a velocity counts as the square of the first natural frequency.
    for ratio, slope in product((0.0, 0.1, 1.0, 10.0, 1e3), (-1.0, 0.0, 1.0, 3.0)):
        floors = np.arange(1.0, 6.0) ** slope
        weights.append(np.concatenate([ratio * 355.0 * floors, floors]))
    rng = np.random.default_rng(6)
    weights += [
        10.0**exponents * np.repeat([355.0, 1.0], 5) for exponents in rng.uniform(-2.0, 2.0, (60, 10))
    ]
    for weight in weights:
        yield {"state_weight": tuple(_rounded(value) for value in weight)}


_GRIDS: dict[str, Callable[[], Iterable[Settings]]] = {
    **dict.fromkeys(("clipped_optimal", "inverse_direct", "inverse_parabola", "active"), _regulators),
    **dict.fromkeys(("modified_clipped_optimal", "proportional_clipped_optimal"), _clipped),
    **dict.fromkeys(
        ("lyapunov", "lyapunov_direct", "lyapunov_parabola", "lyapunov_direct_bang_bang"), _lyapunov
    ),
    "modulated_homogeneous_friction": lambda: _every(slope=np.geomspace(2e4, 2e7, 25)),
    "sliding_mode": lambda: _every(
        peak_acceleration=np.geomspace(0.02, 10.0, 14),
        bandwidth=(10.0, 30.0, 100.0, 180.0),
        largest_force=[2000.0],
    ),
    "adaptive_sliding_mode": lambda: _every(
        peak_acceleration=np.geomspace(0.02, 5.0, 8),
        bandwidth=(10.0, 50.0, 150.0),
        largest_force=(300.0, 1000.0, 3000.0),
    ),
    "super_twisting": lambda: _every(
        peak_acceleration=np.geomspace(1e-3, 10.0, 14),
        frequency=(0.2, 1.0, 5.0, 20.0),
        largest_force=[2000.0],
    ),
    "fuzzy": lambda: _every(deformation=np.geomspace(5e-4, 0.5, 10), rate=np.geomspace(1e-3, 1.0, 10)),
    "proportional_direct": lambda: chain(
        _every(slope=np.geomspace(1e-6, 1.0, 25)),
        _every(slope=np.geomspace(1e-6, 1e2, 17), control_weight=(1e-8, 1e-7, 1e-6, 1e-5)),
    ),
    "inverse_network": lambda: (
        {**settings, "amplitude": 0.01, "velocity": 0.25} for settings in _regulators()
    ),
}


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


KEPT = Path(__file__).parent / "tuned.toml"


def kept(path: Path = KEPT) -> dict[str, tuple[Tuned, ...]]:
    """By law, what was tuned at each level."""
    tables = tomllib.loads(path.read_text())
    return {
        law: tuple(
            Tuned(
                # The ideal force is kept twice, without and with a limit.
                law="active" if law.startswith("active") else law,
                settings={
                    name: tuple(value) if isinstance(value, list) else value
                    for name, value in levels[level_name(level)]["settings"].items()
                },
                largest_current=levels[level_name(level)]["largest_current"],
            )
            for level in LEVELS
        )
        for law, levels in tables.items()
    }


_HEADING = "# Found by `study.py --tune`: the least score at each level; largest currents in amperes."


def keep(found: Mapping[str, Found], path: Path = KEPT) -> None:
    """Write what was found; the tables of other laws stay as they are."""
    by_law: dict[str, list[str]] = {}
    for table in path.read_text().rstrip("\n").split("\n\n")[1:] if path.exists() else []:
        by_law.setdefault(table[1:].partition(".")[0], []).append(table)
    for law, each in found.items():
        by_law[law] = list(_tables(law, each))
    path.write_text("\n\n".join([_HEADING, *(table for law in by_law.values() for table in law)]) + "\n")


def _tables(law: str, found: Found) -> Iterator[str]:
    for level, tuned, score in zip(LEVELS, found.at_level, found.scores, strict=True):
        settings = ", ".join(f"{name} = {_written(value)}" for name, value in tuned.settings.items())
        yield "\n".join(
            [
                f'[{law}."{level_name(level)}"] # {score:.4f}, the best of {found.tried}; one setting for both levels: '
                + (" and ".join(f"{value:.4f}" for value in found.both_score)),
                f"largest_current = {tuned.largest_current:g}",
                f"settings = {{ {settings} }}" if settings else "settings = {}",
            ]
        )


def _written(value: Setting) -> str:
    return f"[{', '.join(map(repr, value))}]" if isinstance(value, tuple) else repr(value)
