"""Findings that the checks make in several tests, each once with the tests that it concerns."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from mrwork.records.damper_test import DamperTest, Finding

# Tests that a sentence names; of more it names some and counts the others.
_NAMED = 6
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedFinding:
    """A finding in one or several of `n_tests` tests, whose messages differ in their numbers at most.

    `message` is that of the first of `tests`, names in their order; it is of every test where `equal`. `lowest` and
    `highest` are the measured sizes [unit], `None` where nothing was measured.
    """

    code: str
    severity: str
    message: str
    tests: tuple[str, ...]
    n_tests: int
    equal: bool
    lowest: float | None = None
    highest: float | None = None
    unit: str = ""

    @classmethod
    def of_one(cls, finding: Finding, test: str, n_tests: int) -> SharedFinding:
        """A finding of one test."""
        return _told(finding, (test,), n_tests)

    @classmethod
    def of_the_set(cls, finding: Finding, n_tests: int) -> SharedFinding:
        """A finding of all tests together, whose message names those that it concerns."""
        return _told(finding, (), n_tests)

    @property
    def in_words(self) -> str:
        """One sentence: the severity, the tests, the message, and the range of the measured sizes."""
        place = f" in {self.concerned}" if self.tests else ""
        return f"{self.severity}{place}: {self.message}{self._numbers}"

    @property
    def concerned(self) -> str:
        """The tests in words: the one, all, or their number and the names of the first."""
        count = len(self.tests)
        if count == 1:
            return self.tests[0]
        if count == self.n_tests:
            return f"all {count} tests"
        named = ", ".join(self.tests[:_NAMED])
        more = f" and {count - _NAMED} more" if count > _NAMED else ""
        return f"{count} of {self.n_tests} tests ({named}{more})"

    @property
    def _numbers(self) -> str:
        if self.equal:
            return ""
        span = ""
        if self.lowest is not None and self.highest is not None and self.lowest < self.highest:
            unit = f" {self.unit}" if self.unit else ""
            span = f"; over these tests {self.lowest:.3g} to {self.highest:.3g}{unit}"
        return f" [numbers of {self.tests[0]}{span}]"


@dataclass(frozen=True, slots=True, kw_only=True)
class GatheredFindings:
    """Findings of several tests: those that recur, warnings first, and for each test those of it alone."""

    shared: tuple[SharedFinding, ...]
    own: tuple[tuple[Finding, ...], ...]


def gathered_findings(tests: Sequence[DamperTest]) -> GatheredFindings:
    """Separate the findings that recur in several of `tests` from those of one test."""
    places: dict[tuple[str, str, str], list[tuple[DamperTest, Finding]]] = {}
    for test in tests:
        for finding in test.findings:
            places.setdefault(_key(finding), []).append((test, finding))
    recurring = {key: found for key, found in places.items() if len(_concerned(found)) > 1}
    shared = [_shared(found, len(tests)) for found in recurring.values()]
    return GatheredFindings(
        shared=tuple(sorted(shared, key=lambda each: each.severity != "warning")),
        own=tuple(
            tuple(finding for finding in test.findings if _key(finding) not in recurring) for test in tests
        ),
    )


def _told(finding: Finding, tests: tuple[str, ...], n_tests: int) -> SharedFinding:
    measured = finding.measured
    value = None if measured is None else measured.value
    return SharedFinding(
        code=finding.code,
        severity=finding.severity,
        message=finding.message,
        tests=tests,
        n_tests=n_tests,
        equal=True,
        lowest=value,
        highest=value,
        unit="" if measured is None else measured.unit,
    )


def _key(finding: Finding) -> tuple[str, str, str]:
    """Equal for findings that differ in the numbers of their messages only."""
    return finding.code, finding.severity, _NUMBER.sub("", finding.message)


def _concerned(found: Sequence[tuple[DamperTest, Finding]]) -> list[DamperTest]:
    """The tests, each once: a check may find the same in two channels of a test."""
    return list({id(test): test for test, _ in found}.values())


def _shared(found: Sequence[tuple[DamperTest, Finding]], n_tests: int) -> SharedFinding:
    first = found[0][1]
    measured = [finding.measured for _, finding in found if finding.measured is not None]
    values = [each.value for each in measured]
    return SharedFinding(
        code=first.code,
        severity=first.severity,
        message=first.message,
        tests=tuple(test.name for test in _concerned(found)),
        n_tests=n_tests,
        equal=all(finding.message == first.message for _, finding in found),
        lowest=min(values, default=None),
        highest=max(values, default=None),
        unit=measured[0].unit if measured else "",
    )
