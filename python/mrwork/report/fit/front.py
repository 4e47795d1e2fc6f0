"""The front of a fit's page: how well it predicts, on which tests, where it does not hold, and what to do next."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrwork.base.numbers import format_fixed, significant
from mrwork.base.remark import Remark, RemarkKind, warnings_of
from mrwork.base.summary import list_names
from mrwork.dampers.between_commands import LAWS_OPEN
from mrwork.identification.fit import STATUS_IN_WORDS, Fit, FitSpread
from mrwork.identification.interval import FINE
from mrwork.plots.canvas import LOW, SMALL_HEIGHT, name_above, small_axes
from mrwork.plots.of_fits import laws as draw_laws
from mrwork.plots.of_tests import Motion
from mrwork.report.fit.agreement import loop_panel
from mrwork.report.fit.figures import common_unit, small_loop
from mrwork.report.fit.later import coverage_summary
from mrwork.report.section import Lead, Number, Panel, first_sentences, panel
from mrwork.runs.load import StoredRun
from mrwork.uncertainty.bands.held_out import median_place
from mrwork.uncertainty.bands.prediction import LATER_CYCLES, UNSEEN, Prediction
from mrwork.uncertainty.bands.predictions import spread_of

_BANNER = {
    "interrupted": "This identification was interrupted. The parameters are the best found until then, not the end of "
    "the search.",
    "stopped": "This identification was stopped on request. The parameters are the best found until then, not the end "
    "of the search.",
    "lower_minimum_possible": "The search met this minimum by one route only, so a lower one is possible{reason}.",
    "not_converged": "The search stopped before it converged{reason}. The parameters may still improve.",
}
# Cautions, advice, parameters with a law, those beside the loops, and tests that the front shows.
_CAUTIONS, _ADVICE, _LAWS, _IN_ROW, _NAMED = 3, 3, 6, 2, 3
_ONE_MOTION = RemarkKind("one_test_fitted", "one test does not show other motions and commands", warns=True)
_WEAK = RemarkKind("values_undetermined", "the tests do not determine {0}", "do not use a value by itself")
_SYNTHETIC = RemarkKind("tests_synthetic", "synthetic tests show that the chain works, no more", warns=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Evidence:
    """Predictions of tests: what these tests are, a title and an opening of the sentence, and what limits it."""

    title: str
    opening: str
    drawn: Sequence[Prediction]
    limit: str = ""

    @property
    def spread(self) -> FitSpread:
        return spread_of(self.drawn)

    @property
    def in_words(self) -> str:
        spread, count = self.spread, self.spread.n_tests
        text = f"{self.opening} to {format_fixed(spread.median_percent, 1)} %"
        if count > 1:
            text += f" in the median, the worst, {spread.worst_test}, to {format_fixed(spread.worst_percent, 1)} %"
        return f"{text}. {self.limit}".rstrip()


def evidence_of(run: StoredRun, predictions: Sequence[Prediction]) -> _Evidence:
    """The best evidence that a run has: tests that it has not seen, else the fitted ones."""
    evidence = _Evidence(
        title="Fitted tests",
        opening=f"Nothing was held out: the model describes {_tests(len(predictions))} that it was fitted to,",
        drawn=predictions,
        limit="How well it predicts others is not known.",
    )
    bands, ranking = run.bands, run.ranking
    if run.held_out is not None:
        outside = sum(bool(prediction.outside.names) for prediction in run.held_out.predictions)
        lying = "It lies" if len(run.held_out.predictions) == 1 else f"{outside} of them"
        return _Evidence(
            title="Kept for test",
            opening=f"Predicts {_tests(len(run.held_out.predictions))} kept for test",
            drawn=run.held_out.predictions,
            limit=f"{lying} outside the tested ranges." if outside else "",
        )
    if bands is not None and bands.predictions:
        count, held_out = _tests(len(bands.predictions)), bands.calibration.held_out
        openings = {
            UNSEEN: f"Predicts {count} of its calibration, which it was not fitted to,",
            LATER_CYCLES: "Predicts later cycles of its test, fitted on the earlier ones,",
        }
        left_out = f"Fits to the other tests predict {count}, {held_out},"
        return _Evidence(
            title="Calibration" if held_out in openings else "Left out",
            opening=openings.get(held_out, left_out),
            drawn=bands.predictions,
        )
    if ranking is not None:
        chosen = "model was" if ranking.unit is None else "laws were"
        percent = format_fixed(ranking.chosen_standing.left_out_percent, 1)
        left_out = f"Fits to other tests predict tests left out to {percent} %; the {chosen} chosen by it"
        return replace(evidence, opening=f"{left_out}, so expect less. {evidence.opening}", limit="")
    return evidence


def _tests(count: int) -> str:
    return "one test" if count == 1 else f"{count} tests"


def fit_lead(run: StoredRun, predictions: Sequence[Prediction]) -> Lead:
    """The front of the page of a run, whose fit is `predictions`."""
    fit = run.fit
    evidence = evidence_of(run, predictions)
    names = [prediction.test.name for prediction in predictions]
    banner = _BANNER.get(fit.status, "").format(reason=f": {fit.status_reason}" if fit.status_reason else "")
    cautions = warnings_of(_cautions(run, evidence, predictions))
    if not banner and warnings_of(fit.remarks):
        (banner,), cautions = first_sentences(cautions[:1], 1), cautions[1:]
    facts = (fit.provenance.settings.get("reading") or {}).get("facts", {})
    before = {"damper": "", "serial": "no. ", "date": "tested ", "operator": "by ", "temperature": "at "}
    specimen = ", ".join(f"{word}{facts[name]}" for name, word in before.items() if name in facts)
    # One row of figures, or two of lower ones.
    height = LOW if len(fit.spec.following) > _IN_ROW else SMALL_HEIGHT
    unit = common_unit([*predictions, *evidence.drawn])
    return Lead(
        eyebrow="Damper identification",
        title=fit.spec.title,
        subject=f"{specimen}{'. ' if specimen else ''}Fitted to {list_names(names, _NAMED)}",
        synthetic=any(prediction.test.synthetic for prediction in predictions),
        banner=banner,
        verdict=evidence.in_words,
        numbers=_numbers(run, predictions, evidence),
        panels=(*_loops(evidence, unit, height=height), *_law_panels(fit, height)),
        cautions=(
            f"Not beyond the tested ranges: {fit.tested.in_words}.",
            *(remark.as_sentence for remark in fit.remarks if remark.code == LAWS_OPEN.code),
            *first_sentences(cautions, _CAUTIONS),
        ),
        advice=_advice(run),
    )


def _numbers(run: StoredRun, predictions: Sequence[Prediction], evidence: _Evidence) -> tuple[Number, ...]:
    fit, spread, bands = run.fit, evidence.spread, run.bands
    fit_spread = spread_of(predictions)
    worst = "" if fit_spread.n_tests == 1 else f", worst {format_fixed(fit_spread.worst_percent, 1)} %"
    covered = "not calibrated" if bands is None else coverage_summary(bands, run.held_out)
    steps = f"after {fit.refinement_steps} refinement step{'' if fit.refinement_steps == 1 else 's'}"
    reason = "; ".join(filter(None, (steps, fit.status_reason)))
    if fit.status != "converged":
        reason = "the best found so far"
    numbers = [
        Number(
            title="Fit to its own tests",
            value=significant(fit.rmse_n, 3) if fit.has_constant else format_fixed(fit.fit_percent, 1),
            unit="N rms" if fit.has_constant else "%",
            note=f"{_tests(fit_spread.n_tests)}{worst}; NRMSE {fit.nrmse:.3g}, RMSE {fit.rmse_n:.3g} N",
        ),
        Number(
            title="Prediction bands",
            value="none" if bands is None else _tests(len(bands.calibration.tests)),
            note=f"{covered[:1].upper()}{covered[1:]}",
        ),
        Number(
            title="Status",
            value=STATUS_IN_WORDS[fit.status].capitalize(),
            note=reason,
            worse=fit.status != "converged",
        ),
    ]
    if evidence.drawn is not predictions:
        held_out = Number(
            title=f"{evidence.title}, median fit",
            value=format_fixed(spread.median_percent, 1),
            unit="%",
            note=f"{_tests(spread.n_tests)}, worst {format_fixed(spread.worst_percent, 1)} %",
        )
        numbers.insert(0, held_out)
    return tuple(numbers)


def _loops(evidence: _Evidence, unit: str, *, height: float) -> Iterator[Panel]:
    """Small loops of the worst and the median test; of a single test over both motions."""
    count = evidence.spread.n_tests
    order = np.argsort([prediction.fit_percent for prediction in evidence.drawn], kind="stable").tolist()
    chosen: list[tuple[int, str, Motion]] = [
        (order[0], "Worst", "velocity" if count > 1 else "displacement"),
        (order[median_place(len(order))], "Median", "velocity"),
    ]
    for number, role, over in chosen:
        drawn = evidence.drawn[number]
        figure = small_loop(drawn, unit, over=over, height=height)
        title = f"{role} of {count} tests" if count > 1 else f"Force over {over}"
        yield loop_panel(f"front-{number}-{role if count > 1 else over}", drawn, figure, title)


def _law_panels(fit: Fit, height: float) -> Iterator[Panel]:
    """Laws of at most six parameters, and fits to the tests at each command, which know nothing of the law."""
    shown = [parameter for parameter in fit.spec.plain if parameter.name in fit.spec.following][:_LAWS]
    count = len(fit.single_commands)
    for number, parameter in enumerate(shown):
        figure, axes = small_axes(height)
        draw_laws(fit, axes, parameters=[parameter.name])
        name_above(axes)
        yield panel(
            f"law-{parameter.name}",
            re.split("[:,]", parameter.description)[0].capitalize(),
            figure,
            f"{parameter.name} over the command, with fits at {count} single commands",
            "points: fits at one command" if count and not number else "",
        )


def _cautions(run: StoredRun, evidence: _Evidence, predictions: Sequence[Prediction]) -> Iterator[Remark]:
    """Where the fit does not hold, what misleads most first."""
    fit = run.fit
    yield from fit.remarks
    if evidence.drawn is predictions and len(predictions) == 1:
        yield _ONE_MOTION.remark()
    settled = (*FINE, "model-dependent", "negligible")
    if doubtful := [each.name for each in fit.estimates if each.verdict.word not in settled]:
        yield _WEAK.remark(list_names(doubtful, 6))
    if any(prediction.test.synthetic for prediction in predictions):
        yield _SYNTHETIC.remark()


def _advice(run: StoredRun) -> tuple[str, ...]:
    tested, bands = run.fit.tested, run.bands
    between = "" if (gap := tested.gap) is None else f"{gap[0]:g} and {gap[1]:g} {tested.command_unit}"
    is_untested = bands is not None and bands.calibration.held_out == UNSEEN
    advice = (
        (bool(between), f"Test at a command between {between}: no test shows the laws there."),
        (bands is None, "`mrwork calibrate RUN TESTS`: the error on other tests, and bands."),
        (is_untested, "`mrwork predict RUN TESTS --level 0.9` with tests kept for test."),
        (
            run.draws is None and run.profiles is None,
            "`mrwork intervals RUN`: an interval of each parameter.",
        ),
        (run.plan is None, "`mrwork plan RUN`: the next test that narrows a band most."),
        (True, 'In a study of a building: `run = "RUN"` of its `[[damper]]`.'),
    )
    return tuple(sentence for lacks, sentence in advice if lacks)[:_ADVICE]
