"""Which part of a record is used: cutting, thinning, and the start that cannot be compared."""

from __future__ import annotations

from dataclasses import replace
from math import ceil

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError
from mrwork.records.damper_test import DamperTest
from mrwork.records.motion import spectrum

_FEWEST = 10


def settling_samples(displacement: NDArray[np.float64]) -> int:
    """Samples until the damper has travelled half its peak-to-peak stroke.

    A damper's hysteresis forgets where it stood within a yield displacement, a small part of the stroke of any
    useful test; before that its force depends on what happened before the record began.
    """
    travel = np.cumsum(np.abs(np.diff(displacement, prepend=displacement[0])))
    return int(np.searchsorted(travel, np.ptp(displacement) / 2))


def cut(
    test: DamperTest, *, start: float | None = None, end: float | None = None, every: int = 1
) -> DamperTest:
    """Return the samples of a test from `start` to `end` [s, by its own clock], and of these every n-th one.

    Raises
    ------
    SettingError
        If fewer than 10 samples would remain.
    """
    if every < 1:
        raise SettingError(f"--every is {every}; it must be 1 or more")
    first = 0 if start is None else max(0, ceil((start - test.start_time) / test.dt - 1e-9))
    last = test.n_time if end is None else ceil((end - test.start_time) / test.dt - 1e-9)
    window = slice(first, max(first, last), every)
    displacement, velocity, force = (
        np.ascontiguousarray(channel[window]) for channel in (test.displacement, test.velocity, test.force)
    )
    if displacement.size < _FEWEST:
        raise SettingError(
            f"{test.path or test.name}: {displacement.size} samples would remain of a record from "
            f"{test.time[0]:g} to {test.time[-1]:g} s; keep at least {_FEWEST}"
        )
    return replace(
        test,
        displacement=displacement,
        velocity=velocity,
        force=force,
        dt=test.dt * every,
        start_time=test.start_time + first * test.dt,
        n_settle=settling_samples(displacement),
    )


# Enough cycles for a settled loop to count, enough samples for its knees.
_EXCERPT_CYCLES = 3
_EXCERPT_PER_CYCLE = 400
# A motion whose band ends beyond so many times its dominant frequency is not cyclic; it is only thinned, to so many
# samples in a period of its fastest part.
_CYCLIC_BAND = 5.0
_PER_FASTEST = 40


def excerpt(test: DamperTest) -> DamperTest:
    """Return the first cycles of a test that repeats itself, thinned to what shows its loop.

    A search needs no more, and a cyclic test of ten cycles has little more to say. A motion whose band reaches beyond
    a few times its dominant frequency keeps its length.
    """
    motion = spectrum(test.displacement, test.dt)
    if motion.dominant <= 0.0:
        return test
    thin = max(1, int(1.0 / (motion.dominant * test.dt * _EXCERPT_PER_CYCLE)))
    if motion.band_edge > _CYCLIC_BAND * motion.dominant:
        return cut(test, every=max(1, int(1.0 / (motion.band_edge * test.dt * _PER_FASTEST))))
    whole = test.n_settle * test.dt + _EXCERPT_CYCLES / motion.dominant
    return cut(test, end=test.start_time + whole, every=thin)


def counted_from(test: DamperTest, settle: float) -> DamperTest:
    """Return the test with the first `settle` seconds simulated but not compared.

    Raises
    ------
    SettingError
        If fewer than 10 samples would be compared, or the time is negative.
    """
    n_settle = ceil(settle / test.dt - 1e-9)
    if settle < 0 or test.n_time - n_settle < _FEWEST:
        raise SettingError(
            f"{test.path or test.name}: --settle is {settle:g} s of a record of {test.dt * test.n_time:g} s; "
            f"give 0 or more, and leave at least {_FEWEST} samples"
        )
    return replace(test, n_settle=n_settle)
