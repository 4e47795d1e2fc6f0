"""Every verb on tests takes one test or several."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import pytest

import mrwork as mr
from mrwork.uncertainty import Candidate
from mrwork.uncertainty.candidate_tests import candidate_grid

TEST = mr.synthetic_test("rd1005_1a")
VERBS = (
    mr.identify,
    mr.sample,
    mr.choose_model,
    mr.profile,
    mr.identifiability_of,
    mr.plan,
    candidate_grid,
)


@pytest.mark.parametrize("verb", VERBS, ids=lambda verb: verb.__name__)
def test_the_type_of_the_tests_is_the_same_in_every_verb(verb: Callable[..., Any]) -> None:
    assert inspect.signature(verb).parameters["tests"].annotation == "DamperTest | Sequence[DamperTest]"


def test_one_test_gives_the_result_of_a_list_of_it() -> None:
    fit = mr.identify("dahl", TEST)
    assert candidate_grid(fit.spec, TEST) == candidate_grid(fit.spec, [TEST])
    candidates = [Candidate(amplitude=0.01, frequency=1.0)]
    assert mr.plan(fit, TEST, candidates) == mr.plan(fit, [TEST], candidates)
    assert mr.identifiability_of(fit, TEST) == mr.identifiability_of(fit, [TEST])
    one, several = mr.profile(fit, TEST), mr.profile(fit, [TEST])
    assert one.profiles == several.profiles
