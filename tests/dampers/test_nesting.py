"""Nested models: the points near a simpler model approach its force."""

from __future__ import annotations

import numpy as np
import pytest

from mrwork.dampers import damper
from mrwork.dampers.conversions import NESTINGS, Scales, nesting_of
from mrwork.errors import SimulationError
from mrwork.simulation import Loading, simulate_force

TIME = np.linspace(0.0, 2.0, 2001)
LOADING = Loading(
    dt=1e-3,
    displacement=0.015 * np.sin(5.0 * np.pi * TIME),
    velocity=0.075 * np.pi * np.cos(5.0 * np.pi * TIME),
)
SCALES = Scales(stroke=0.015, speed=0.236, force=1500.0)
# Parameters of simpler models that suit this motion; a stiffness and offsets that no model may lose.
SIMPLER = {
    "bingham": {"f_c": 900.0, "c0": 2500.0, "f0": 50.0, "v_s": 0.08},
    "dahl": {"k_w": 1000.0, "rho": 900.0, "f0": 50.0},
    "viscous_dahl": {"k_x": 2500.0, "k_w": 900.0, "rho": 900.0, "f0": 50.0},
    "normalised_bouc_wen": {
        "c": 2500.0,
        "k": 1500.0,
        "x0": -0.02,
        "k_w": 900.0,
        "rho": 900.0,
        "sigma": 0.8,
        "n": 2.0,
    },
}


def force_of(model: str, values: dict[str, float]) -> np.ndarray:
    spec = damper(model)
    theta = np.clip(
        [values[name] for name in spec.names], *np.transpose([(p.lower, p.upper) for p in spec.parameters])
    )
    return simulate_force(spec, theta, LOADING)


@pytest.mark.parametrize("model", [name for name, each in NESTINGS.items() if each.model in SIMPLER])
def test_the_nearest_point_has_nearly_the_force_of_the_simpler_model(model: str) -> None:
    nesting = NESTINGS[model]
    simpler = SIMPLER[nesting.model]
    expected = force_of(nesting.model, simpler)
    errors = []
    for point in nesting.points(simpler, SCALES):
        try:
            errors.append(np.std(force_of(model, dict(point)) - expected) / np.std(expected))
        except SimulationError:
            errors.append(np.inf)
    assert min(errors) < 0.25
    finite = [error for error in errors if np.isfinite(error)]
    assert finite == sorted(finite, reverse=True)


def test_chains_end_at_models_that_contain_none() -> None:
    for model in NESTINGS:
        seen = [model]
        while (nesting := nesting_of(damper(seen[-1]))) is not None:
            assert nesting.model not in seen
            assert set(nesting.shared) <= set(damper(nesting.model).names) & set(damper(seen[-1]).names)
            seen.append(nesting.model)
        assert nesting_of(damper(seen[-1])) is None
