"""Changes of every quantity come before a score, and constant commands are ranked apart from control laws."""

import math
from dataclasses import replace

import numpy as np
import pytest
import study_samples

from mrwork.report.study.front import study_lead
from mrwork.study import StudyResults, compared
from mrwork.study.comparison import change_table, compared_quantities, scored_in_words, verdict
from mrwork.study.study import Row
from mrwork.study.study_folder import study_document

# Isolation has the lowest score of all, and Lyapunov that of the laws in spite of its peak accelerations.
SHAKEN = 4
WORSE = 1.68


def shaken(rows: tuple[Row, ...] = study_samples.ROWS, **changes: object) -> StudyResults:
    """The samples, with the peak acceleration of the last law under the second motion far above that of i = 0."""
    whole = study_samples.results()
    runs = study_samples.runs_by_place(whole)
    for motion in range(2):
        for name in ("peak_drift", "rms_drift", "peak_acceleration", "rms_acceleration"):
            runs[2, motion][name] = 0.1 * runs[2, motion][name]
        runs[3, motion]["rms_drift"] = 2.0 * runs[3, motion]["rms_drift"]
    runs[SHAKEN, 1]["peak_acceleration"] = WORSE * runs[0, 1]["peak_acceleration"]
    return replace(study_samples.with_runs(whole, runs, rows=rows), **changes)  # type: ignore[arg-type] # any field


def with_constant() -> StudyResults:
    """The same with the third row as the best constant command."""
    rows = list(study_samples.ROWS)
    rows[3] = Row(label="Best constant, 0.4 A", kind="best_passive")
    return shaken(tuple(rows))


def test_changes_are_those_of_the_criteria() -> None:
    results = shaken()
    comparison = compared(results)
    changes = comparison.tables[SHAKEN, 0]
    assert set(changes) == {entry.name for entry in compared_quantities()}
    expected = [
        results.ratios(SHAKEN, motion, "uncontrolled")["peak_acceleration"] - 1.0 for motion in (0, 1)
    ]
    found = changes["peak_acceleration"]
    assert (found.mean, found.largest, found.motion) == (
        pytest.approx(sum(expected) / 2),
        pytest.approx(WORSE - 1.0),
        "filtered noise",
    )


def test_constant_commands_and_other_devices_are_ranked_apart() -> None:
    comparison = compared(with_constant())
    ranks = {rank.name: rows for rank, rows in comparison.ranks}
    assert ranks == {"law": (4,), "passive": (3, 1), "other_device": (2,), "uncontrolled": (0,)}
    # Isolation has the lowest score of all, and is no law.
    assert min(range(5), key=lambda row: comparison.results.score(row).mean) == 2
    assert comparison.leading == 4
    assert comparison.passive == 3
    assert comparison.results.is_compared


def test_a_study_without_the_best_constant_command_lacks_it() -> None:
    assert not shaken().is_compared


def test_the_table_of_changes_has_the_worse_ones_alarming() -> None:
    comparison = compared(with_constant())
    line = [entry.name for entry in compared_quantities()].index("peak_acceleration")
    table = change_table(comparison, 0, range(len(comparison.results.rows)))
    assert table.rows[0][0] == "Lyapunov <1 A>"
    assert (0, line + 1) in table.alarming
    assert table.rows[0][-1] == "Acc. +68, filtered noise"
    assert list(table.headings.values()) == ["Control laws", "Passive dampers", "Other devices"]


def test_the_results_file_has_every_change() -> None:
    document = study_document(with_constant())
    assert document["best_passive"] == "Best constant, 0.4 A"
    law, best, off, *_ = document["changes"]
    assert (law["controller"], law["rank"], law["place"]) == ("Lyapunov <1 A>", "law", 1)
    assert law["worse_than_uncontrolled"] == ("peak_acceleration",)
    assert law["against_uncontrolled"]["peak_acceleration"]["motion"] == "filtered noise"
    assert set(law["against_best_passive"]) == {entry.name for entry in compared_quantities()}
    assert [each["rank"] for each in (best, off)] == ["passive", "passive"]
    run = next(each for each in document["results"] if each["controller"] == law["controller"])
    reference = next(each for each in document["results"] if each["controller"] == best["controller"])
    assert run["over_best_passive"]["peak_drift"] == pytest.approx(
        run["criteria"]["peak_drift"] / reference["criteria"]["peak_drift"]
    )


def test_a_run_that_failed_leaves_no_change() -> None:
    results = shaken()
    failed = study_samples.diverged(results, SHAKEN, 0)
    assert compared(failed).leading == 3
    assert math.isnan(study_document(failed)["changes"][1]["against_uncontrolled"]["peak_drift"]["mean"])


def test_many_laws_are_counted_where_they_are_worse() -> None:
    table = change_table(compared(shaken()), 0, ())
    counts = dict(zip([entry.name for entry in compared_quantities()], table.foot[1:], strict=False))
    # Of the two laws, the last one.
    assert (counts["peak_acceleration"], counts["peak_drift"]) == ("1", "0")


def test_a_study_with_a_score_of_its_own_is_judged_by_it() -> None:
    # The last law lowers the peak acceleration under one motion, and the score is of the drift alone.
    results = replace(with_constant(), scored=("rms_drift",))
    assert results.has_own_score
    best = compared(results)
    own, other = (results.score(row).mean for row in (SHAKEN, 3))
    assert own < other
    assert verdict(best, SHAKEN) == "lower score on 2 of 2 motions"
    said = scored_in_words(results, SHAKEN, 3, "Best constant")
    assert (
        f"{results.rows[SHAKEN].label} has the lowest score, below Best constant: {own:.3f} for {other:.3f}"
        in said
    )
    assert scored_in_words(results, 3, SHAKEN, "the law").startswith("No law has a lower score than the law")
    assert study_lead(best).verdict.startswith(said.partition(",")[0])
    assert not with_constant().has_own_score


def test_a_verdict_names_what_did_not_finish() -> None:
    results = with_constant()
    failed = compared(study_samples.diverged(results, SHAKEN, 0))
    assert verdict(failed, SHAKEN) == "did not finish under El Centro"


@pytest.mark.words
@pytest.mark.parametrize(
    ("mean", "expected"),
    [(0.0, "idle"), (2.0, "coincides with passive-on"), (0.7, "a constant command in effect, 0.7 A")],
)
def test_a_constant_command_is_called_what_it_is(mean: float, expected: str) -> None:
    results = with_constant()
    sent = np.full(2, mean)
    for motion in range(2):
        results = study_samples.changed(results, SHAKEN, motion, mean_current=sent, rms_current=sent)
    assert expected in verdict(compared(results), SHAKEN)
