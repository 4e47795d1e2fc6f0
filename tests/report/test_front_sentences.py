"""Warnings on the front of a page are whole clauses: what stands before a colon is only a name."""

from mrwork.report.section import first_sentences


def test_a_long_warning_keeps_its_finding_and_loses_its_cure() -> None:
    finding = (
        "quarter car: at the lower end of the tested strokes the damper makes a fifth of the travel, "
        + "x" * 80
    )
    (shown,) = first_sentences([f"{finding}; test there before you rely on it"], 3)
    assert shown == f"Q{finding[1:]}."


def test_a_short_warning_is_whole_and_the_rest_is_counted() -> None:
    assert first_sentences(["a: b; c", "d"], 1) == ("A: b; c.", "1 more in the section on warnings.")
