"""Which finding of a record matters to which verb: what a verb says before anybody relies on what it computes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final, Literal, get_args

from mrwork.records.damper_test import DamperTest, Finding
from mrwork.records.detectors.labels import mislabelled, repeated_records
from mrwork.records.findings import SharedFinding, gathered_findings
from mrwork.records.repairs import REPAIR_KINDS

Verb = Literal["check", "identify", "predict", "calibrate", "sample", "profile", "plan", "report"]

_EVERY: Final[tuple[Verb, ...]] = get_args(Verb)
# Verbs that take files; the others take the tests of a run, which its identification has told of.
_OF_FILES: Final[tuple[Verb, ...]] = ("check", "identify", "predict", "calibrate")
# What changes no number by itself.
_TOLD_ONCE: Final[tuple[Verb, ...]] = ("check", "identify")

CONCERNS: Final[Mapping[str, tuple[Verb, ...]]] = {
    # Samples that the sensors did not give.
    "gaps": _EVERY,
    "spikes": _EVERY,
    "clipped": _EVERY,
    "few_samples_per_cycle": _EVERY,
    "resampled": _TOLD_ONCE,
    "time_rounded": _TOLD_ONCE,
    "nan_rows_dropped": _TOLD_ONCE,
    # The motion, which drives every simulation.
    "displacement_unusual": _EVERY,
    # All other verbs refuse it.
    "velocity_factor": ("check",),
    "velocity_sign_flipped": _EVERY,
    "velocity_inconsistent": _EVERY,
    "velocity_noisy": _EVERY,
    "velocity_late": _EVERY,
    "velocity_derived": _TOLD_ONCE,
    "rest_before_motion": _TOLD_ONCE,
    # The force, with which every simulation is compared.
    "force_sign_flipped": _EVERY,
    "force_sign_unclear": _EVERY,
    "force_delay": _EVERY,
    "moving_mass": _EVERY,
    "breakaway": _EVERY,
    "loop_drift": _EVERY,
    # A fit describes the offset and the average of its own tests; those of other tests may differ.
    "force_offset": _OF_FILES,
    "moving_average": _OF_FILES,
    # What the file says of the test.
    "command_negative": _EVERY,
    "command_varies": _TOLD_ONCE,
    "command_rings": _TOLD_ONCE,
    "command_unclear": _EVERY,
    "name_disagrees": _OF_FILES,
    "name_not_used": _OF_FILES,
    "not_used": _OF_FILES,
    "files_not_read": _OF_FILES,
    "further_records": _OF_FILES,
    "command_mislabelled": _EVERY,
    "record_repeated": _EVERY,
    # Asked for on the command line; that a repair found no cause is news.
    **{f"repaired_{kind}": _TOLD_ONCE for kind in REPAIR_KINDS},
    **{f"no_{kind}": _OF_FILES for kind in REPAIR_KINDS},
}
"""Verbs that say a finding, by its code. `check` and `identify` say all; a code that is not listed, every verb."""


def concerns(finding: Finding, verb: Verb) -> bool:
    """Whether a verb says a finding."""
    return verb in CONCERNS.get(finding.code, _EVERY)


def findings_for(verb: Verb, tests: Sequence[DamperTest]) -> tuple[SharedFinding, ...]:
    """What the checks found in several tests and in each that matters to a verb, each once, warnings first."""
    told = [
        replace(test, findings=tuple(each for each in test.findings if concerns(each, verb)))
        for test in tests
    ]
    gathered = gathered_findings(told)
    own = [
        SharedFinding.of_one(each, test.name, len(tests))
        for test, findings in zip(told, gathered.own, strict=True)
        for each in findings
    ]
    together = [
        SharedFinding.of_the_set(each, len(tests)) for each in findings_of_set(tests) if concerns(each, verb)
    ]
    return tuple(sorted((*together, *gathered.shared, *own), key=lambda each: each.severity != "warning"))


def findings_of_set(tests: Sequence[DamperTest]) -> tuple[Finding, ...]:
    """What several tests show together and none alone: wrong commands, and copies."""
    return (*mislabelled(tests), *repeated_records(tests))
