"""Score of an identification: each motion is left out in turn, and the forces of its tests are predicted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

import mrwork as mr
from mrwork.errors import SettingError
from studies.former.command import Say
from studies.former.rig import thinned
from studies.leaderboard.entries import DAMPERS, LIMIT, Entry, Row, row_of, too_long

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
    return _score([fold_fits(entry, tests, number) for number, _ in enumerate(folds(tests))])


def damper_rows(
    files: Sequence[Path], tests: Sequence[mr.DamperTest], say: Say
) -> Iterator[Row[DamperScore]]:
    """Rows of entries; workers do a fold each, and the time limit is then that of each and of all together."""
    workers, n_folds = mr.present_workers(), len(list(folds(tests)))
    pieces = [(file, number) for file in files for number in range(n_folds)]
    outcomes = None if workers is None else workers.outcomes(tuple, _fold_row, tuple(tests), pieces)
    for file in files:
        say(file.stem)
        if outcomes is None:
            yield row_of(file, DAMPERS, lambda entry: score_damper(entry, tests))
        else:
            yield _joined([next(outcomes).get() for _ in range(n_folds)])


def _fold_row(tests: Sequence[mr.DamperTest], file: Path, number: int) -> Row[dict[str, float]]:
    return row_of(file, DAMPERS, lambda entry: fold_fits(entry, tests, number))


def _joined(rows: Sequence[Row[dict[str, float]]]) -> Row[DamperScore]:
    """The row of an entry from those of its folds."""
    seconds = sum(row.seconds for row in rows)
    failures = [row.failure for row in rows if row.failure]
    if seconds > LIMIT:
        failures.append(f"TimeoutError: {too_long(LIMIT)}")
    fits = [row.score for row in rows if row.score is not None]
    return Row(
        name=rows[0].name,
        seconds=seconds,
        score=None if failures else _score(fits),
        failure=failures[0] if failures else "",
        title=rows[0].title,
        n_params=rows[0].n_params,
    )


# Least squares of an entry sum in another order on several threads.
@mr.on_one_blas_thread
def fold_fits(entry: Entry, tests: Sequence[mr.DamperTest], number: int) -> dict[str, float]:
    """Fit % of the tests of one motion, by what is identified without them."""
    rest, held_out = list(folds(tests))[number]
    predict = entry.function(tuple(map(thinned, rest)), np.random.default_rng([SEED, number]))
    return {test.name: fit_percent(test, predict(without_force(test))) for test in held_out}


def _score(folds_fits: Iterable[Mapping[str, float]]) -> DamperScore:
    fits = {name: fit for each in folds_fits for name, fit in each.items()}
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
