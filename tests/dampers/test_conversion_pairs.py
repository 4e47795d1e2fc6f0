"""Equivalent forms of a model give equal forces."""

from __future__ import annotations

import numpy as np
import pytest

from mrwork.dampers import bouc_wen_from_normalised, damper, normalised_from_bouc_wen
from mrwork.dampers.conversions import modified_bouc_wen_from_normalised, normalised_from_modified_bouc_wen
from mrwork.simulation import Loading, simulate_force

TIME = np.arange(0.0, 1.0, 1e-3)
LOADING = Loading(dt=1e-3, displacement=0.01 * np.sin(2.0 * np.pi * 2.0 * TIME) * np.exp(-TIME))


PAIRS = {
    "bouc_wen": (normalised_from_bouc_wen, bouc_wen_from_normalised),
    "modified_bouc_wen": (normalised_from_modified_bouc_wen, modified_bouc_wen_from_normalised),
}


@pytest.fixture(params=PAIRS)
def name(request) -> str:
    """Every model with an equivalent form."""
    return request.param


def samples(name: str, count: int) -> np.ndarray:
    """Parameters of the normalised form: c, k, x0, k_w, rho, sigma, n, and c1, k1 if there is a series dashpot."""
    rng = np.random.default_rng(7)
    lower = np.array([1e2, -1e3, -0.05, 50.0, 50.0, 0.5, 1.0])
    upper = np.array([1e4, 1e4, 0.05, 2e3, 2e3, 50.0, 4.0])
    plain = lower + rng.random((count, 7)) * (upper - lower)
    if name == "bouc_wen":
        return plain
    series = [5e3, -1e3] + rng.random((count, 2)) * [5e4, 2e3]
    return np.hstack([np.abs(plain[:, :2]), series, plain[:, 2:]])


def test_there_and_back_is_the_identity(name: str) -> None:
    forth, back = PAIRS[name]
    theta = samples(name, 50)
    np.testing.assert_allclose(forth(back(theta, A=120.0)), theta, rtol=1e-11, atol=1e-14)


def test_both_forms_give_the_same_force(name: str) -> None:
    _, back = PAIRS[name]
    for theta in samples(name, 10):
        normalised = simulate_force(damper(f"normalised_{name}"), theta, LOADING)
        force = simulate_force(damper(name), back(theta, A=35.0), LOADING)
        np.testing.assert_allclose(force, normalised, atol=1e-9 * np.abs(normalised).max())


def test_the_nominal_sets_are_one_published_set(name: str) -> None:
    forth, _ = PAIRS[name]
    theta = forth(damper(name).nominal)
    np.testing.assert_allclose(theta, damper(f"normalised_{name}").nominal, rtol=1e-14)
