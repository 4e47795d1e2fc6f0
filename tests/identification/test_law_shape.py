"""A fit with laws through logarithms says where the same laws through the values themselves are far better."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

import mrwork as mr
from mrwork.dampers import LawName
from mrwork.identification import Fit
from mrwork.records import DamperTest, build_damper_test

DT = 4e-3
NOISE_N = 8.0
PLAIN = mr.damper("static_hysteretic")
# The yield force of the RD-1005-3 of Kwok et al. 2006: 32 N at 0 A, and 28 times as much at 1.5 A.
POLYNOMIAL = (32.0, 583.25, 860.0)
# Any curve through logarithms.
CURVED = (150.0, 450.0, 800.0)
FIXED = {"x_s": (1e-4, 1e-4)}
LEVELS = np.array([0.0, 0.75, 1.5])


def record(
    alpha: tuple[float, float, float], command: NDArray[np.float64] | float, law: LawName, rng: int = 0
) -> DamperTest:
    time = DT * np.arange(800)
    omega = 4.0 * np.pi
    displacement, velocity = 0.01 * np.sin(omega * time), 0.01 * omega * np.cos(omega * time)
    values = {"c": 1500.0, "k": 4000.0, "beta": 100.0, "delta": 0.6, "x_s": 1e-4, "f0": 50.0}
    spec = PLAIN.with_current_laws({"alpha": law})
    theta = [
        alpha[LEVELS.tolist().index(each.coefficient.command)]
        if each.coefficient is not None and each.coefficient.command is not None
        else values[each.plain_name]
        for each in spec.parameters
    ]
    loading = mr.Loading(
        dt=DT, displacement=displacement, velocity=velocity, command=command, command_unit="A"
    )
    force = mr.simulate_force(spec, np.array(theta), loading)
    return build_damper_test(
        name=f"record {rng}",
        time=time,
        displacement=displacement,
        velocity=velocity,
        force=force + NOISE_N * np.random.default_rng(rng).standard_normal(time.size),
        current=command,
    )


def steps() -> NDArray[np.float64]:
    """A command that stays for 0.2 s at one of the levels or between them."""
    return np.random.default_rng(4).uniform(0.0, 1.5, 100)[(DT * np.arange(800) / 0.2).astype(int)]


@cache
def fit_of(alpha: tuple[float, float, float], law: LawName, true_law: LawName, *, varying: bool) -> Fit:
    commands = [steps()] if varying else [0.0, 0.4, 0.75, 1.1, 1.5]
    tests = [record(alpha, command, true_law, rng) for rng, command in enumerate(commands)]
    return mr.identify(PLAIN.with_current_laws({"alpha": law}), tests, bounds=FIXED, threads=1)


def advice(fit: Fit) -> list[str]:
    return [each for each in fit.warnings if "laws through the values themselves" in each]


@pytest.mark.parametrize("varying", [False, True])
def test_a_yield_force_that_is_a_polynomial_is_advised_the_law_through_its_values(varying: bool) -> None:
    through, logarithms = "quadratic:0,0.75,1.5", "values:0,0.75,1.5"
    fit = fit_of(POLYNOMIAL, logarithms, through, varying=varying)
    (sentence,) = advice(fit)
    assert sentence.endswith(f"give alpha={through} as laws")
    advised = fit_of(POLYNOMIAL, through, through, varying=varying)
    assert advised.rmse_n == pytest.approx(NOISE_N, rel=0.1)
    assert fit.rmse_n > 1.25 * advised.rmse_n
    promised = float(sentence.partition("better: ")[2].split()[0])
    # The promise is of the cycles that the search compares.
    assert promised == pytest.approx(advised.fit_percent, abs=0.1)
    assert not advice(advised)


@pytest.mark.parametrize("varying", [False, True])
def test_laws_through_logarithms_that_describe_the_tests_are_not_doubted(varying: bool) -> None:
    logarithms = "values:0,0.75,1.5"
    fit = fit_of(CURVED, logarithms, logarithms, varying=varying)
    assert fit.rmse_n == pytest.approx(NOISE_N, rel=0.1)
    assert not advice(fit)
