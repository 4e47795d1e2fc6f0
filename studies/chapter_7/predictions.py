"""The controlled tests predicted from the identified rig, and which part of the error is whose.

Frame, damper, the noise in the loop and the motion of the table are identified, drawn anew, or recorded; one at a time
is replaced by the true one. The controller is the same everywhere: it was designed on the identified rig.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

import mrwork as mr
from studies.chapter_7.controlled_tests import (
    FORCES,
    NO_DAMPER_NAME,
    QUANTITIES,
    Choice,
    Tests,
    controlled_tests,
    figures,
)
from studies.chapter_7.virtual_rig import Rig

OTHER_NOISE = 8
"""Seed of the noise in the predicted loop; that of the tests cannot be known."""
FULL, ALL_TRUE = "all identified", "all true"
JUDGED = (*QUANTITIES, *FORCES)


Predictions = dict[str, Tests]
"""Predicted tests by what is true in them."""


def recorded_motions(measured: Tests, motions: list[mr.GroundMotion]) -> list[mr.GroundMotion]:
    """The table's motions as its accelerometer has them."""
    runs = measured[NO_DAMPER_NAME]
    return [
        replace(motion, acceleration=runs[motion.name].table, dt=runs[motion.name].step) for motion in motions
    ]


def predictions(
    true: Rig,
    identified: Rig,
    calibrated: mr.Device,
    choice: Choice,
    motions: list[mr.GroundMotion],
    measured: Tests,
    *,
    threads: int,
) -> Predictions:
    """Run the identified rig, the true one, and the identified one with each part of the true one.

    `calibrated` is the damper identified with sensors whose gains are true.
    """
    seen = recorded_motions(measured, motions)
    guessed = replace(identified, hardware=replace(identified.hardware, seed=OTHER_NOISE))
    rigs = {
        FULL: (guessed, seen),
        "true damper": (replace(guessed, damper=true.damper), seen),
        "damper of true gains": (replace(guessed, damper=calibrated), seen),
        "true frame": (replace(guessed, frame=true.frame), seen),
        "true noise in the loop": (replace(guessed, hardware=true.hardware), seen),
        "true motion of the table": (guessed, motions),
        ALL_TRUE: (true, motions),
    }
    return {
        name: controlled_tests(rig, choice, table, identified.frame, threads=threads)
        for name, (rig, table) in rigs.items()
    }


def errors(predicted: Tests, measured: Tests) -> dict[str, dict[str, dict[str, float]]]:
    """Errors of the predicted figures [%] by case, record and quantity; without a damper there is no force."""
    return {
        case: {
            record: {
                quantity: 100.0 * (figures(predicted[case][record])[quantity] / each[quantity] - 1.0)
                for quantity in (QUANTITIES if case == NO_DAMPER_NAME else JUDGED)
            }
            for record, run in runs.items()
            for each in [figures(run)]
        }
        for case, runs in measured.items()
    }


def summarised(found: dict[str, dict[str, dict[str, float]]], quantity: str) -> dict[str, float]:
    """Mean, root mean square and largest size of the errors of a quantity over cases and records [%]."""
    values = np.array(
        [each[quantity] for runs in found.values() for each in runs.values() if quantity in each]
    )
    return {
        "mean": float(values.mean()),
        "rms": float(np.sqrt(np.mean(values**2))),
        "largest": float(np.abs(values).max()),
    }


def figures_of(found: Predictions, measured: Tests) -> dict[str, Any]:
    """Errors of the full prediction one by one, and for every variant over all cases and records."""
    by_variant = {name: errors(tests, measured) for name, tests in found.items()}
    return {
        "each": by_variant[FULL],
        "by_variant": {
            name: {quantity: summarised(each, quantity) for quantity in JUDGED}
            for name, each in by_variant.items()
        },
        "by_case": {
            case: {
                quantity: summarised({case: runs}, quantity)["rms"]
                for quantity in (QUANTITIES if case == NO_DAMPER_NAME else JUDGED)
            }
            for case, runs in by_variant[FULL].items()
        },
    }
