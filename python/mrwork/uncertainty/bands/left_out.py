"""Tests predicted by fits that have not seen them: what bands are calibrated on and models are compared by."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mrwork.errors import SettingError, SimulationError
from mrwork.identification.fit import Fit
from mrwork.records import DamperTest
from mrwork.uncertainty.bands.prediction import Prediction, mean_cycle, predict_test

Fold = Literal["test", "motion", "command"]
"""What is left out together: each test by itself, all of one amplitude and frequency, all at one current or voltage."""

IN_WORDS: dict[Fold, str] = {
    "test": "each predicted without itself",
    "motion": "each predicted without the tests of its motion",
    "command": "each predicted without the tests at its command",
}

# Motions whose strokes and cycles differ by less than this share are the same: rigs repeat them to a few per cent.
_SAME = 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """Predictions in the order of the tests, and the fit of each fold.

    Where a fold's model cannot be simulated on a test, its prediction is missing and `failures` says why.
    """

    fold: Fold
    predictions: tuple[Prediction, ...]
    fits: tuple[Fit, ...]
    failures: tuple[str, ...]


def predict_left_out(
    tests: Sequence[DamperTest],
    fold: Fold,
    identify_rest: Callable[[tuple[DamperTest, ...]], Fit],
    *,
    on_fold: Callable[[int, int], None] | None = None,
) -> LeftOut:
    """Identify without the tests of each fold in turn, and predict them.

    Parameters
    ----------
    identify_rest
        Identifies from tests. It must not know the ones left out: not as a start of a descent either, whose minimum
        would remember them.
    on_fold
        Called with the number of folds done and their count.

    Raises
    ------
    SettingError
        Where there are fewer than two folds.
    """
    folds = folds_of(tests, fold)
    predictions: dict[int, Prediction] = {}
    fits, failures = [], []
    for done, members in enumerate(folds):
        if on_fold is not None:
            on_fold(done, len(folds))
        fit = identify_rest(tuple(test for index, test in enumerate(tests) if index not in members))
        fits.append(fit)
        for index in members:
            try:
                predictions[index] = predict_test(
                    fit.spec, np.array(fit.theta), tests[index], nuisances=fit.nuisances
                )
            except SimulationError as reason:
                failures.append(str(reason))
    return LeftOut(
        fold=fold,
        predictions=tuple(predictions[index] for index in sorted(predictions)),
        fits=tuple(fits),
        failures=tuple(failures),
    )


def folds_of(tests: Sequence[DamperTest], fold: Fold) -> list[list[int]]:
    """Indices of the tests of each fold.

    Raises
    ------
    SettingError
        Where there are fewer than two.
    """
    folds: list[list[int]] = []
    for index, test in enumerate(tests):
        for members in folds:
            if _alike(tests[members[0]], test, fold):
                members.append(index)
                break
        else:
            folds.append([index])
    if len(folds) < 2:
        raise SettingError(
            f"to leave one {fold} out there must be two, the {len(tests)} tests given have one {fold} in common; "
            "give tests that differ in it"
        )
    return folds


def _alike(one: DamperTest, other: DamperTest, fold: Fold) -> bool:
    if fold == "test":
        return False
    if fold == "command":
        return (one.current, one.voltage) == (other.current, other.voltage)
    pairs = zip(_motion(one), _motion(other), strict=True)
    return all(abs(a - b) <= _SAME * max(a, b) for a, b in pairs)


def _motion(test: DamperTest) -> tuple[float, float]:
    """Stroke [m] and mean length of a cycle [s]."""
    return float(np.ptp(test.displacement[test.counted])), mean_cycle(test) * test.dt
