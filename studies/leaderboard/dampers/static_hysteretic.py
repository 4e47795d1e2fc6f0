"""Static hysteretic: cubic height, linear damping and width in the current, all tests at once.

Authors: mrwork. Reference: Kwok, Ha, Nguyen, Li, Samali, Sens. Actuators A 132, 2006, 441-451.
"""

import mrwork as mr
from studies.leaderboard.entries import Predict, Rng, Tests, recorded_force

SPEC = mr.damper("static_hysteretic").with_current_laws({"alpha": "cubic", "c": "linear", "delta": "linear"})
N_PARAMS = len(SPEC.names)


def identify(tests: Tests, rng: Rng) -> Predict:
    fit = mr.identify(SPEC, tests, observe="none", rng=int(rng.integers(2**31)))
    return lambda test: recorded_force(fit.spec, fit.theta, test)
