"""Regularised Bingham: quadratic yield force and linear viscous damping in the current, all tests at once.

Authors: mrwork. Reference: Stanway, Sproston, Stevens, J. Electrostat. 20(2), 1987, 167-184.
"""

import mrwork as mr
from studies.leaderboard.entries import Predict, Rng, Tests, recorded_force

SPEC = mr.damper("bingham").with_current_laws({"f_c": "quadratic", "c0": "linear"})
N_PARAMS = len(SPEC.names)


def identify(tests: Tests, rng: Rng) -> Predict:
    fit = mr.identify(SPEC, tests, observe="none", rng=int(rng.integers(2**31)))
    return lambda test: recorded_force(fit.spec, fit.theta, test)
