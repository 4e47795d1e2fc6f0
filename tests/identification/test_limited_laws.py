"""A minimum whose law is limited to the range of its parameter is searched again from laws that are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sinusoidal_tests import sinusoidal_test

import mrwork as mr
from mrwork.dampers import damper
from mrwork.dampers.spec import law_limits
from mrwork.identification import Fit, Multistart
from mrwork.identification.equivalent import leaves_range, within_range

COMMANDS = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
# All its starts end where the yield force is limited to its lower bound at one of the commands.
SHORT = Multistart(samples=2, starts=2, least_rounds=1, most_rounds=1, found=1)


def fit_of(yield_forces: tuple[float, ...]) -> Fit:
    """A quadratic law for yield forces at five commands, which no quadratic law follows."""
    tests = [
        replace(
            sinusoidal_test("dahl", (force, 2000.0, 0.0), (0.010, 1.0), noise=0.02, rng=seed),
            current=float(command),
            name=f"{command} A",
        )
        for seed, (force, command) in enumerate(zip(yield_forces, COMMANDS, strict=True))
    ]
    spec = damper("dahl").with_current_laws({"k_w": "quadratic"})
    return mr.identify(spec, tests, bounds={"f0": (0.0, 0.0)}, search=SHORT, threads=1)


@pytest.mark.parametrize(
    ("yield_forces", "least"),
    [((41.5, 41.6, 65.3, 343.9, 1516.5), 0.4159), ((33.2, 46.0, 51.3, 301.8, 1213.5), 0.4639)],
)
def test_a_false_minimum_with_a_limited_law_is_left(yield_forces: tuple[float, ...], least: float) -> None:
    """The least misfits are those of 150 local minimisations from random starts, on the same tests."""
    fit = fit_of(yield_forces)
    assert fit.nrmse == pytest.approx(least, rel=2e-3)
    assert not law_limits(fit.spec, np.array(fit.theta), (0.0, 1.0))


def test_where_the_least_misfit_has_a_limited_law_the_fit_says_so() -> None:
    fit = fit_of((418.5, 62.0, 688.8, 53.0, 919.6))
    assert any("within the tested commands, 0 to 1 A: choose another law" in each for each in fit.warnings)


@pytest.mark.parametrize("law", ["quadratic:0,0.5,1", "quadratic", "exponential"])
def test_laws_are_moved_into_their_ranges_and_others_stay(law: str) -> None:
    spec = damper("viscous_dahl").with_current_laws({"k_w": law, "k_x": "linear:0,1"})
    limited = {"quadratic:0,0.5,1": (40.0, 5.0, 900.0), "quadratic": (40.0, -1000.0, 1860.0)}
    coefficients = limited.get(law, (-50.0, 10.0, 2.0))
    theta = np.array([700.0, 300.0, *coefficients, 2000.0, 20.0])
    assert leaves_range(spec, theta, COMMANDS) == ("k_w",)
    moved = within_range(spec, theta, COMMANDS)
    assert not leaves_range(spec, moved, COMMANDS)
    assert moved[[0, 1, 5, 6]].tolist() == theta[[0, 1, 5, 6]].tolist()
    assert within_range(spec, moved, COMMANDS).tolist() == moved.tolist()
