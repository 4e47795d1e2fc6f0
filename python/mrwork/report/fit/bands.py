"""The section on prediction bands: their coverage of held-out tests, and loops of those that are covered least."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import get_args

import numpy as np

from mrwork.base.numbers import percent
from mrwork.base.summary import list_names
from mrwork.plots.canvas import column_axes, finish_signed
from mrwork.plots.of_fits import bands as draw_bands
from mrwork.plots.of_tests import Motion
from mrwork.report.fit.agreement import excitation
from mrwork.report.fit.figures import name_of
from mrwork.report.section import Group, Panel, Section, panel
from mrwork.uncertainty.bands.calibration_files import StoredBands
from mrwork.uncertainty.bands.conformal import LEVELS, LeftOutCoverage, calibrate

# The level that the text discusses, and the range of the mean coverage that counts as nominal at each.
_LEVEL = 0.9
_NOMINAL = {0.5: (0.35, 0.65), _LEVEL: (0.8, 0.97), 0.95: (0.87, 0.99)}
# Fewer tests than this are weak evidence for the next.
_FEW_TESTS = 5
# Tests left out that are drawn.
_LEFT_OUT = 3


def bands_section(bands: StoredBands, unit: str) -> Section:
    """Coverage of tests left out, and bands around those that are covered least, in a unit of force."""
    conditions = [
        (prediction.test.name, ", ".join(excitation(prediction.test))) for prediction in bands.predictions
    ]
    names = [f"{name} ({condition})" if condition else name for name, condition in conditions]
    prose = (
        "The prediction band (light blue) should contain the stated share of a measurement. It is "
        f"{bands.calibration.basis}: {'; '.join(names or bands.calibration.tests)}. It is valid for excitations and "
        f"commands like these; known beyond them: {bands.calibration.reach_in_words}.",
        _verdict([*bands.by_test.values()]),
    )
    return Section(
        title="Prediction bands",
        summary=coverage_summary(bands),
        groups=(Group(summary=bands._summary(), prose=prose, panels=_left_out_panels(bands, unit)),),
    )


def coverage_summary(bands: StoredBands) -> str:
    """What the 90 % bands hold of tests left out, a sentence; of few tests the extremes, not a mean."""
    shares = [row[_LEVEL].samples.coverage for row in bands.by_test.values()]
    if not shares:
        return "calibrated on one test, so their coverage is not known."
    span = f"{percent(min(shares), 0)} to {percent(max(shares), 0)} % of the samples of {len(shares)} tests left out"
    if len(shares) < _FEW_TESTS:
        return f"the 90 % bands contain {span}: too few tests to rely on."
    return f"the 90 % bands contain {span}, {percent(float(np.mean(shares)), 0)} % on average."


def _verdict(tests: Sequence[Mapping[float, LeftOutCoverage]]) -> str:
    """What the coverage of the tests by the bands of every level says about them, beside the summary."""
    if not tests:
        return "A single test cannot be left out of its own calibration. Give `mrwork calibrate` more tests."
    means = {level: float(np.mean([row[level].samples.coverage for row in tests])) for level in LEVELS}
    narrow = [f"{100 * level:g} %" for level, (least, _) in _NOMINAL.items() if means[level] < least]
    wide = [f"{100 * level:g} %" for level, (_, most) in _NOMINAL.items() if means[level] > most]
    too_narrow = "too narrow: the errors of these tests differ more than a few tests can show"
    verdicts = (narrow, too_narrow), (wide, "wider than necessary for tests like these")
    texts = [f"The {list_names(levels)} bands are {words}." for levels, words in verdicts if levels]
    if len(tests) < _FEW_TESTS:
        texts.append(f"{len(tests)} tests are too few to tell whether the bands have their nominal coverage.")
    elif not texts:
        texts.append(f"On average over {len(tests)} tests the bands have about their nominal coverage.")
    return " ".join(texts)


def _left_out_panels(bands: StoredBands, unit: str) -> tuple[Panel, ...]:
    """Loops of the tests that their bands cover least, with these bands."""
    shares = {test: row[_LEVEL].samples.coverage for test, row in bands.by_test.items()}
    predictions = [
        prediction
        for prediction in bands.predictions
        if prediction.test.label in shares and bands.others(prediction)
    ]
    panels = []
    for number, prediction in enumerate(
        sorted(predictions, key=lambda prediction: shares[prediction.test.label])[:_LEFT_OUT], 1
    ):
        test = prediction.test
        calibration = calibrate(bands.others(prediction), held_out=bands.calibration.held_out)
        name = name_of(test)
        for over in get_args(Motion):
            figure, axes = column_axes()
            axes.grid(True, axis="both")
            draw_bands(prediction, axes, calibration=calibration, over=over, level=_LEVEL, unit=unit)
            finish_signed(axes)
            words = f"Force against {over} of test {name}, one cycle, with the 90 % prediction band"
            held = f"Inside the 90 % band: {percent(shares[test.label])} % of the samples of the whole test."
            panels.append(panel(f"l{number}-{over}", name, figure, words, held))
    return tuple(panels)
