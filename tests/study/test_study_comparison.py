"""Changes of every quantity come before a score, and constant commands are ranked apart from control laws."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import study_samples

from mrwork.cli.study_text import study_text
from mrwork.report.study.page import study_page
from mrwork.study import StudyResults, compared
from mrwork.study.comparison import ADD_BEST_PASSIVE, BOTH, beaten_in_words, compared_quantities, verdict
from mrwork.study.folder import study_document
from mrwork.study.study import Row
from mrwork.study.tables import change_table

# Isolation has the lowest score of all, and Lyapunov that of the laws in spite of its peak accelerations.
SHAKEN = 4
WORSE = 1.68


def shaken(rows: tuple[Row, ...] = study_samples.ROWS, **changes: object) -> StudyResults:
    """The samples, with the peak acceleration of the last law under the second motion far above that of i = 0."""
    whole = study_samples.results()
    runs = dict(whole.runs)
    for motion in range(2):
        isolated = runs[2, motion]
        runs[2, motion] = isolated.with_numbers(
            **{
                f"{statistic}_{name}": 0.1 * getattr(isolated, f"{statistic}_{name}")
                for statistic in ("peak", "rms")
                for name in ("drift", "acceleration")
            },
        )
        runs[3, motion] = runs[3, motion].with_numbers(rms_drift=2.0 * runs[3, motion].rms_drift)
    peak = WORSE * runs[0, 1].peak_acceleration
    runs[SHAKEN, 1] = runs[SHAKEN, 1].with_numbers(peak_acceleration=peak)
    return replace(study_samples.with_runs(whole, runs, rows=rows), **changes)  # type: ignore[arg-type] # any field


def with_constant() -> StudyResults:
    """The same with the third row as the best constant command."""
    rows = list(study_samples.ROWS)
    rows[3] = Row(label="Best constant, 0.4 A", kind="best_passive")
    return shaken(tuple(rows))


def test_what_became_worse_leads_in_words_with_its_motion() -> None:
    comparison = compared(shaken())
    assert comparison.leading == SHAKEN
    bare, passive = comparison.in_words(SHAKEN)
    better, _, worse = bare.partition("; worse: ")
    assert bare.startswith("Against uncontrolled: peak displacement -60 %, peak drift -60 %")
    assert worse == "peak acceleration +4 % (+68 % under filtered noise)."
    assert "acceleration" not in better.replace("RMS acceleration", "")
    assert passive.startswith("Against Passive-off: ")


def test_changes_are_those_of_the_criteria() -> None:
    results = shaken()
    comparison = compared(results)
    changes = comparison.changes(SHAKEN, 0)
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
    assert min(range(5), key=comparison.results.score) == 2
    assert comparison.leading == 4
    assert comparison.passive == 3
    assert not comparison.lacks_best_passive


def test_a_study_without_the_best_constant_command_says_so() -> None:
    assert compared(shaken()).lacks_best_passive
    assert ADD_BEST_PASSIVE in " ".join(study_text(shaken(), Path("out")).split())
    assert ADD_BEST_PASSIVE not in " ".join(study_text(with_constant(), Path("out")).split())


def test_the_terminal_begins_with_the_changes_and_ends_with_the_scores() -> None:
    text = study_text(with_constant(), Path("out"))
    places = [
        text.index(part)
        for part in (
            "worse: peak",
            "Change in % against uncontrolled",
            "Change in % against Best constant, 0.4 A",
            "El Centro: criteria",
            "Score (",
        )
    ]
    assert places == sorted(places)
    scores = text[places[-1] :]
    assert scores.index("Control laws") < scores.index("Passive dampers") < scores.index("Other devices")


def test_the_page_leads_with_the_changes_and_colours_the_worse_ones() -> None:
    results = with_constant()
    page = study_page(results, study_samples.histories)
    assert page.index('<p class="verdict">') < page.index('id="changes"') < page.index('id="criteria"')
    verdict = page[page.index('<p class="verdict">') :].split("</p>")[0]
    assert "No law lowers both peaks against Best constant, 0.4 A on average over 2 motions" in verdict
    comparison = compared(results)
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
    assert law["worse_than_uncontrolled"] == ["peak_acceleration"]
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
    runs = dict(results.runs)
    runs[SHAKEN, 0] = replace(runs[SHAKEN, 0], outcome="diverged")
    failed = study_samples.with_runs(results, runs)
    assert compared(failed).leading == 3
    assert compared(failed).in_words(SHAKEN) == []
    assert study_document(failed)["changes"][1]["against_uncontrolled"]["peak_drift"]["mean"] is None


def test_one_motion_has_no_mean_and_many_laws_are_counted() -> None:
    results = shaken()
    one = study_samples.with_runs(
        results,
        motions=results.motions[1:],
        runs={(row, 0): run for (row, motion), run in results.runs.items() if motion == 1},
    )
    comparison = compared(one)
    assert "mean" not in comparison.heading(4)
    assert change_table(comparison, 0, range(len(comparison.results.rows))).columns[-1] == "RMS shear"
    # Of the two laws, the last one.
    counts = comparison.worse_counts(0)
    assert counts["peak_acceleration"] == 1
    assert counts["peak_drift"] == 0
    assert (
        change_table(comparison, 0, range(len(comparison.results.rows))).foot[0] == "Worse control laws, of 2"
    )


def test_a_law_has_its_verdict_in_words() -> None:
    assert verdict(compared(with_constant()), SHAKEN) == (
        "better in drift on 2, in acceleration on 1 of 2; equal within the spread"
    )
    # Without a constant command beside them laws are compared with passive-off.
    assert verdict(compared(shaken()), SHAKEN).startswith("better in drift on 2, in acceleration on 1 of 2")


def test_where_a_run_did_not_finish_no_law_is_said_to_be_worse() -> None:
    changes = {name: np.array([-0.1, np.nan]) for name in BOTH}
    assert (
        beaten_in_words("LQG", "1 A", changes) == "LQG has no mean change against 1 A: a run did not finish"
    )


def test_a_verdict_names_what_did_not_finish() -> None:
    results = with_constant()
    runs = dict(results.runs)
    runs[SHAKEN, 0] = replace(runs[SHAKEN, 0], outcome="diverged")
    failed = compared(study_samples.with_runs(results, runs, rows=results.rows))
    assert verdict(failed, SHAKEN) == "did not finish under El Centro"
    runs = dict(results.runs)
    runs[3, 1] = replace(runs[3, 1], outcome="diverged")
    without = compared(study_samples.with_runs(results, runs, rows=results.rows))
    assert verdict(without, SHAKEN).startswith(
        ("Passive-off", "Best constant, 0.4 A did not finish", "better")
    )


@pytest.mark.parametrize(
    ("mean", "expected"),
    [
        (0.0, "idle: sends no command"),
        (2.0, "coincides with passive-on"),
        (0.7, "a constant command in effect, 0.7 A"),
    ],
)
def test_a_constant_command_is_called_what_it_is(mean: float, expected: str) -> None:
    results = with_constant()
    runs = dict(results.runs)
    for motion in range(2):
        size = np.shape(runs[SHAKEN, motion].mean_current)
        sent = {"mean_current": np.full(size, mean), "rms_current": np.full(size, mean)}
        runs[SHAKEN, motion] = runs[SHAKEN, motion].with_numbers(**sent)
    assert verdict(compared(study_samples.with_runs(results, runs, rows=results.rows)), SHAKEN) == expected


def test_one_motion_has_a_verdict_without_counts() -> None:
    results = with_constant()
    runs = {key: run for key, run in results.runs.items() if key[1] == 0}
    one = study_samples.with_runs(results, runs, rows=results.rows, motions=results.motions[:1])
    assert verdict(compared(one), SHAKEN) == "better in both peaks"
