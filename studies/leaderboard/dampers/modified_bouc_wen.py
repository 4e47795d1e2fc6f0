"""Normalised modified Bouc-Wen: six parameters follow the current, all tests at once.

Authors: mrwork. Reference: Spencer, Dyke, Sain, Carlson, J. Eng. Mech. 123(3), 1997, 230-238; the laws are those of
studies/one_model_for_a_rig.
"""

from typing import Any

import mrwork as mr

SPEC = mr.damper("normalised_modified_bouc_wen").with_current_laws(
    {"k_w": "cubic", "c0": "quadratic", "c1": "quadratic", "rho": "quadratic", "n": "linear", "k1": "linear"}
)
N_PARAMS = len(SPEC.names)


def identify(tests: Any, rng: Any) -> Any:
    fit = mr.identify(SPEC, tests, observe="none", rng=int(rng.integers(2**31)))
    return lambda test: test.observation.observe(mr.simulate(fit.spec, fit.theta, test), test.dt)
