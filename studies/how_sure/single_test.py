"""A fit to one test, and the coverage of its bands on other motions at the same current."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from mrwork import Fit, identify
from mrwork.records import DamperTest
from mrwork.uncertainty import (
    NOISES,
    Prediction,
    calibrate,
    noise_band,
    predict,
    sample,
    simulate_draws,
)
from studies.former.command import Say
from studies.how_sure.rig_tests import CURRENTS, FITTED, MOTIONS, rig_test
from studies.how_sure.scores import LEVEL, BandScore, outcome, random_size_outcome

MODEL = "normalised_bouc_wen"
_DRAWS = 300
# An ensemble that has not settled by then has all but its last digits.
_MOST_STEPS = 1500


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """The fit at one current, and its predictions of the five motions that it has not seen."""

    test: DamperTest
    fit: Fit
    predictions: dict[str, Prediction]


def fitted(current: str, *, rng: int, threads: int) -> Fitted:
    test = rig_test(FITTED, current)
    fit = identify(MODEL, test, observe="none", rng=rng, threads=threads)
    others = [motion for motion in MOTIONS if motion != FITTED]
    return Fitted(
        test=test,
        fit=fit,
        predictions={motion: predict(fit, rig_test(motion, current)) for motion in others},
    )


def noise_outcomes(current: str, at: Fitted, *, rng: int, threads: int, say: Say) -> Iterator[BandScore]:
    """Bands of each noise model from the posterior of the one test."""
    for name, noise in NOISES.items():
        draws = sample(at.fit, at.test, noise=name, rng=rng, threads=threads, most_steps=_MOST_STEPS)
        say(f"{current} {name}: {draws.verdict}")
        stream = np.random.default_rng([rng, len(name)])
        chosen = stream.choice(len(draws.theta), _DRAWS, replace=False)
        measured = at.test.force[at.test.counted]
        for prediction in at.predictions.values():
            forces = simulate_draws(at.fit.spec, draws.theta[chosen], prediction.test, threads=threads)
            band = noise_band(
                forces[:, prediction.test.counted],
                draws.noise[chosen][: len(forces)],
                noise,
                LEVEL,
                deviation=float(np.std(measured)),
                mean=float(np.mean(measured)),
                rng=stream,
            )
            yield outcome(f"{noise.title} noise", prediction, band)


def calibrated_outcomes(all_fitted: dict[str, Fitted]) -> Iterator[BandScore]:
    """Bands calibrated on other tests left out, never on the one that is predicted."""
    entries = [(current, motion) for current in all_fitted for motion in all_fitted[current].predictions]
    ways: tuple[tuple[str, Callable[[tuple[str, str], tuple[str, str]], bool]], ...] = (
        ("calibrated: other motions, same current", lambda one, other: one[0] == other[0] and one != other),
        ("calibrated: other motions, any current", lambda one, other: one[1] != other[1]),
        ("calibrated: any motion, other currents", lambda one, other: one[0] != other[0]),
        ("calibrated: all other tests (default)", lambda one, other: one != other),
    )
    predictions = {entry: all_fitted[entry[0]].predictions[entry[1]] for entry in entries}
    for way, may_know in ways:
        for entry in entries:
            known = [predictions[other] for other in entries if may_know(entry, other)]
            band = calibrate(known, held_out="the fit has not seen").band(predictions[entry], LEVEL)
            yield outcome(way, predictions[entry], band)
    for entry in entries:
        others = [predictions[other] for other in entries if other != entry]
        yield random_size_outcome(predictions[entry], others)


def scores_by_title(*, rng: int, threads: int, say: Say) -> Iterator[tuple[str, list[BandScore]]]:
    """What the fits at each current are asked, with all scores."""
    at = {current: fitted(current, rng=rng, threads=threads) for current in CURRENTS}
    scores = [
        score
        for current in at
        for score in noise_outcomes(current, at[current], rng=rng, threads=threads, say=say)
    ]
    title = "A fit to 10 mm, 1 Hz, asked for the five other motions at its current"
    yield title, scores + list(calibrated_outcomes(at))
