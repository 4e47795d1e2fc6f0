"""Errors on what a fit has not seen: whole tests, or where there is but one, its later cycles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SimulationError
from mrwork.identification.fit import Fit
from mrwork.records import DamperTest
from mrwork.records.motion import whole_cycles
from mrwork.uncertainty.bands.left_out import IN_WORDS, Fold, folds_of, predict_left_out
from mrwork.uncertainty.bands.prediction import Prediction, predict_test

IdentifyRest = Callable[[tuple[DamperTest, ...]], Fit]

ONE_TEST = (
    "one test was given, fitted on the first half of its cycles and judged on the second: cycles of one test repeat to "
    "97-99 %, so this proves little; give tests at other motions"
)


def held_out_errors(
    tests: tuple[DamperTest, ...], fold: Fold, identify_rest: IdentifyRest
) -> tuple[float, ...]:
    """Mean NRMSE over each fold that was predicted; over each later cycle where there is but one test.

    Raises
    ------
    SettingError
        Where several tests make one fold only.
    SimulationError
        Where a fit cannot be simulated on what it has not seen.
    """
    if len(tests) == 1:
        return _later_cycles(tests[0], identify_rest)
    found = predict_left_out(tests, fold, identify_rest)
    if found.failures:
        raise SimulationError(f"what was left out cannot be predicted: {found.failures[0]}")
    errors = [_nrmse(prediction) for prediction in found.predictions]
    return tuple(float(np.mean([errors[index] for index in members])) for members in folds_of(tests, fold))


def held_out_words(tests: tuple[DamperTest, ...], fold: Fold) -> str:
    """What the errors are of."""
    if len(tests) == 1:
        return "later cycles of one test, fitted on the earlier ones"
    return f"{len(tests)} tests, {IN_WORDS[fold]}"


def halves(test: DamperTest) -> tuple[DamperTest, DamperTest]:
    """The first half of the cycles to fit on; the whole record of which only the second half counts."""
    counted = [cycle for cycle in whole_cycles(test.displacement) if cycle.start >= test.n_settle]
    middle = test.n_settle + (test.n_time - test.n_settle) // 2
    if len(counted) > 1:
        middle = counted[len(counted) // 2].start
    first = replace(
        test,
        displacement=test.displacement[:middle],
        velocity=test.velocity[:middle],
        force=test.force[:middle],
    )
    return first, replace(test, n_settle=middle)


def _later_cycles(test: DamperTest, identify_rest: IdentifyRest) -> tuple[float, ...]:
    first, second = halves(test)
    fit = identify_rest((first,))
    prediction = predict_test(fit.spec, np.array(fit.theta), second, nuisances=fit.nuisances)
    start = second.n_settle
    cycles = [
        slice(cycle.start - start, cycle.stop - start)
        for cycle in whole_cycles(test.displacement)
        if cycle.start >= start
    ]
    deviation = float(np.std(prediction.measured))
    if not cycles:
        return (_nrmse(prediction),)
    return tuple(_rms(prediction.residual[cycle]) / deviation for cycle in cycles)


def _nrmse(prediction: Prediction) -> float:
    return _rms(prediction.residual) / float(np.std(prediction.measured))


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))
