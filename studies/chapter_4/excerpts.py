"""The tests of the study: the synthetic ones of chapter 5 whose parameters are published, and measured ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from mrwork.records import cut
from studies.chapter_4.search_settings import MeasuredChoice, SyntheticChoice
from studies.former.damper_tests import TestSet, by_current, synthetic_sets

_FREQUENCY = 1.0


def synthetic_excerpts(choice: SyntheticChoice, *, seed: int) -> TestSet:
    """The damper with the published polynomials of the RD-1005-3, and the noise of chapter 5 on its force."""
    sets = synthetic_sets(seed=seed, currents=choice.currents, frequencies=(_FREQUENCY,))
    published = next(tests for tests in sets if tests.coefficients is not None)
    return replace(published, tests=tuple(cut(test, end=choice.seconds) for test in published.tests))


def measured_excerpts(folder: Path, choice: MeasuredChoice) -> TestSet | None:
    """UTFSM tests by current; none where they are absent.

    The force is compared as it stands in the files, though their authors averaged it.
    """
    if not any(folder.glob(choice.records)):
        return None
    tests = []
    for test in by_current(folder, choice.records):
        end = choice.start + choice.samples * choice.every * test.dt
        tests.append(cut(test, start=choice.start, end=end, every=choice.every))
    return TestSet(
        damper="measured UTFSM",
        motion="10 mm 1 Hz",
        synthetic=False,
        tests=tuple(tests),
    )
