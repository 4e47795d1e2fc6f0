"""What speaks against the choice of a fit, in laws and models alike; it is asked before the best is taken."""

from __future__ import annotations

from collections.abc import Sequence

from mrwork.base.values import Floats
from mrwork.dampers.spec import DamperSpec, law_limits
from mrwork.identification.result import BuildingCost
from mrwork.records import DamperTest
from mrwork.records.damper_test import range_of_tests


def objections_to(
    spec: DamperSpec, theta: Floats, tests: Sequence[DamperTest], cost: BuildingCost
) -> tuple[str, ...]:
    """Why the parameters, shape (n_params,), are not to be chosen while others are left; a sentence each.

    A positive parameter whose law leaves its range or vanishes within the tested commands: beyond the tested velocities
    such a law has no damping or stiffness left. And a damper that no building can be simulated with. That an exponent
    is on its bound, as n = 1 of a Bouc-Wen loop, is none.
    """
    tested = range_of_tests(tests, None if spec.current is None else spec.current.unit)
    limits = law_limits(spec, theta, tested.command) if tested.command is not None else ()
    positive = {each.name for each in spec.plain if each.scale == "log"}
    dying = tuple(each.in_words for each in limits if each.parameter in positive)
    return dying if cost.is_possible else (*dying, f"it takes {cost.in_words}")
