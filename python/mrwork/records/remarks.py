"""Remarks of several tests: those that recur, and those that only a set shows."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.remark import ONCE, REMARK_KINDS, Measured, Remark, RemarkKind, Verb
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.records.checks import ONE_WAY, static_force
from mrwork.records.damper_test import DamperTest
from mrwork.records.likeness import RecordedMotion, likest
from mrwork.records.motion import robust_deviation, smooth_motion

_RECORD_REPEATED: Final = RemarkKind(
    "record_repeated",
    "{names} are the same record, byte for byte, which counts {copies} times",
    "give it once",
)


def repeated_records(tests: Sequence[DamperTest]) -> Iterator[Remark]:
    """Warn of records that are the same byte for byte, such as copies under two names."""
    copies: dict[str, list[str]] = defaultdict(list)
    for test in tests:
        if test.sha256:
            copies[test.sha256].append(test.label)
    for labels in copies.values():
        if len(labels) > 1:
            yield _RECORD_REPEATED.remark(names=list_names(labels), copies=len(labels))


_REPEAT_DIFFERS: Final = RemarkKind(
    "repeat_differs",
    "{0}",
    "check the command of both, and the temperature, pressure and pre-load",
    verbs=ONCE,
)


def repeats_that_differ(tests: Sequence[DamperTest]) -> Iterator[Remark]:
    """Warn of tests of one motion at one command whose forces differ: no model can describe both."""
    motions = [RecordedMotion.of(test) for test in tests]
    for index, motion in enumerate(motions):
        pair = likest(motion, motions[:index], force="other")
        if pair is not None and pair.known_command:
            yield _REPEAT_DIFFERS.remark(pair.force_in_words)


_FEWEST_ALIKE: Final = 3
# Pairs of peak velocities with a smaller logarithmic distance are too noisy for the slope.
_APART: Final = 0.1
# An outlier differs by at least this much, and by this many robust standard deviations of the set.
_STANDS_OUT: Final = 0.18
_SIGNIFICANT: Final = 3.5
# The force of a damper grows with a power of the velocity from 0, friction, to 1, a dashpot; half of that over this
# logarithmic distance from the other tests is less than what stands out.
_BEYOND: Final = 2.0 * _STANDS_OUT
# Share of a difference that a test as fast at another command shows, too, where it is of the damper.
_OF_DAMPER: Final = 0.5
_MISLABELLED: Final = RemarkKind(
    "command_mislabelled",
    "{label}: dissipates {share:.0f} % {more} than the other tests at {command:.3g} {unit} in similar motion (their "
    "spread is {spread:.0f} %){belongs}",
    "check its {quantity}{other}",
)
# Factors between units of force that rigs export side by side.
_FACTORS: Final = {"lbf": 4.448, "kgf": 9.807, "kN": 1e3}
_OF_FACTOR: Final = 0.2


def find_mislabelled(tests: Sequence[DamperTest]) -> Iterator[Remark]:
    """Warn of tests whose dissipative force does not match the other tests at their command.

    The dissipative force of a test is int F v dt / int |v| dt. Its logarithm is modelled by a level for each command
    and one slope over the logarithm of the peak velocity. Both are medians, so that a few wrong labels do not affect
    them. Commands with fewer than three tests have no level, nor have tests whose command varies; a test far slower or
    faster than all others at its command is not judged.
    """
    for quantity, unit in (("current", "A"), ("voltage", "V")):
        constant = {
            index: command
            for index, test in enumerate(tests)
            for command, command_unit in test.commands
            if command_unit == unit and not isinstance(command, np.ndarray)
        }
        if len(constant) >= _FEWEST_ALIKE:
            labelled, commands = [tests[index] for index in constant], np.array(list(constant.values()))
            yield from _standing_out(labelled, commands, quantity, unit)


def _standing_out(
    tests: Sequence[DamperTest], commands: Floats, quantity: str, unit: str
) -> Iterator[Remark]:
    # Commands that differ by less than a percent of the largest count as equal.
    step = max(0.01 * float(np.abs(commands).max()), 1e-9)
    groups: dict[int, list[int]] = defaultdict(list)
    for index, command in enumerate(commands):
        groups[round(float(command) / step)].append(index)
    alike = [np.array(group) for group in groups.values() if len(group) >= _FEWEST_ALIKE]
    if not alike:
        return
    force_there, velocity = _loops(tests)
    force = force_there - _slope(force_there, velocity, alike) * velocity
    levels = np.array([np.median(force[group]) for group in alike])
    beside = np.concatenate([force[group] - level for group, level in zip(alike, levels, strict=True)])
    spread = robust_deviation(beside)
    limit = max(_STANDS_OUT, _SIGNIFICANT * spread)
    at = np.array([np.median(commands[group]) for group in alike])
    rows = np.concatenate(alike)
    for index, difference in zip(rows, beside, strict=True):
        others = _of_others(index, alike, force_there, velocity)
        is_unlike = _beyond_others(index, alike, velocity) > _BEYOND
        if is_unlike or min(abs(difference), abs(force_there[index] - others)) <= limit:
            continue
        like = beside[
            (np.abs(velocity[rows] - velocity[index]) < _APART) & (commands[rows] != commands[index])
        ]
        # What a test as fast at another command does as well is of the damper, as friction that falls with the speed.
        if np.max(like * np.sign(difference), initial=0.0) > _OF_DAMPER * abs(difference):
            continue
        test = tests[index]
        ratio = float(np.expm1(difference))
        yield _MISLABELLED.remark(
            measured=Measured(ratio, "", standard_error=spread),
            label=test.label,
            share=100.0 * abs(ratio),
            more="more" if ratio > 0 else "less",
            command=commands[index],
            unit=unit,
            spread=100.0 * spread,
            belongs=_belongs(float(force[index]), levels, at, unit),
            quantity=quantity,
            other=_other_unit(float(difference)),
        )


def _other_unit(difference: float) -> str:
    """Units that would explain a difference of the logarithm of the force; empty where none would."""
    units = [unit for unit, factor in _FACTORS.items() if abs(abs(difference) - np.log(factor)) < _OF_FACTOR]
    return (
        f", and whether its force is in {list_names(units)} instead of newtons, or the others"
        if units
        else ""
    )


def _of_others(row: int, alike: Sequence[NDArray[np.intp]], force: Floats, velocity: Floats) -> float:
    """Log force of a test by the others at its command alone: a damper without current is more viscous than others."""
    others = next(rows[rows != row] for rows in alike if row in rows)
    slope = min(max(_slope(force, velocity, [others]), 0.0), 1.0)
    return float(np.median(force[others] + slope * (velocity[row] - velocity[others])))


def _beyond_others(row: int, alike: Sequence[NDArray[np.intp]], velocity: Floats) -> float:
    """How far the log velocity of a test lies beyond those of the others at its command; negative between them."""
    others = velocity[next(rows[rows != row] for rows in alike if row in rows)]
    return float(max(others.min() - velocity[row], velocity[row] - others.max()))


def _loops(tests: Sequence[DamperTest]) -> tuple[Floats, Floats]:
    """Logarithms of dissipative force and peak velocity of tests, shape (n_tests,)."""
    force, velocity = np.empty(len(tests)), np.empty(len(tests))
    for index, test in enumerate(tests):
        travelling = smooth_motion(test.displacement, test.dt).velocity
        static = static_force(test.displacement, test.force, travelling) or 0.0
        power = (test.force - static) @ travelling
        force[index] = max(power / np.abs(travelling).sum(), np.finfo(np.float64).tiny)
        velocity[index] = np.percentile(np.abs(travelling), 99.0)
    return np.log(force), np.log(velocity)


def _slope(force: Floats, velocity: Floats, alike: Sequence[NDArray[np.intp]]) -> float:
    """Median slope of log force over log velocity between pairs of tests at the same command (Theil-Sen estimator)."""
    slopes = [
        (force[first] - force[second]) / (velocity[first] - velocity[second])
        for group in alike
        for first, second in combinations(group, 2)
        if abs(velocity[first] - velocity[second]) > _APART
    ]
    return float(np.median(slopes)) if slopes else 0.0


def _belongs(force: float, levels: Floats, at: Floats, unit: str) -> str:
    """Command whose level matches the force, interpolated between the levels of the set."""
    order = np.argsort(at)
    levels, at = np.exp(levels[order]), at[order]
    wanted = float(np.exp(force))
    if levels.size < 2 or np.any(np.diff(levels) <= 0.0) or not levels[0] <= wanted <= levels[-1]:
        return ""
    return f", as at about {np.interp(wanted, levels, at):.2g} {unit}"


# A stroke of constant speed is straight, and two of one speed about one place, within these shares of a stroke, of a
# speed.
_STRAIGHT, _ONE_PLACE, _EQUAL = 0.02, 0.1, 0.1
_BOTH_WAYS: Final = RemarkKind(
    "strokes_both_ways",
    "strokes out and back at equal speeds ({0}): the static force is {value:+.4g} N, and {resists}",
    verbs=ONCE,
)


def strokes_both_ways(tests: Sequence[DamperTest]) -> Iterator[Remark]:
    """Note the static force and the friction of strokes of constant speed that each go one way, by both ways together.

    Their mean forces are offset + friction sign(v) + damping v, by least squares; with one speed what resists it.
    """
    for names, speeds, forces in _two_ways(tests):
        columns = np.stack([np.ones(speeds.size), np.sign(speeds), speeds], axis=1)
        slow, fast = np.abs(speeds).min(), np.abs(speeds).max()
        is_one = fast - slow < _EQUAL * fast
        columns = columns[:, :2] if is_one else columns
        values, *_ = np.linalg.lstsq(columns, forces, rcond=None)
        rms = float(np.sqrt(np.mean((forces - columns @ values) ** 2)))
        resists = f"{values[1]:.4g} N resist {1e3 * fast:.3g} mm/s"
        if not is_one:
            resists = f"what resists is {values[1]:.4g} N and {values[2]:.4g} N s/m times the speed, to {rms:.2g} N rms"
        yield _BOTH_WAYS.remark(
            list_names(names, _NAMED), measured=Measured(float(values[0]), "N"), resists=resists
        )


def _two_ways(tests: Sequence[DamperTest]) -> Iterator[tuple[list[str], Floats, Floats]]:
    """Names, mean velocities [m/s] and forces [N] of strokes of one way at each command, where some are in pairs."""
    groups = defaultdict[str, list[tuple[DamperTest, float, float]]](list)
    for test in tests:
        x, time = test.displacement, test.dt * np.arange(test.n_time)
        speed, start = np.polyfit(time, x, 1)
        is_straight = np.std(x - start - speed * time) < _STRAIGHT * np.ptp(x)
        if is_straight and ONE_WAY.code in {remark.code for remark in test.remarks}:
            groups[test.command_in_words].append((test, float(speed), float(x.mean())))
    for group in groups.values():
        found, speeds, places = zip(*group, strict=True)
        speed, place = np.array(speeds), np.array(places)
        stroke = max(float(np.ptp(test.displacement)) for test in found)
        meets = np.abs(speed[:, None] + speed) < _EQUAL * np.abs(speed)
        if meets.any() and np.ptp(place) < _ONE_PLACE * stroke:
            yield [test.name for test in found], speed, np.array([test.force.mean() for test in found])


# Tests that a sentence names; of more it names some and counts the others.
_NAMED = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedRemark:
    """A remark in one or several of `n_tests` tests, whose messages differ in their numbers at most.

    `message` is of the first of `tests`, and of all where `equal`; `lowest` and `highest` are measured sizes.
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

    @property
    def in_words(self) -> str:
        """One sentence: the severity, the one test, all, or their number and first names, message, range of sizes."""
        count = len(self.tests)
        where = f" in {count} of {self.n_tests} tests ({list_names(self.tests, _NAMED)})"
        if count < 2:
            where = "".join(f" in {test}" for test in self.tests)
        elif count == self.n_tests:
            where = f" in all {count} tests"
        span = ""
        if self.lowest is not None and self.highest is not None and self.lowest < self.highest:
            span = f"; over these tests {self.lowest:.3g} to {self.highest:.3g} {self.unit}".rstrip()
        numbers = "" if self.equal else f" [numbers of {self.tests[0]}{span}]"
        return f"{self.severity}{where}: {self.message}{numbers}"


@dataclass(frozen=True, slots=True, kw_only=True)
class GatheredRemarks:
    """Remarks of several tests: `shared` ones recur, warnings first; `own` are of a single test, for each test."""

    shared: tuple[SharedRemark, ...]
    own: tuple[tuple[Remark, ...], ...]


def gathered_remarks(tests: Sequence[DamperTest]) -> GatheredRemarks:
    """Separate the remarks that recur in several of `tests` from the remarks of one test."""
    places = defaultdict[tuple[str, tuple[str, ...]], list[tuple[DamperTest, Remark]]](list)
    # What strokes of one way leave open is told by both ways.
    both = {name for names, *_ in _two_ways(tests) for name in names}
    tests = [
        replace(test, remarks=tuple(remark for remark in test.remarks if remark.code != ONE_WAY.code))
        if test.name in both
        else test
        for test in tests
    ]
    for test in tests:
        for remark in test.remarks:
            places[remark.code, remark.words].append((test, remark))
    # A check may find the same in two channels of a test.
    named = {key: {id(test): test.name for test, _ in pairs} for key, pairs in places.items()}
    recurring = {key: [remark for _, remark in places[key]] for key, names in named.items() if len(names) > 1}
    shared = [
        _join_remarks(remarks, tuple(named[key].values()), len(tests)) for key, remarks in recurring.items()
    ]
    return GatheredRemarks(
        shared=tuple(sorted(shared, key=lambda remark: remark.severity != "warning")),
        own=tuple(
            tuple(remark for remark in test.remarks if (remark.code, remark.words) not in recurring)
            for test in tests
        ),
    )


def _join_remarks(remarks: Sequence[Remark], tests: tuple[str, ...], n_tests: int) -> SharedRemark:
    first = remarks[0]
    measured = [remark.measured for remark in remarks if remark.measured is not None]
    values = [measurement.value for measurement in measured]
    return SharedRemark(
        code=first.code,
        severity=first.severity,
        message=first.message,
        tests=tests,
        n_tests=n_tests,
        equal=all(remark.message == first.message for remark in remarks),
        lowest=min(values, default=None),
        highest=max(values, default=None),
        unit=measured[0].unit if measured else "",
    )


def remarks_for(verb: Verb, tests: Sequence[DamperTest]) -> tuple[SharedRemark, ...]:
    """Remarks of several tests that matter to a verb, each once, warnings first."""
    verb_tests = [
        replace(
            test, remarks=tuple(remark for remark in test.remarks if verb in REMARK_KINDS[remark.code].verbs)
        )
        for test in tests
    ]
    gathered = gathered_remarks(verb_tests)
    alone = [
        _join_remarks([remark], (test.name,), len(tests))
        for test, remarks in zip(verb_tests, gathered.own, strict=True)
        for remark in remarks
    ]
    # The message names the tests that it concerns.
    of_set = (remark for remark in remarks_of_set(tests) if verb in REMARK_KINDS[remark.code].verbs)
    together = [_join_remarks([remark], (), len(tests)) for remark in of_set]
    return tuple(
        sorted((*together, *gathered.shared, *alone), key=lambda remark: remark.severity != "warning")
    )


def remarks_of_set(tests: Sequence[DamperTest]) -> tuple[Remark, ...]:
    """Remarks that need several tests: wrong commands, repeats, copies, strokes of both ways."""
    found = find_mislabelled(tests), repeats_that_differ(tests), repeated_records(tests)
    return tuple(remark for each in (*found, strokes_both_ways(tests)) for remark in each)
