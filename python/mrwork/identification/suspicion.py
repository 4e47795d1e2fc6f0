"""What makes the minimum of a search suspicious: simpler descriptions of the same tests that are as good or better."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrwork.records import DamperTest

# A fit whose misfit is not below this share of that of a linear spring and dashpot has lost its non-linear part.
LINEAR_SHARE = 0.98


def linear_misfit(tests: Sequence[DamperTest]) -> float:
    """Misfit of a linear spring and dashpot with an offset, fitted to each test by itself: root mean square NRMSE."""
    return float(np.sqrt(np.mean([_linear_nrmse(test) ** 2 for test in tests])))


def _linear_nrmse(test: DamperTest) -> float:
    counted = test.counted
    force = test.force[counted]
    motion = np.stack([test.displacement, test.velocity, np.ones_like(test.force)], axis=1)[counted]
    scale = np.maximum(np.abs(motion).max(axis=0), np.finfo(np.float64).tiny)
    solution = np.linalg.lstsq(motion / scale, force, rcond=None)[0]
    return float(np.std(force - (motion / scale) @ solution) / np.std(force))


def linear_warning(nrmse: float, tests: Sequence[DamperTest]) -> tuple[str, ...]:
    """A warning where a fit with this misfit is no better than a linear spring and dashpot."""
    linear = linear_misfit(tests)
    if nrmse < LINEAR_SHARE * linear:
        return ()
    return (
        f"the fit, {100.0 * (1.0 - nrmse):.2f} %, is no better than that of a linear spring and dashpot, "
        f"{100.0 * (1.0 - linear):.2f} %: the minimum is false, or this model cannot describe the tests; "
        "try another seed or another model",
    )
