"""Detector of files with the same bytes among several tests."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from mrwork.records.damper_test import DamperTest, Finding
from mrwork.summary import listed


def repeated_records(tests: Sequence[DamperTest]) -> tuple[Finding, ...]:
    """Warn of records that are the same byte for byte, such as copies under two names."""
    copies: dict[str, list[str]] = defaultdict(list)
    for test in tests:
        if test.sha256:
            copies[test.sha256].append(test.label)
    return tuple(
        Finding.warning(
            "record_repeated",
            f"{listed(labels)} are the same record, byte for byte, which counts {len(labels)} times",
            action="give it once",
        )
        for labels in copies.values()
        if len(labels) > 1
    )
