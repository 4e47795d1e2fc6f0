"""Ranking of families by the left-out fit, the simplest of equal ones first: sentence, remark, table and figure."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from sentences import Refused

from mrwork.drawing.canvas import svg_bytes
from mrwork.identification.result import BuildingCost
from mrwork.report import numbers
from mrwork.report.fit.choices import ranking_figure
from mrwork.uncertainty.choice.leave_one_out import LeaveOneOut
from mrwork.uncertainty.choice.ranking import (
    Collapse,
    Evidence,
    Ranking,
    Standing,
    cost_remark,
    rank,
    ranking_of,
)

TESTS = np.array([0.10, 0.14, 0.08, 0.12, 0.11, 0.13])


def family(
    model: str,
    n_params: int,
    left_out: np.ndarray[tuple[int], np.dtype[np.float64]] | None,
    *,
    variance: float = 0.01,
    elpd: tuple[float, ...] = (),
    pareto_k: float = 0.2,
    reason: str = "",
    same_as: str = "",
) -> Evidence:
    told = LeaveOneOut(elpd=np.array(elpd), pareto_k=np.full(len(elpd), pareto_k))
    return Evidence(
        model=model,
        title=model.capitalize(),
        n_params=n_params,
        status="converged" if left_out is not None else "failed",
        seconds=1.0,
        reason=reason,
        fit_percent=None if left_out is None else 90.0,
        left_out=() if left_out is None else tuple(left_out.tolist()),
        variance=None if left_out is None else variance,
        leave_one_out=told if elpd else None,
        collapse=Collapse(model=same_as, reason="sigma is at upper bound") if same_as else None,
    )


def verdicts(*evidence: Evidence, n_effective: float = 100.0) -> dict[str, str]:
    return {each.model: each.verdict for each in rank(evidence, n_effective)}


def ranking(*evidence: Evidence, missing: tuple[str, ...] = ()) -> Ranking:
    return ranking_of(
        rank(evidence, 100.0),
        held_out="6 tests, each predicted without itself",
        n_folds=6,
        n_blocks=12,
        n_effective=100.0,
        missing=missing,
    )


WOBBLE = np.array([0.004, -0.004, 0.005, -0.005, 0.006, -0.004])


def test_a_larger_family_is_not_chosen_for_a_hair() -> None:
    # A tenth of a point better on every test: always, but by less than rigs repeat.
    assert verdicts(family("small", 4, TESTS), family("large", 9, TESTS - 0.0009)) == {
        "large": "as good",
        "small": "chosen",
    }


def test_within_one_standard_error_the_simpler_is_chosen() -> None:
    assert verdicts(family("small", 4, TESTS + 0.001 + WOBBLE), family("large", 9, TESTS)) == {
        "large": "as good",
        "small": "chosen",
    }


def test_a_family_that_is_better_everywhere_is_chosen_at_any_size() -> None:
    found = verdicts(family("small", 4, TESTS), family("large", 9, TESTS - 0.02))
    assert found == {"large": "chosen", "small": "behind"}


def test_the_pairing_tells_what_the_scatter_of_tests_hides() -> None:
    # Tests differ by far more than the families do, on all of them alike.
    scattered = np.array([0.05, 0.30, 0.10, 0.50, 0.20, 0.40])
    found = rank([family("worse", 4, scattered + 0.01 + 0.1 * WOBBLE), family("better", 5, scattered)], 100.0)
    assert [each.verdict for each in found] == ["chosen", "behind"]
    assert found[1].left_out_error is not None
    assert found[1].left_out_behind_error is not None
    assert found[1].left_out_behind_error < 0.01 * found[1].left_out_error


def test_one_test_that_goes_wrong_does_not_excuse_a_family() -> None:
    # The paired difference is 40 points with an error of 40.
    failing = TESTS + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 2.4])
    assert verdicts(family("fragile", 3, failing), family("sound", 8, TESTS))["fragile"] == "behind"


def test_the_order_does_not_depend_on_that_of_the_evidence() -> None:
    families = [family(name, n, TESTS + 0.01 * n) for name, n in (("a", 3), ("b", 5), ("c", 4))]
    assert rank(families, 100.0) == rank(families[::-1], 100.0)


def test_bic_counts_effective_samples_and_parameters() -> None:
    small, large = rank([family("small", 4, TESTS), family("large", 9, TESTS + 0.05, variance=0.009)], 50.0)
    assert small.bic is not None
    assert large.bic is not None
    assert large.bic - small.bic == pytest.approx(50.0 * np.log(0.9) + 5.0 * np.log(50.0))
    assert small.bic_behind == 0.0


def test_differences_in_log_density_are_paired_over_blocks() -> None:
    base = (10.0, -30.0, 25.0, 0.0)
    best, other = rank(
        [
            family("best", 4, TESTS, elpd=base),
            family("other", 4, TESTS + 0.05, elpd=tuple(each - 2.0 for each in base)),
        ],
        100.0,
    )
    assert best.elpd == 5.0
    assert (other.elpd_behind, other.elpd_behind_error) == (8.0, pytest.approx(0.0, abs=1e-12))


def test_a_family_that_failed_is_a_row_with_its_reason() -> None:
    found = rank([family("broken", 4, None, reason="it diverged"), family("sound", 5, TESTS)], 100.0)
    assert [(each.model, each.verdict, each.reason) for each in found] == [
        ("sound", "chosen", ""),
        ("broken", "failed", "it diverged"),
    ]


def test_where_all_failed_the_reasons_are_told(refused: Refused) -> None:
    refused(rank, [family("broken", 4, None, reason="it diverged")], None)


def test_the_sentence_tells_choice_margin_and_where_criteria_disagree() -> None:
    found = ranking(
        family("small", 4, TESTS + 0.001 + WOBBLE, elpd=(1.0, 2.0, 1.5)),
        family("large", 9, TESTS, variance=0.005, elpd=(5.0, 5.5, 5.2), pareto_k=0.9),
        family("poor", 3, TESTS + 0.2, variance=0.05, elpd=(0.0, 0.0, 0.0)),
        family("broken", 4, None, reason="it diverged"),
        missing=("other",),
    )
    assert found.chosen == "small"
    for words in (
        "Failed, and so not compared: Broken",
        "Of 4 families, Small with 4 parameters is chosen",
        "6 tests, each predicted without itself",
        "behind Large, the best, which has 5 parameters more: as good, and simpler",
        "Next comes Poor with 3 parameters, 20.00",
        "PSIS-LOO prefers Large",
        "Pareto k of 3 blocks is above 0.7",
        "BIC prefers Large",
        "lacks other",
    ):
        assert words in found.sentence


def test_families_that_failed_are_said_first() -> None:
    found = ranking(family("broken", 4, None, reason="it diverged"), family("sound", 5, TESTS))
    assert found.sentence.startswith("Failed, and so not compared: Broken. Of 2 families, Sound")
    assert found.doubts == ("not compared, as its predictions failed: broken (it diverged)",)
    assert ranking(family("sound", 5, TESTS)).doubts == ()


def test_a_family_is_not_chosen_because_a_far_better_one_could_not_predict() -> None:
    poor = replace(family("poor", 4, TESTS + 0.4), fit_percent=57.0)
    better = replace(family("better", 9, None, reason="too few commands"), fit_percent=97.4)
    found = ranking(poor, better)
    assert [(each.model, each.verdict) for each in found.standings] == [
        ("poor", "provisional"),
        ("better", "failed"),
    ]
    assert "No family is chosen: Better, which failed, fits all tests far better" in found.sentence
    assert "is chosen" not in found.sentence.replace("No family is chosen", "")
    assert found.disagreement() == ""
    # One that fits all tests no better leaves the choice as it is.
    assert ranking(poor, replace(better, fit_percent=57.5)).standings[0].verdict == "chosen"


def test_criteria_that_agree_are_said_to() -> None:
    sentence = ranking(
        family("good", 4, TESTS, elpd=(5.0, 5.5, 5.2)),
        family("poor", 5, TESTS + 0.2, variance=0.05, elpd=(0.0, 0.0, 0.0)),
    ).sentence
    assert "PSIS-LOO over 12 blocks agrees" in sentence
    assert "BIC agrees" in sentence
    assert "Pareto" not in sentence


def test_a_difference_within_its_error_is_no_preference() -> None:
    sentence = ranking(
        family("good", 4, TESTS, elpd=(5.0, 3.0, 5.0)),
        family("poor", 5, TESTS + 0.2, variance=0.05, elpd=(4.0, 5.0, 4.5)),
    ).sentence
    assert "PSIS-LOO does not distinguish it from Poor" in sentence


def test_rows_are_frozen_numbers() -> None:
    (row,) = rank([family("only", 2, TESTS[:1])], 100.0)
    assert isinstance(row, Standing)
    # One fold tells no standard error.
    assert row.left_out_error is None
    assert row.left_out_percent == pytest.approx(90.0)


def test_a_family_that_has_collapsed_to_a_simpler_one_cannot_be_chosen_over_it() -> None:
    simple, rich = family("simple", 7, TESTS), family("rich", 11, TESTS - 0.02)
    # The better prediction of the data left out would choose it.
    assert verdicts(simple, rich) == {"simple": "behind", "rich": "chosen"}
    same = family("rich", 11, TESTS - 0.02, same_as="simple")
    assert verdicts(simple, same) == {"simple": "chosen", "rich": "collapsed"}
    found = ranking(simple, same)
    assert found.chosen == "simple"
    assert [(each.model, each.same_as) for each in found.standings] == [("simple", ""), ("rich", "simple")]
    assert "Rich counts as Simple: sigma is at upper bound" in found.sentence
    assert found._summary().rows[1][-1] == "collapsed, sigma is at upper bound"


def test_a_collapsed_family_stays_where_the_simpler_one_failed() -> None:
    assert (
        verdicts(family("simple", 7, None), family("rich", 11, TESTS, same_as="simple"))["rich"] == "chosen"
    )


FOLDS = np.array([0.070, 0.071, 0.072, 0.073])


def remark(evidence: list[Evidence], steps: dict[str, float]) -> tuple[str, ...]:
    own = {each.model: replace(each, cost=BuildingCost(steps=steps[each.model])) for each in evidence}
    return cost_remark(rank([*own.values()], None), own)


def test_a_cheap_choice_is_not_remarked_upon() -> None:
    assert remark([family("loop", 7, FOLDS), family("curve", 8, FOLDS)], {"loop": 8, "curve": 2}) == ()


def test_of_families_as_good_one_that_is_not_costly_is_chosen() -> None:
    steps = {"loop": 64, "curve": 2, "line": 2}
    families = [
        replace(each, cost=BuildingCost(steps=steps[each.model]))
        for each in (
            family("loop", 7, FOLDS),
            family("curve", 8, FOLDS + 0.0005),
            family("line", 9, FOLDS + 0.004),
        )
    ]
    assert verdicts(*families) == {"loop": "as good", "curve": "chosen", "line": "behind"}
    sentence = ranking(*families).sentence
    assert "behind Loop, the best, as good, and it takes fewer steps in a building" in sentence


def test_a_family_that_something_speaks_against_is_not_chosen_while_others_are_left() -> None:
    dying = replace(family("dying", 5, FOLDS), objections=("the law of c vanishes",))
    assert verdicts(dying, family("sound", 6, FOLDS + 0.01)) == {"sound": "chosen", "dying": "unusable"}
    assert verdicts(dying) == {"dying": "chosen"}


def test_a_cheap_family_that_is_not_as_good_is_the_nearest() -> None:
    (found,) = remark([family("loop", 7, FOLDS), family("line", 6, FOLDS + 0.01)], {"loop": 64, "line": 2})
    assert found.endswith(
        "of those that take fewer than 16 Line comes nearest (91.85 % against 92.85 % left out)"
    )


def test_without_a_cheap_family_that_is_said() -> None:
    (found,) = remark([family("loop", 7, FOLDS), family("line", 8, FOLDS)], {"loop": math.inf, "line": 32})
    assert found == (
        "the fit of Loop takes more than 512 integration steps a sample of 1 ms in a building, and so does every "
        "other that predicts what was left out"
    )


@pytest.fixture(scope="module")
def compared() -> Ranking:
    families = [
        family("good", 4, np.array([0.05, 0.07, 0.06]), variance=0.04, elpd=(0.5,), pareto_k=0.9),
        family("large", 9, np.array([0.05, 0.07, 0.0595]), variance=0.09),
        family("poor", 3, np.array([0.30, 0.25, 0.20]), variance=0.03),
        family("lost", 5, np.array([2.0, 8.0, 0.1]), variance=0.05),
        family("broken", 6, None, reason="it diverged"),
    ]
    return ranking_of(rank(families, 100.0), held_out="3 tests", n_folds=3, n_blocks=2, n_effective=100.0)


def test_every_family_is_a_row_and_the_reasons_are_there(compared: Ranking) -> None:
    table = compared.table
    rows = {row[0]: dict(zip(table.columns, row, strict=True)) for row in table.rows}
    assert list(rows) == ["large", "good", "poor", "lost", "broken"]
    assert rows["good"]["remark"] == "chosen, Pareto k above 0.7 in 1 block"
    assert rows["large"]["remark"].startswith("as good")
    assert rows["broken"]["remark"] == "failed, it diverged"
    assert rows["broken"]["left-out fit %"] == rows["broken"]["Δ BIC"] == "–"
    assert rows["good"]["left-out fit %"] == "94.00 ± 0.58"
    assert rows["large"]["behind, points"] == "0.00"


def test_page_and_terminal_have_the_same_cells_of_a_ranking(compared: Ranking) -> None:
    text, page = compared.table, compared.page_table
    assert [row[1:] for row in text.rows] == [row[1:] for row in page.rows]
    assert [each.lower() for each in text.columns] == [each.lower() for each in page.columns]
    assert [row[0] for row in page.rows] == [each.title for each in compared.standings]


def test_the_figure_has_every_family_that_was_judged_within_its_axes(compared: Ranking) -> None:
    figure = ranking_figure(compared)
    (axes,) = figure.axes
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert labels == ["Large, 9", "Good, 4", "Poor, 3", "Lost, 5"]
    assert [label.get_fontweight() for label in axes.get_yticklabels()] == [
        "normal",
        "bold",
        "normal",
        "normal",
    ]
    left, right = axes.get_xlim()
    # What lies 300 points away must not squeeze the others.
    assert right - left < 60.0
    for line in axes.lines:
        x = np.asarray(line.get_xdata(), dtype=float)
        assert np.all(x <= right)
    said = [text.get_text() for text in axes.texts]
    assert "chosen" in said
    assert "as good" in said
    assert f"{numbers.MINUS}237 %" in said
    assert svg_bytes(figure) == svg_bytes(ranking_figure(compared))


def test_a_single_family_on_a_single_fold_can_be_drawn() -> None:
    alone = ranking_of(
        rank([family("only", 2, np.array([0.1]))], None),
        held_out="later cycles",
        n_folds=1,
        n_blocks=None,
        n_effective=None,
    )
    assert len(ranking_figure(alone).axes[0].get_yticklabels()) == 1
