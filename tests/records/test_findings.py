"""A finding that recurs in several tests is said once, with the tests that it concerns."""

from __future__ import annotations

from dataclasses import replace

from report_samples import comparison

from mrwork.records import DamperTest, Finding, Measured
from mrwork.records.findings import gathered_findings


def lag(milliseconds: float) -> Finding:
    return Finding(
        code="lag",
        severity="note",
        message=f"the force lags by {milliseconds:g} ms, as filters do",
        measured=Measured(value=1e-3 * milliseconds, unit="s"),
    )


OFFSET = Finding(code="offset", severity="warning", message="the force has an offset")
ALONE = Finding(code="rest", severity="note", message="at rest for 2 s")


def with_findings(name: str, *findings: Finding) -> DamperTest:
    return replace(comparison(name).test, findings=findings)


def test_findings_that_differ_in_numbers_are_one_with_their_range() -> None:
    tests = [
        with_findings("a", lag(0.5), ALONE),
        with_findings("b", lag(2.5), OFFSET),
        with_findings("c", OFFSET),
    ]
    found = gathered_findings(tests)
    warning, note = found.shared
    assert warning.in_words == "warning in 2 of 3 tests (b, c): the force has an offset"
    assert note.in_words == (
        "note in 2 of 3 tests (a, b): the force lags by 0.5 ms, as filters do "
        "[numbers of a; over these tests 0.0005 to 0.0025 s]"
    )
    assert found.own == ((ALONE,), (), ())


def test_a_finding_in_every_test_names_none_and_many_names_are_counted() -> None:
    tests = [with_findings(f"t{number}", OFFSET, *([ALONE] if number < 8 else [])) for number in range(9)]
    everywhere, often = gathered_findings(tests).shared
    assert everywhere.in_words.startswith("warning in all 9 tests: ")
    assert everywhere.tests == tuple(f"t{number}" for number in range(9))
    assert "8 of 9 tests (t0, t1, t2, t3, t4, t5 and 2 more)" in often.in_words


def test_what_one_test_says_twice_is_not_shared() -> None:
    found = gathered_findings([with_findings("a", lag(1.0), lag(2.0)), with_findings("b")])
    assert found.shared == ()
    assert found.own == ((lag(1.0), lag(2.0)), ())
