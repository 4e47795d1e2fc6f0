"""Equivalent forms of a model give equal forces."""

from __future__ import annotations

import numpy as np

from mrwork.convert import bouc_wen_from_normalised, normalised_from_bouc_wen
from mrwork.simulate import Loading, simulate_force
from mrwork.spec import damper

TIME = np.arange(0.0, 1.0, 1e-3)
LOADING = Loading(dt=1e-3, displacement=0.01 * np.sin(2.0 * np.pi * 2.0 * TIME) * np.exp(-TIME))


def samples(count: int) -> np.ndarray:
    rng = np.random.default_rng(7)
    lower = np.array([1e2, -1e3, -0.05, 50.0, 50.0, 0.5, 1.0])
    upper = np.array([1e4, 1e4, 0.05, 2e3, 2e3, 50.0, 4.0])
    return lower + rng.random((count, 7)) * (upper - lower)


def test_there_and_back_is_the_identity() -> None:
    theta = samples(50)
    back = normalised_from_bouc_wen(bouc_wen_from_normalised(theta, A=120.0))
    np.testing.assert_allclose(back, theta, rtol=1e-11, atol=1e-14)


def test_both_forms_give_the_same_force() -> None:
    for theta in samples(10):
        spencer = bouc_wen_from_normalised(theta, A=35.0)
        normalised = simulate_force(damper("normalised_bouc_wen"), theta, LOADING)
        force = simulate_force(damper("bouc_wen"), spencer, LOADING)
        np.testing.assert_allclose(force, normalised, atol=1e-9 * np.abs(normalised).max())


def test_the_nominal_sets_are_one_published_set() -> None:
    spencer, normalised = damper("bouc_wen").nominal, damper("normalised_bouc_wen").nominal
    np.testing.assert_allclose(normalised_from_bouc_wen(spencer), normalised, rtol=1e-14)
