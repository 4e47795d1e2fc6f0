"""Detectors among several tests: a force that does not match its stated command, and files with the same bytes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.records.checks import mean_over_travel
from mrwork.records.damper_test import DamperTest, Finding, Measured
from mrwork.records.motion import motion_of
from mrwork.summary import listed
from mrwork.values import holds_arrays


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


_FEWEST_ALIKE: Final = 3
# Pairs of peak velocities with a smaller logarithmic distance are too noisy for the slope.
_APART: Final = 0.1
# An outlier differs by at least this much, and by this many robust standard deviations of the set.
_STANDS_OUT: Final = 0.18
_SIGNIFICANT: Final = 3.5
_MAD_TO_DEVIATION: Final = 1.4826


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class _Loops:
    """Logarithms of dissipative force and peak velocity of tests, and their commands, shape (n_tests,)."""

    force: NDArray[np.float64]
    velocity: NDArray[np.float64]
    command: NDArray[np.float64]


def mislabelled(tests: Sequence[DamperTest]) -> tuple[Finding, ...]:
    """Warn of tests whose dissipative force does not match that of the other tests at their command.

    The dissipative force of a test is int F v dt / int |v| dt. Its logarithm is modelled by a level for each command
    and one slope over the logarithm of the peak velocity. Both are medians, so that a few wrong labels do not affect
    them. Commands with fewer than three tests have no level, nor have tests whose command varies.
    """
    findings: list[Finding] = []
    for quantity, unit in (("current", "A"), ("voltage", "V")):
        constant = {
            index: command
            for index, test in enumerate(tests)
            for command, own in test.commands
            if own == unit and not isinstance(command, np.ndarray)
        }
        if len(constant) >= _FEWEST_ALIKE:
            labelled, commands = [tests[index] for index in constant], np.array(list(constant.values()))
            findings += _standing_out(labelled, commands, quantity, unit)
    return tuple(findings)


def _standing_out(
    tests: Sequence[DamperTest], commands: NDArray[np.float64], quantity: str, unit: str
) -> list[Finding]:
    # Commands that differ by less than a percent of the largest count as equal.
    step = max(0.01 * float(np.abs(commands).max()), 1e-9)
    groups: dict[int, list[int]] = defaultdict(list)
    for row, command in enumerate(commands):
        groups[round(float(command) / step)].append(row)
    alike = [np.array(rows) for rows in groups.values() if len(rows) >= _FEWEST_ALIKE]
    if not alike:
        return []
    loops = _loops(tests, commands)
    force = loops.force - _slope(loops, alike) * loops.velocity
    levels = np.array([np.median(force[rows]) for rows in alike])
    beside = np.concatenate([force[rows] - level for rows, level in zip(alike, levels, strict=True)])
    spread = _MAD_TO_DEVIATION * float(np.median(np.abs(beside)))
    limit = max(_STANDS_OUT, _SIGNIFICANT * spread)
    at = np.array([np.median(commands[rows]) for rows in alike])
    findings = []
    for row, difference in zip(np.concatenate(alike), beside, strict=True):
        if abs(difference) <= limit:
            continue
        test = tests[row]
        ratio = float(np.expm1(difference))
        amount = f"{100 * abs(ratio):.0f} % {'more' if ratio > 0 else 'less'}"
        findings.append(
            Finding.warning(
                "command_mislabelled",
                f"{test.label}: dissipates {amount} than the other tests at "
                f"{commands[row]:.3g} {unit} in similar motion (their spread is {100 * spread:.0f} %)"
                f"{_belongs(float(force[row]), levels, at, unit)}",
                action=f"check its {quantity}",
                measured=Measured(value=ratio, standard_error=spread, unit=""),
            )
        )
    return findings


def _loops(tests: Sequence[DamperTest], commands: NDArray[np.float64]) -> _Loops:
    force, velocity = np.empty(len(tests)), np.empty(len(tests))
    for row, test in enumerate(tests):
        motion = motion_of(test.displacement, test.dt)
        travelling = motion.velocity
        power = (test.force - mean_over_travel(test.force, travelling)) @ travelling
        force[row] = max(power / np.abs(travelling).sum(), np.finfo(np.float64).tiny)
        velocity[row] = np.percentile(np.abs(travelling), 99.0)
    return _Loops(force=np.log(force), velocity=np.log(velocity), command=commands)


def _slope(loops: _Loops, alike: Sequence[NDArray[np.intp]]) -> float:
    """Median slope of log force over log velocity between pairs of tests at the same command (Theil-Sen estimator)."""
    slopes = [
        (loops.force[first] - loops.force[second]) / (loops.velocity[first] - loops.velocity[second])
        for rows in alike
        for first, second in combinations(rows, 2)
        if abs(loops.velocity[first] - loops.velocity[second]) > _APART
    ]
    return float(np.median(slopes)) if slopes else 0.0


def _belongs(force: float, levels: NDArray[np.float64], at: NDArray[np.float64], unit: str) -> str:
    """Command whose level matches the force, interpolated between those of the set."""
    order = np.argsort(at)
    levels, at = np.exp(levels[order]), at[order]
    wanted = float(np.exp(force))
    if levels.size < 2 or np.any(np.diff(levels) <= 0.0) or not levels[0] <= wanted <= levels[-1]:
        return ""
    return f", as at about {np.interp(wanted, levels, at):.2g} {unit}"
