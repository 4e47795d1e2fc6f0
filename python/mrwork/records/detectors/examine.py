"""Everything the doctor looks for in a test that has been read: one list, one detector a line."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from mrwork.records.damper_test import DamperTest, Finding
from mrwork.records.detectors.breakaway import breakaway_finding
from mrwork.records.detectors.clipping import clipping_findings
from mrwork.records.detectors.delay import delay_finding
from mrwork.records.detectors.drift import drift_finding
from mrwork.records.detectors.inertia import mass_finding
from mrwork.records.detectors.smoothing import smoothing_finding

_DETECTORS: Final[tuple[Callable[[DamperTest], tuple[Finding, ...]], ...]] = (
    smoothing_finding,
    delay_finding,
    mass_finding,
    breakaway_finding,
    clipping_findings,
    drift_finding,
)


def examine(test: DamperTest) -> tuple[Finding, ...]:
    """What the signals of a test reveal about how they were taken."""
    return tuple(finding for detector in _DETECTORS for finding in detector(test))
