"""Static hysteretic: cubic height, linear damping and width in the current, all tests at once.

Authors: mrwork. Reference: Kwok, Ha, Nguyen, Li, Samali, Sens. Actuators A 132, 2006, 441-451.
"""

from typing import Any

import mrwork as mr

SPEC = mr.damper("static_hysteretic").with_current_laws({"alpha": "cubic", "c": "linear", "delta": "linear"})
N_PARAMS = len(SPEC.names)


def identify(tests: Any, rng: Any) -> Any:
    fit = mr.identify(SPEC, tests, observe="none", rng=int(rng.integers(2**31)))
    return lambda test: test.observation.observe(mr.simulate(fit.spec, fit.theta, test), test.dt)
