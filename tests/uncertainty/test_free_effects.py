"""A mass that was fitted with the parameters is as unknown to profiles, posteriors and plans as to the fit."""

import numpy as np
import pytest

import mrwork as mr
from mrwork.uncertainty import Candidate

MASS, STIFFNESS = 40.0, 1900.0


@pytest.fixture(scope="module")
def tests() -> list[mr.DamperTest]:
    """Spring, dashpot and tanh friction beside a mass: three cycles at three frequencies, with noise of 4 N."""
    made = []
    motions = ((0.02, 1.0), (0.01, 1.4), (0.015, 1.2))
    for number, (amplitude, frequency) in enumerate(motions):
        time, omega = np.arange(0.0, 3.0 / frequency, 0.01 / frequency), 2.0 * np.pi * frequency
        x, v = amplitude * np.sin(omega * time), amplitude * omega * np.cos(omega * time)
        force = STIFFNESS * x + 3000.0 * v + 700.0 * np.tanh(v / 0.03 + x / 0.02) - MASS * omega**2 * x
        force += 4.0 * np.random.default_rng(number).standard_normal(time.size)
        made.append(mr.test_from_arrays(time, x, force, velocity=v, name=f"{frequency:g} Hz"))
    return made


@pytest.fixture(scope="module")
def fit(tests: list[mr.DamperTest]) -> mr.Fit:
    return mr.identify("hyperbolic_tangent_gavin", tests, observe="mass=free", rng=1, threads=1)


def test_profile_posterior_and_plan_have_the_errors_of_the_fit(
    tests: list[mr.DamperTest], fit: mr.Fit
) -> None:
    errors = {estimate.name: estimate.standard_error or np.nan for estimate in fit.fitted}
    given = mr.identify(fit.spec, tests, observe=f"mass={fit.effects[0].value}", rng=1, threads=1)
    assert (given.parameters["k0"].standard_error or np.nan) < 0.5 * errors["k0"]
    profiles = {each.name: each for each in mr.profile(fit, tests, threads=1).profiles}
    draws = mr.sample(fit, tests, most_steps=300, walkers=24, rng=1, threads=1)
    summaries = {summary.name: summary for summary in draws.summaries}
    for name, true in (("force_mass", MASS), ("k0", STIFFNESS)):
        lower, upper = profiles[name].interval.lower, profiles[name].interval.upper
        assert lower is not None
        assert upper is not None
        assert lower < true < upper
        assert upper - lower == pytest.approx(2.0 * 1.96 * summaries[name].deviation, rel=0.2)
    # The error of the mass, which the stiffness shares, is of leaving out tests, too.
    assert summaries["k0"].deviation < errors["k0"]
    assert summaries["force_mass"].deviation < errors["force_mass"]
    assert draws.theta.shape[1] == len(fit.theta) == draws.with_effects.shape[1] - 1
    plan = mr.plan(fit, tests, [Candidate(amplitude=0.01, frequency=3.0)], band="k0", threads=1)
    assert plan.deviation == pytest.approx(summaries["k0"].deviation, rel=0.2)
    tree = mr.uncertainty.inference_data(draws, fit, tests, most_draws=24, threads=1)
    assert "force_mass" in tree["posterior"]
