"""Tests that are described better without the moving average that was found in their records.

The average is applied all the same: without it the parameters describe the smoothed loop and not the damper, and the
fit to the same record says little about which is right (DECISIONS.md, 36).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.identification.autocorrelation import autocorrelation_time
from mrwork.identification.levenberg_marquardt import find_minima
from mrwork.identification.objective import Objective
from mrwork.records import DamperTest

# The fit without the average is better if its misfit is below this share of that with it, and the mean difference of
# the squared residuals is above this number of its standard errors.
_SHARE = 0.98
_SIGNIFICANT = 2.0
_MOST_ITERATIONS = 30
# Samples of a window below which the straight lines between them smooth the model's force too.
_FEW_SAMPLES = 6.0


def needless_average_warnings(objective: Objective, box: Box, theta: NDArray[np.float64]) -> tuple[str, ...]:
    """A sentence for each test with a detected average whose fit would be better without it, by more than chance.

    A single test is fitted again without its average, from the fit `theta`, shape (n_params,). Several tests are
    compared at `theta`, which the others determine.
    """
    found = [index for index, test in enumerate(objective.tests) if _has_detected_average(test)]
    if not found:
        return ()
    without = objective.on(
        objective.spec,
        tuple(
            replace(test, observation=replace(test.observation, average_seconds=0.0))
            if index in found
            else test
            for index, test in enumerate(objective.tests)
        ),
    )
    refitted = theta
    if len(objective.tests) == 1:
        refitted = find_minima(without, box, theta[None], max_iterations=_MOST_ITERATIONS).theta[0]
    sentences = []
    for index in found:
        test = objective.tests[index]
        (averaged,), _ = objective.compared[index].residuals(theta[None])
        (plain,), _ = without.compared[index].residuals(refitted[None])
        samples = np.arange(test.n_time)
        plain = plain[np.isin(samples[without.tests[index].counted], samples[test.counted])]
        if _is_better(plain, averaged):
            sentences.append(_sentence(test, _fit_percent(test, averaged), _fit_percent(test, plain)))
    return tuple(sentences)


def _has_detected_average(test: DamperTest) -> bool:
    smoothing = test.smoothing
    return (
        smoothing is not None
        and "force" in smoothing.channels
        and test.observation.average_seconds == smoothing.window_seconds
    )


def _is_better(plain: NDArray[np.float64], averaged: NDArray[np.float64]) -> bool:
    if np.linalg.norm(plain) >= _SHARE * np.linalg.norm(averaged):
        return False
    gain = averaged**2 - plain**2
    n_effective = gain.size / autocorrelation_time(gain - gain.mean())
    return bool(gain.mean() > _SIGNIFICANT * gain.std() / np.sqrt(n_effective))


def _fit_percent(test: DamperTest, residual: NDArray[np.float64]) -> float:
    return 100.0 * (1.0 - float(np.sqrt(np.mean(residual**2)) / np.std(test.force[test.counted])))


def _sentence(test: DamperTest, averaged: float, plain: float) -> str:
    window = test.observation.average_seconds
    samples = window / test.dt
    if samples < _FEW_SAMPLES:
        reason = (
            f"the window has only {samples:.2g} samples at the step that is used, too few to average the model's force "
            "exactly: use every sample of the record, or --observe none"
        )
    else:
        reason = (
            "it is applied because it was found in the record, and without it the parameters describe the smoothed "
            "loop and not the damper; try another model, or --observe none if the record was not smoothed"
        )
    return (
        f"{test.label}: without the moving average over {1e3 * window:.4g} ms the fit would be {plain:.2f} % instead "
        f"of {averaged:.2f} %; {reason}"
    )
