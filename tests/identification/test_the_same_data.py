"""The same data given twice is refused: it would make standard errors and bands too narrow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from posterior_samples import small_fit, small_test
from sentences import Refused

import mrwork as mr
from mrwork.records import Observation
from mrwork.records.damper_test import as_tests

TEST = small_test()
COPY = replace(TEST, name="copy", path="elsewhere.csv", observation=Observation(gain=1.1))
FIT = small_fit()


@pytest.mark.parametrize("copy", [TEST, COPY], ids=["the same object", "the same samples"])
@pytest.mark.parametrize(
    "use",
    [
        lambda tests: mr.identify("bingham", tests),
        lambda tests: mr.choose_model(tests, ("bingham", "dahl")),
        lambda tests: mr.choose_laws("bingham", tests),
        lambda tests: mr.identifiability_of(FIT, tests),
        lambda tests: mr.profile(FIT, tests),
        lambda tests: mr.sample(FIT, tests),
    ],
    ids=["identify", "choose_model", "choose_laws", "identifiability_of", "profile", "sample"],
)
def test_a_test_that_is_given_twice_is_refused(
    use: Callable[[tuple[mr.DamperTest, ...]], object], copy: mr.DamperTest, refused: Refused
) -> None:
    refused(use, (TEST, small_test(6), copy))


def test_windows_commands_and_repetitions_of_a_test_are_other_data() -> None:
    halves = TEST.part(0, 75), TEST.part(75, 150)
    commands = replace(TEST, current=0.5), replace(TEST, current=1.0)
    repetition = replace(TEST, force=small_test(6).force)
    assert as_tests((*halves, *commands, TEST, repetition)) == (*halves, *commands, TEST, repetition)


def test_a_parameter_that_is_profiled_twice_is_refused(refused: Refused) -> None:
    name = FIT.spec.names[0]
    refused(mr.profile, FIT, TEST, parameters=(name, name))
