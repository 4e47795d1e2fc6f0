"""What the study finds: the parts that the page draws, and every figure as nested dictionaries."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import mrwork as mr
from studies.chapter_7 import controlled_tests, earthquakes, frame_tests, predictions, rig_damper, sine_tests
from studies.chapter_7.controlled_tests import Choice, Tests
from studies.chapter_7.frame_tests import IdentifiedFrame
from studies.chapter_7.predictions import Predictions
from studies.chapter_7.rig_damper import IdentifiedDamper
from studies.chapter_7.sine_tests import SineTest
from studies.chapter_7.virtual_rig import HARDWARE, NO_GAIN_ERRORS, Rig, other_damper, recorded, true_rig
from studies.former.command import Work

SEED = 2009
"""Of the noise of the sensors."""
WIDE_CURRENTS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)
"""Constant currents of the sweep beyond the tests [A]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """All tests of a rig with a damper, what was identified from them, and the predictions."""

    sines: list[SineTest]
    predicted_sines: list[SineTest]
    damper: IdentifiedDamper
    choice: Choice
    tests: Tests
    predictions: Predictions

    def figures(self) -> dict[str, Any]:
        """Figures that do not want to know the truth."""
        return {
            "sines": sine_tests.figures_of(self.sines, self.predicted_sines),
            "fit_percent": self.damper.fit.fit_percent,
            "chosen": self.choice.chosen,
            "tests": controlled_tests.figures_of(self.tests),
            "predictions": predictions.figures_of(self.predictions, self.tests),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Chapter:
    """The frame, the campaign with the RD-1005-3, that with another damper, and every figure of the study.

    `sweep` has the scores of constant currents on the true rig; the quick form has no other damper.
    """

    kind: str
    motions: list[mr.GroundMotion]
    frame: IdentifiedFrame
    campaign: Campaign
    sweep: dict[str, list[float]]
    found: dict[str, Any]


def chapter_of(work: Work) -> Chapter:
    """Work everything out; the quick form has one short synthetic motion, fewer sine tests and fewer settings."""
    rng = np.random.default_rng(SEED)
    rig = true_rig()
    work.say("free vibration")
    frame = frame_tests.identified_frame(rng)
    natural = earthquakes.natural(work)
    motions = earthquakes.driven(natural)
    campaign = _campaign(rig, frame.frame, motions, rng, work)
    work.say("constant currents")
    currents = list(WIDE_CURRENTS[::4] if work.quick else WIDE_CURRENTS)
    sweep = controlled_tests.constant_sweep(rig, motions, currents, threads=work.threads)
    run = {
        "table": earthquakes.demands(natural),
        "damper": rig_damper.figures_of(campaign.damper, rig.damper),
        "sweep": sweep,
        **campaign.figures(),
    }
    if not work.quick:
        work.say("damper, other ways")
        ways = rig_damper.other_ways(campaign.damper, threads=work.threads)
        run["ways"] = rig_damper.figures_of_ways(ways, rig.damper)
        other = replace(rig, damper=other_damper())
        run["other"] = _campaign(other, frame.frame, motions, rng, work).figures()
    kind = "quick" if work.quick else "synthetic" if work.records is None else "measured"
    return Chapter(
        kind=kind,
        motions=motions,
        frame=frame,
        campaign=campaign,
        sweep=sweep,
        found={"frame": frame_tests.figures_of(frame), kind: run},
    )


def _campaign(
    rig: Rig, frame: mr.Building, motions: list[mr.GroundMotion], rng: np.random.Generator, work: Work
) -> Campaign:
    """Sine tests, identification, settings, controlled tests and predictions of a rig whose frame was identified."""
    work.say(f"{rig.damper.name}: sine tests and damper")
    threads = work.threads
    sweep, wanted = sine_tests.sweep(quick=work.quick), sine_tests.for_identification(quick=work.quick)
    sines = sine_tests.sine_tests(rig, sweep, rng, threads=threads)
    damper = rig_damper.identified_damper(rig, wanted, rng, threads=threads)
    calibrated = rig_damper.identified_damper(rig, wanted, rng, sensors=NO_GAIN_ERRORS, threads=threads)
    identified = Rig(frame=frame, damper=damper.device, hardware=HARDWARE)
    work.say("settings")
    choice = controlled_tests.chosen_on(identified, earthquakes.choosing(work), work)
    work.say("controlled tests")
    tests = controlled_tests.controlled_tests(
        rig, choice, motions, frame, threads=threads, seen=lambda signals: recorded(signals, rng)
    )
    work.say("predictions")
    return Campaign(
        sines=sines,
        predicted_sines=sine_tests.sine_tests(identified, sine_tests.between(sweep), None, threads=threads),
        damper=damper,
        choice=choice,
        tests=tests,
        predictions=predictions.predictions(
            rig, identified, calibrated.device, choice, motions, tests, threads=threads
        ),
    )
