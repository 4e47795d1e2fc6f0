"""What tests and a model cannot tell apart: lag and delay, mass and stiffness, an offset and that of the model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from mrwork.base.remark import Remark, RemarkKind
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.records import DamperTest
from mrwork.records.checks import FORCE_OFFSET, half_range, may_be_one_way, static_force
from mrwork.records.observation import EFFECTS, Observing

# Shares of the power of the velocity between which the frequencies of a test lie; those below this ratio are one.
_MOST_POWER = (0.2, 0.8)
SAME_FREQUENCY = 1.3
_OFFSET, _GAIN = EFFECTS["offset"], EFFECTS["gain"]
_OFFSET_CURE = "subtract the offset by --repair offset, or estimate it for each test by --observe offset=each"
_OFFSET_LACKING = RemarkKind(
    "offset_not_described",
    "the force has a static offset in {0}, and {1}, so the model cannot describe it",
    f"{{unless}}{{cure}}, {_OFFSET_CURE}",
)


_SIZE_OPEN = RemarkKind(
    "size_of_force_open",
    "the gain of the force is estimated for each test, so no test tells the size of the force: parameters that are "
    "forces are known up to one common factor, and bounds decide it",
    "give the gain of a load cell that you trust by --observe gain=VALUE",
)


def open_size(observing: Observing) -> Iterator[Remark]:
    """Warn where the gain of every test is estimated, which leaves the size of the force of any model open."""
    if _GAIN in observing.of_each:
        yield _SIZE_OPEN.remark()


def refuse_indistinct(observing: Observing, tests: Sequence[DamperTest] = ()) -> None:
    """Refuse effects that are left to a fit and that no tests, or these, tell from each other or from the model."""
    free = {effect.name for effect in observing.free}
    if {"lag", "delay"} <= free | {effect.name for effect in observing.of_each}:
        raise SettingError(
            "--observe estimates a lag and a delay, which tests hardly tell apart; estimate one of them, and give the "
            "other"
        )
    if tests and "mass" in free and are_at_one_frequency(tests):
        raise SettingError(
            f"--observe mass=free: all tests are at about {frequency_ranges(tests).max():.3g} Hz, and at one "
            "frequency a mass cannot be told apart from a stiffness; give mass=VALUE, or add a test at another "
            "frequency"
        )


def frequency_ranges(tests: Sequence[DamperTest]) -> Floats:
    """The lowest and the highest frequency of each test [Hz], (n_tests, 2), by the power of its velocity."""
    ranges = []
    for test in tests:
        velocity = (test.velocity - test.velocity.mean()) * np.hanning(test.n_time)
        power = np.cumsum(np.abs(np.fft.rfft(velocity)) ** 2)
        ranges.append(np.searchsorted(power, np.array(_MOST_POWER) * power[-1]) / (test.n_time * test.dt))
    return np.array(ranges)


def are_at_one_frequency(tests: Sequence[DamperTest]) -> bool:
    """Whether tests cannot tell a mass from a stiffness, nor a lag from a damping."""
    ranges = frequency_ranges(tests)
    return bool(ranges.max() <= SAME_FREQUENCY * ranges.min())


def bounds_without_offsets(observing: Observing, spec: DamperSpec) -> dict[str, tuple[float, float]]:
    """Bounds that fix the model's own force offset at zero, where the offset is estimated for each test."""
    return dict.fromkeys(_shifts(spec), (0.0, 0.0)) if _OFFSET in observing.of_each else {}


def unlike_offsets(
    observing: Observing,
    spec: DamperSpec,
    bounds: Mapping[str, tuple[float, float]],
    tests: Sequence[DamperTest],
) -> Iterator[Remark]:
    """Warn of tests with a static offset of the force that the model cannot describe, or with unequal ones."""
    shifts = _shifts(spec)
    if _OFFSET in observing.of_each:
        return
    if any(bounds.get(name) != (0.0, 0.0) for name in shifts):
        if set(shifts) <= set(spec.without_laws.names):
            yield from _unequal_offsets(tests)
        return
    shifted = [test for test in tests if any(remark.code == FORCE_OFFSET.code for remark in test.remarks)]
    if not shifted:
        return
    fixed = f"{list_names(shifts)} {'is' if len(shifts) == 1 else 'are'} fixed at 0"
    lacks, cure = (fixed, f"leave {list_names(shifts)} free")
    if not shifts:
        lacks, cure = f"no parameter of {spec.name} adds a constant force", "add one to its equations"
    labels = list_names([test.label for test in shifted])
    yield _OFFSET_LACKING.remark(labels, lacks, cure=cure, unless=_unless_one_way(shifted))


# Share of the least half range of the force by which static offsets differ that one parameter cannot describe.
_UNEQUAL = 0.25
_OFFSETS_UNLIKE = RemarkKind(
    "offsets_unlike",
    "the static offset of the force is {least:+.3g} N in {0} and {most:+.3g} N in {1}, and the model has one for all",
    f"{{unless}}{_OFFSET_CURE}",
)


def _unequal_offsets(tests: Sequence[DamperTest]) -> Iterator[Remark]:
    # Under a varying command the mean force is no static one.
    told = [(test, static_force(test.displacement, test.force, test.velocity)) for test in tests]
    known = [(test, offset) for test, offset in told if offset is not None and not test.has_varying_command]
    held, offsets = [test for test, _ in known], [offset for _, offset in known]
    if not held or np.ptp(offsets) <= _UNEQUAL * min(half_range(test.force) for test in held):
        return
    least, most = int(np.argmin(offsets)), int(np.argmax(offsets))
    yield _OFFSETS_UNLIKE.remark(
        held[least].label,
        held[most].label,
        least=offsets[least],
        most=offsets[most],
        unless=_unless_one_way([held[least], held[most]]),
    )


def _unless_one_way(tests: Sequence[DamperTest]) -> str:
    """What limits the cure of an offset where it may be the damper's: a force that is larger one way is none."""
    is_open = any(may_be_one_way(test.displacement, test.force, test.velocity) for test in tests)
    return "where the damper itself is not stronger one way, " if is_open else ""


def _shifts(spec: DamperSpec) -> tuple[str, ...]:
    """Names of the parameters that shift the force of a model by a constant: f0, or x0 of its spring."""
    shifts = {
        parameter.name
        for parameter in spec.plain
        if parameter.scale == "offset" and parameter.unit in ("N", "m")
    }
    return tuple(parameter.name for parameter in spec.parameters if parameter.plain_name in shifts)
