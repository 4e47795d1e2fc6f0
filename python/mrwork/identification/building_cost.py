"""What a fitted damper costs in the simulation of a building: integration steps that its states want."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from mrwork.dampers.spec import DamperSpec
from mrwork.identification.fit import NEGLIGIBLE, Fit
from mrwork.records import DamperTest
from mrwork.simulate import loading_of, stiffness_shares
from mrwork.summary import listed

# Sample time of the loop [s] and its integration steps, as studies have by default; the most steps of a sample of a
# test, of which the stiffness of a candidate is a share; and the most doublings in the loop.
_SAMPLE, _FEWEST, _MOST_IN_TEST, _MOST_FACTOR = 1e-3, 2, 256, 256
MANY = 16
"""Steps a sample from which on a study takes so much longer that a fit says so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildingCost:
    """Integration steps that a damper wants in a building, a sample of 1 ms, under the motion of its tests.

    It is infinite where no number of steps resolves it. Damper and building are simulated with the same steps.
    """

    steps: float

    @classmethod
    def of(cls, spec: DamperSpec, theta: ArrayLike, tests: Sequence[DamperTest]) -> BuildingCost:
        """The cost by the stiffest test; the loop finds its steps by the same rule from the motion of the building."""
        wanted = [
            _MOST_IN_TEST
            * float(stiffness_shares(spec, np.atleast_2d(theta), loading_of(test, spec).history())[0])
            * (_SAMPLE / test.dt)
            for test in tests
        ]
        if not all(map(isfinite, wanted)):
            return cls(steps=np.inf)
        steps = _FEWEST
        while steps < max(wanted):
            steps *= 2
        return cls(steps=steps if steps <= _MOST_FACTOR * _FEWEST else np.inf)

    @property
    def is_high(self) -> bool:
        """Whether a study takes several times as long as with a model without states."""
        return self.steps >= MANY

    @property
    def in_words(self) -> str:
        """As in "about 64 integration steps a sample of 1 ms in a building"."""
        if not isfinite(self.steps):
            return f"more than {_MOST_FACTOR * _FEWEST} integration steps a sample of 1 ms in a building"
        return f"about {self.steps:.0f} integration steps a sample of 1 ms in a building"


def cost_warning(fit: Fit, cost: BuildingCost, cheap: Sequence[Fit]) -> str:
    """A sentence on a fit with a high cost; it names the best of the fits of `cheap` models to the same tests."""
    at_bound = [each.name for each in fit.estimates if each.remark in ("at lower bound", "at upper bound")]
    causes = f", with {listed(at_bound)} on a bound" if at_bound else ""
    least = f"where a model without states takes {_FEWEST}"
    return f"the fit takes {cost.in_words}{causes}, {least}; {_remedy(fit, cheap)}"


def _remedy(fit: Fit, cheap: Sequence[Fit]) -> str:
    if not cheap:
        return "compare it with models without states before a study uses it"
    most = max(each.fit_percent for each in cheap)
    as_good = [each for each in cheap if each.fit_percent >= most - NEGLIGIBLE]
    best = min(as_good, key=lambda each: len(each.estimates))
    both = f"{best.fit_percent:.2f} % against {fit.fit_percent:.2f} %"
    if best.fit_percent < fit.fit_percent - NEGLIGIBLE:
        return f"of the models without states {best.model} comes nearest ({both})"
    as_well = "better" if best.fit_percent > fit.fit_percent + NEGLIGIBLE else "as well"
    return (
        f"{best.model}, which has no states, fits {as_well} ({both}): use it in studies of the tested range"
    )
