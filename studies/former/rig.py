"""The UTFSM rig: its sinusoids, and records thinned for identification."""

from __future__ import annotations

from mrwork.records import DamperTest, cut, read_damper_tests, repair
from studies.former.records import damper_tests

PER_CYCLE = 250
"""Samples of a cycle: with this number the fit of no test changes by more than 0.01."""


def sinusoids() -> tuple[DamperTest, ...]:
    """The smoothed sinusoids, none where the records are absent.

    Their velocity is derived anew, also that of the slowest, whose column readers use.
    """
    paths = sorted(str(path) for path in damper_tests().glob("[0-9]*.csv"))
    return tuple(repair(test, ["velocity"])[0] for test in read_damper_tests(paths)) if paths else ()


def thinned(test: DamperTest) -> DamperTest:
    """The whole of a record with fewer samples."""
    frequency = test.frequency
    return (
        test if frequency is None else cut(test, every=max(1, int(1.0 / (frequency * test.dt * PER_CYCLE))))
    )
