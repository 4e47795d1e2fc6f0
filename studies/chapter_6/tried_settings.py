"""Settings that the search tries for each law, as `mrwork respond` takes them: a grid, then steps about its best."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import product

import numpy as np

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
    # A displacement beside a velocity counts as the square of the first natural frequency.
    for ratio, slope in product((0.0, 0.1, 1.0, 10.0, 1e3), (-1.0, 0.0, 1.0, 3.0)):
        floors = np.arange(1.0, 6.0) ** slope
        weight = np.concatenate([ratio * 355.0 * floors, floors])
        yield {"state_weight": tuple(_rounded(value) for value in weight)}
    rng = np.random.default_rng(6)
    for exponents in rng.uniform(-2.0, 2.0, (60, 10)):
        weight = 10.0**exponents * np.repeat([355.0, 1.0], 5)
        yield {"state_weight": tuple(_rounded(value) for value in weight)}


def _proportional() -> Iterator[Settings]:
    for slope in np.geomspace(1e-6, 1.0, 25):
        yield {"slope": _rounded(slope)}
    for slope, control_weight in product(np.geomspace(1e-6, 1e2, 17), (1e-8, 1e-7, 1e-6, 1e-5)):
        yield {"slope": _rounded(slope), "control_weight": control_weight}


def _sliding() -> Iterator[Settings]:
    for peak, bandwidth in product(np.geomspace(0.02, 10.0, 14), (10.0, 30.0, 100.0, 180.0)):
        yield {"peak_acceleration": _rounded(peak), "bandwidth": bandwidth, "largest_force": 2000.0}


def _adaptive() -> Iterator[Settings]:
    for peak, bandwidth, force in product(
        np.geomspace(0.02, 5.0, 8), (10.0, 50.0, 150.0), (300.0, 1000.0, 3000.0)
    ):
        yield {"peak_acceleration": _rounded(peak), "bandwidth": bandwidth, "largest_force": force}


def _super_twisting() -> Iterator[Settings]:
    for peak, frequency in product(np.geomspace(1e-3, 10.0, 14), (0.2, 1.0, 5.0, 20.0)):
        yield {"peak_acceleration": _rounded(peak), "frequency": frequency, "largest_force": 2000.0}


def _friction() -> Iterator[Settings]:
    for slope in np.geomspace(2e4, 2e7, 25):
        yield {"slope": _rounded(slope)}


def _fuzzy() -> Iterator[Settings]:
    for deformation, rate in product(np.geomspace(5e-4, 0.5, 10), np.geomspace(1e-3, 1.0, 10)):
        yield {"deformation": _rounded(deformation), "rate": _rounded(rate)}


def _network() -> Iterator[Settings]:
    for settings in _regulators():
        yield {**settings, "amplitude": 0.01, "velocity": 0.25}


_GRIDS: dict[str, Callable[[], Iterator[Settings]]] = {
    "clipped_optimal": _regulators,
    "modified_clipped_optimal": _clipped,
    "proportional_clipped_optimal": _clipped,
    "lyapunov": _lyapunov,
    "modulated_homogeneous_friction": _friction,
    "sliding_mode": _sliding,
    "adaptive_sliding_mode": _adaptive,
    "super_twisting": _super_twisting,
    "fuzzy": _fuzzy,
    "lyapunov_direct": _lyapunov,
    "lyapunov_parabola": _lyapunov,
    "lyapunov_direct_bang_bang": _lyapunov,
    "proportional_direct": _proportional,
    "inverse_direct": _regulators,
    "inverse_parabola": _regulators,
    "inverse_network": _network,
    "active": _regulators,
}
