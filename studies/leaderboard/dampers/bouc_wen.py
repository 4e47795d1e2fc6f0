"""Normalised Bouc-Wen: cubic yield force and linear viscous damping in the current, all tests at once.

Authors: mrwork. Reference: Ikhouane, Rodellar, Systems with Hysteresis, Wiley, 2007.
"""

from typing import Any

import mrwork as mr

SPEC = mr.damper("normalised_bouc_wen").with_current_laws({"k_w": "cubic", "c": "linear"})
N_PARAMS = len(SPEC.names)


def identify(tests: Any, rng: Any) -> Any:
    fit = mr.identify(SPEC, tests, observe="none", rng=int(rng.integers(2**31)))
    return lambda test: test.observation.observe(mr.simulate(fit.spec, fit.theta, test), test.dt)
