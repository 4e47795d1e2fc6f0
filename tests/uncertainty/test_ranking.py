"""Ranking of families by the left-out fit, the simplest of equal ones first: sentence, remark, table and figure."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mrwork.base.remark import RemarkKind
from mrwork.identification.result import BuildingCost
from mrwork.report.fit.later import ranking_figure
from mrwork.uncertainty.choice.ranking import Ranking, Standing, rank

TESTS = np.array([0.10, 0.14, 0.08, 0.12, 0.11, 0.13])


def family(
    model: str,
    n_params: int,
    left_out: np.ndarray[tuple[int], np.dtype[np.float64]] | None,
    *,
    reason: str = "",
    same_as: str = "",
) -> Standing:
    return Standing(
        model=model,
        title=model.capitalize(),
        n_params=n_params,
        status="converged" if left_out is not None else "failed",
        seconds=1.0,
        reason="sigma is at upper bound" if same_as else reason,
        fit_percent=None if left_out is None else 90.0,
        left_out=() if left_out is None else tuple(left_out.tolist()),
        same_as=same_as,
    )


def verdicts(*evidence: Standing) -> dict[str, str]:
    return {each.model: each.verdict for each in rank(evidence)}


def ranking(*evidence: Standing, missing: tuple[str, ...] = ()) -> Ranking:
    return Ranking.of(evidence, held_out="6 tests, each predicted without itself", n_folds=6, missing=missing)


WOBBLE = np.array([0.004, -0.004, 0.005, -0.005, 0.006, -0.004])


# A tenth of a point on every test is less than rigs repeat; a paired difference of 40 points with an error of 40 does
# not excuse the family that fails on one test.
RULES: dict[str, tuple[tuple[Standing, ...], dict[str, str]]] = {
    "not for a hair": (
        (family("small", 4, TESTS), family("large", 9, TESTS - 0.0009)),
        {"small": "chosen", "large": "as good"},
    ),
    "the simpler within one standard error": (
        (family("small", 4, TESTS + 0.001 + WOBBLE), family("large", 9, TESTS)),
        {"small": "chosen", "large": "as good"},
    ),
    "the better everywhere at any size": (
        (family("small", 4, TESTS), family("large", 9, TESTS - 0.02)),
        {"small": "behind", "large": "chosen"},
    ),
    "not the one that fails on a test": (
        (family("fragile", 3, TESTS + 2.4 * np.eye(6)[5]), family("sound", 8, TESTS)),
        {"fragile": "behind", "sound": "chosen"},
    ),
    "the collapsed where the simpler one failed": (
        (family("simple", 7, None), family("rich", 11, TESTS, same_as="simple")),
        {"simple": "failed", "rich": "chosen"},
    ),
}


@pytest.mark.parametrize("rule", RULES)
def test_which_family_is_chosen(rule: str) -> None:
    families, expected = RULES[rule]
    assert verdicts(*families) == expected


def test_of_families_as_simple_one_that_fits_all_tests_far_better_is_chosen() -> None:
    first = replace(family("first", 4, TESTS), fit_percent=94.0)
    better = replace(family("better", 4, TESTS + 0.001 + WOBBLE), fit_percent=96.0)
    assert verdicts(first, better) == {"first": "as good", "better": "chosen"}
    assert "as good as First, with 96.00 % instead of 94.00 % on all tests" in ranking(first, better).sentence
    for other in (replace(better, fit_percent=94.5), replace(better, n_params=5)):
        assert verdicts(first, other) == {"first": "chosen", "better": "as good"}
    behind = replace(better, left_out=family("", 4, TESTS + 0.02 + WOBBLE).left_out)
    assert verdicts(first, behind) == {"first": "chosen", "better": "behind"}


def test_the_pairing_tells_what_the_scatter_of_tests_hides() -> None:
    # Tests differ by far more than the families do, on all of them alike.
    scattered = np.array([0.05, 0.30, 0.10, 0.50, 0.20, 0.40])
    found = rank([family("worse", 4, scattered + 0.01 + 0.1 * WOBBLE), family("better", 5, scattered)])
    assert [each.verdict for each in found] == ["chosen", "behind"]
    assert found[1].left_out_error is not None
    assert found[1].left_out_behind_error is not None
    assert found[1].left_out_behind_error < 0.01 * found[1].left_out_error


def test_the_sentence_tells_choice_and_margin_and_a_family_that_failed_is_a_row_with_its_reason() -> None:
    found = ranking(
        family("small", 4, TESTS + 0.001 + WOBBLE),
        family("large", 9, TESTS),
        family("poor", 3, TESTS + 0.2),
        family("broken", 4, None, reason="it diverged"),
        missing=("other",),
    )
    reasons = {each.model: (each.verdict, each.reason) for each in found.standings}
    assert (reasons["small"], reasons["broken"]) == (("chosen", ""), ("failed", "it diverged"))
    assert [(each.code, *each.words) for each in found.remarks] == [("not_compared", "broken (it diverged)")]
    for words in (
        "Of 4 families, Small with 4 parameters is chosen",
        "behind Large, the best, which has 5 parameters more",
        "Next comes Poor with 3 parameters, 20.00",
    ):
        assert words in found.sentence


def test_a_family_is_not_chosen_because_a_far_better_one_could_not_predict() -> None:
    poor = replace(family("poor", 4, TESTS + 0.4), fit_percent=57.0)
    better = replace(family("better", 9, None, reason="too few commands"), fit_percent=97.4)
    found = ranking(poor, better)
    assert [(each.model, each.verdict) for each in found.standings] == [
        ("poor", "provisional"),
        ("better", "failed"),
    ]
    assert [each.code for each in found.remarks] == ["not_compared", "none_chosen"]
    # So is one that could not predict a test, which counts as 0 %.
    lost = family("lost", 9, np.where(np.arange(6) == 5, 1.0, TESTS + 0.35))
    assert verdicts(poor, replace(lost, fit_percent=97.4, not_predicted=("fast",)))["poor"] == "provisional"
    # One that fits all tests no better leaves the choice as it is.
    assert ranking(poor, replace(better, fit_percent=57.5)).standings[0].verdict == "chosen"


def test_rows_are_frozen_numbers() -> None:
    (row,) = rank([family("only", 2, TESTS[:1])])
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


FOLDS = np.array([0.070, 0.071, 0.072, 0.073])


def costing(family: Standing, steps: float) -> Standing:
    cost = BuildingCost(steps=steps)
    return replace(family, steps=steps if cost.is_possible else None, is_costly=cost.is_high)


def remarks(*families: Standing) -> list[str]:
    return [each.message for each in ranking(*families).remarks]


def test_of_families_as_good_one_that_is_not_costly_is_chosen() -> None:
    families = [
        costing(family("loop", 7, FOLDS), 64),
        costing(family("curve", 8, FOLDS + 0.0005), 2),
        costing(family("line", 9, FOLDS + 0.004), 2),
    ]
    assert verdicts(*families) == {"loop": "as good", "curve": "chosen", "line": "behind"}
    assert "takes fewer steps in a building" in ranking(*families).sentence


def test_a_family_that_something_speaks_against_is_not_chosen_while_others_are_left() -> None:
    dying = replace(
        family("dying", 5, FOLDS), remarks=(RemarkKind("dying", "its law vanishes", warns=True).remark(),)
    )
    assert verdicts(dying, family("sound", 6, FOLDS + 0.01)) == {"sound": "chosen", "dying": "unusable"}
    assert verdicts(dying) == {"dying": "chosen"}


def test_a_costly_choice_names_the_nearest_cheap_family() -> None:
    (found,) = remarks(costing(family("loop", 7, FOLDS), 64), costing(family("line", 6, FOLDS + 0.01), 2))
    assert "Line comes nearest (91.85 % against 92.85 % left out)" in found
    curve = costing(family("curve", 8, FOLDS), 2)
    assert remarks(costing(family("loop", 7, FOLDS), 8), curve) == []
    (found,) = remarks(costing(family("loop", 7, FOLDS), math.inf), replace(curve, is_costly=True))
    assert "more than 512 integration steps" in found


@pytest.fixture(scope="module")
def compared() -> Ranking:
    families = [
        family("good", 4, np.array([0.05, 0.07, 0.06])),
        family("large", 9, np.array([0.05, 0.07, 0.0595])),
        family("poor", 3, np.array([0.30, 0.25, 0.20])),
        family("lost", 5, np.array([2.0, 8.0, 0.1])),
        family("broken", 6, None, reason="it diverged"),
    ]
    return Ranking.of(families, held_out="3 tests", n_folds=3)


def test_every_family_is_a_row_and_the_reasons_are_there(compared: Ranking) -> None:
    table = compared.table
    rows = {row[0]: dict(zip(table.columns, row, strict=True)) for row in table.rows}
    assert list(rows) == ["large", "good", "poor", "lost", "broken"]
    assert rows["broken"]["left-out fit"] == rows["broken"]["behind"] == "–"
    assert rows["good"]["left-out fit"] == "94.00 ± 0.58"
    assert rows["large"]["behind"] == "0.00"


@pytest.mark.words
def test_the_figure_has_every_family_that_was_judged_within_its_axes(compared: Ranking) -> None:
    (axes,) = ranking_figure(compared).axes
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert labels == ["Large, 9", "Good, 4", "Poor, 3", "Lost, 5"]
    left, right = axes.get_xlim()
    # What lies 300 points away must not squeeze the others.
    assert right - left < 60.0
    assert all(np.all(np.asarray(line.get_xdata(), dtype=float) <= right) for line in axes.lines)
