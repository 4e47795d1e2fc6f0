"""A comparison whose chosen family is costly in a building names the best one that is not."""

from __future__ import annotations

import math

from mrwork.identification.result import BuildingCost
from mrwork.uncertainty.choice.ranking import Evidence, cost_remark, rank

FOLDS = (0.070, 0.071, 0.072, 0.073)


def family(model: str, n_params: int, behind: float) -> Evidence:
    """A family whose NRMSE on every fold is that much larger."""
    return Evidence(
        model=model,
        title=model.title(),
        n_params=n_params,
        status="converged",
        seconds=1.0,
        fit_percent=92.0,
        left_out=tuple(each + behind for each in FOLDS),
    )


def remark(evidence: list[Evidence], steps: dict[str, float]) -> tuple[str, ...]:
    costs = {model: BuildingCost(steps=each) for model, each in steps.items()}
    return cost_remark(rank(evidence, None), {each.model: each.left_out for each in evidence}, costs)


def test_a_cheap_choice_is_not_remarked_upon() -> None:
    assert remark([family("loop", 7, 0.0), family("curve", 8, 0.0)], {"loop": 8, "curve": 2}) == ()


def test_a_cheap_family_that_is_as_good_is_named() -> None:
    (found,) = remark(
        [family("loop", 7, 0.0), family("curve", 8, 0.0005), family("line", 9, 0.004)],
        {"loop": 64, "curve": 2, "line": 2},
    )
    assert found == (
        "the fit of Loop takes about 64 integration steps a sample of 1 ms in a building; Curve is as good "
        "(92.80 % against 92.85 % left out) and takes 2: use it in studies of the tested range"
    )


def test_a_cheap_family_that_is_not_as_good_is_the_nearest() -> None:
    (found,) = remark([family("loop", 7, 0.0), family("line", 6, 0.01)], {"loop": 64, "line": 2})
    assert found.endswith(
        "of those that take fewer than 16 Line comes nearest (91.85 % against 92.85 % left out)"
    )


def test_without_a_cheap_family_that_is_said() -> None:
    (found,) = remark([family("loop", 7, 0.0), family("line", 8, 0.0)], {"loop": math.inf, "line": 32})
    assert found == (
        "the fit of Loop takes more than 512 integration steps a sample of 1 ms in a building, and so does every "
        "other that predicts what was left out"
    )
