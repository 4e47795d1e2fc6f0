"""Score of an identification: each motion is left out in turn, and the forces of its tests are predicted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

import mrwork as mr
from mrwork.errors import SettingError
from studies.common.rig import thinned
from studies.leaderboard.entries import Entry

SEED = 7
"""First number of every generator that is handed over; the second one counts the calls of an entry."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DamperScore:
    """Fit % of held-out tests: median, worst with its test, and each by name."""

    median: float
    worst: float
    worst_test: str
    fits: dict[str, float]


def score_damper(entry: Entry, tests: Sequence[mr.DamperTest]) -> DamperScore:
    """Identify without each motion in turn, from thinned tests, and predict its whole tests."""
    fits: dict[str, float] = {}
    for number, (rest, held_out) in enumerate(folds(tests)):
        predict = entry.function(tuple(map(thinned, rest)), np.random.default_rng([SEED, number]))
        for test in held_out:
            fits[test.name] = fit_percent(test, predict(without_force(test)))
    worst = min(fits, key=lambda name: fits[name])
    return DamperScore(
        median=float(np.median(list(fits.values()))), worst=fits[worst], worst_test=worst, fits=fits
    )


def folds(
    tests: Sequence[mr.DamperTest],
) -> Iterator[tuple[tuple[mr.DamperTest, ...], tuple[mr.DamperTest, ...]]]:
    """For each motion, by amplitude and frequency, all other tests and its own."""
    motions = dict.fromkeys((test.amplitude, test.frequency) for test in tests)
    for motion in motions:
        yield (
            tuple(test for test in tests if (test.amplitude, test.frequency) != motion),
            tuple(test for test in tests if (test.amplitude, test.frequency) == motion),
        )


def without_force(test: mr.DamperTest) -> mr.DamperTest:
    """A copy with zeros for the force, without what was found in it, its file and its record before repairs."""
    return replace(
        test,
        force=np.zeros_like(test.force),
        findings=(),
        smoothing=None,
        original=None,
        uncompared=(),
        path="",
        sha256="",
    )


def fit_percent(test: mr.DamperTest, predicted: ArrayLike) -> float:
    """`100 (1 - |r| / |F - mean F|)` over the samples that are compared, see `DamperTest.counted`."""
    force = np.asarray(predicted, dtype=np.float64)
    if force.shape != test.force.shape:
        raise SettingError(f"predict returned shape {force.shape} for {test.name}; give {test.force.shape}")
    if not np.isfinite(force).all():
        raise SettingError(f"predict returned a force that is not finite for {test.name}; give numbers")
    measured = test.force[test.counted]
    residual = force[test.counted] - measured
    return float(100.0 * (1.0 - np.linalg.norm(residual) / np.linalg.norm(measured - measured.mean())))
