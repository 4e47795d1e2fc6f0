"""A joint model of all currents, and its prediction of a motion or a current that was left out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mrwork import Fit, identify
from mrwork.dampers import damper
from mrwork.records import DamperTest
from mrwork.uncertainty import (
    NOISES,
    Band,
    Fold,
    LeftOut,
    Noise,
    Prediction,
    calibrate,
    predict,
    predict_left_out,
)
from studies.former.command import Say
from studies.how_sure.rig_tests import CURRENTS, MOTIONS, rig_test
from studies.how_sure.scores import LEVEL, BandScore, outcome, random_size_outcome

SPEC = damper("normalised_bouc_wen").with_current_laws({"k_w": "cubic", "c": "linear"})


def scores_by_title(*, rng: int, threads: int, say: Say) -> Iterator[tuple[str, list[BandScore]]]:
    """What the model is asked that was identified without a motion, or a current, with all scores."""
    tests = tuple(rig_test(motion, current, averaged=True) for current in CURRENTS for motion in MOTIONS)
    folds: tuple[tuple[Fold, str], ...] = (("motion", "a motion"), ("command", "a current"))
    for fold, what in folds:

        def identify_rest(rest: tuple[DamperTest, ...], fold: Fold = fold) -> Fit:
            fit = identify(SPEC, rest, rng=rng, threads=threads)
            say(f"without one {fold}: {len(rest)} tests, fit {fit.fit_percent:.2f} %")
            return fit

        found = predict_left_out(tests, fold, identify_rest)
        title = f"A joint model, asked for {what} that it was identified without"
        yield title, list(outcomes_of(tests, found, rng=rng))


def outcomes_of(tests: tuple[DamperTest, ...], found: LeftOut, *, rng: int) -> Iterator[BandScore]:
    """Noise models by the residuals that each fit has seen; bands calibrated on the other tests left out."""
    fits = {frozenset(quality.test for quality in fit.quality): fit for fit in found.fits}
    everything = {test.name: test for test in tests}
    seen: dict[int, list[Prediction]] = {}
    for fit in found.fits:
        seen[id(fit)] = [predict(fit, everything[quality.test]) for quality in fit.quality]
    for prediction in found.predictions:
        fit = next(fit for names, fit in fits.items() if prediction.test.name not in names)
        for noise in NOISES.values():
            band = noise_of_fit(noise, seen[id(fit)], prediction, np.random.default_rng(rng))
            yield outcome(f"{noise.title} noise", prediction, band)
    for index, prediction in enumerate(found.predictions):
        others = [*found.predictions[:index], *found.predictions[index + 1 :]]
        band = calibrate(others, held_out="left out too").band(prediction, LEVEL)
        yield outcome("calibrated: all other tests (default)", prediction, band)
        yield random_size_outcome(prediction, others)


def noise_of_fit(
    noise: Noise, seen: list[Prediction], prediction: Prediction, rng: np.random.Generator
) -> Band:
    """Noise of the mean size that the tests of the fit show by their moments; the parameters count as known.

    Of thirty tests they are known to a per cent, which is little beside the noise.
    """
    estimates = [
        noise.estimate(each.residual / deviation, (each.force - each.measured.mean()) / deviation)
        for each in seen
        for deviation in [float(np.std(each.measured))]
    ]
    # Root mean square of the first, a size; means of the others.
    columns = np.array(estimates)
    values = np.concatenate([[np.sqrt(np.mean(columns[:, 0] ** 2))], columns[:, 1:].mean(axis=0)])
    force = (prediction.force - prediction.force.mean()) / prediction.deviation
    draws = noise.draw(np.tile(force, (400, 1)), np.tile(values, (400, 1)), rng)
    lower, upper = np.quantile(draws, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL], axis=0)
    return Band(
        kind="prediction",
        level=LEVEL,
        lower=prediction.force + prediction.deviation * lower,
        upper=prediction.force + prediction.deviation * upper,
        basis=noise.title,
    )
