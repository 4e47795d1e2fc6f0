"""Regularised Bingham: quadratic yield force and linear viscous damping in the current, all tests at once.

Authors: mrwork. Reference: Stanway, Sproston, Stevens, J. Electrostat. 20(2), 1987, 167-184.
"""

from typing import Any

import mrwork as mr

SPEC = mr.damper("bingham").with_current_laws({"f_c": "quadratic", "c0": "linear"})
N_PARAMS = len(SPEC.names)


def identify(tests: Any, rng: Any) -> Any:
    fit = mr.identify(SPEC, tests, observe="none", rng=int(rng.integers(2**31)))
    return lambda test: test.observation.observe(mr.simulate(fit.spec, fit.theta, test), test.dt)
