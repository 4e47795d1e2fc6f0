"""What speaks against the choice of a fit, in laws and models alike; it is asked before the best is taken."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.values import Floats
from mrwork.dampers.between_commands import hidden_extrema
from mrwork.dampers.command import command_level, levels_of_command
from mrwork.dampers.simulation import Loading, Outcome, simulate_forces
from mrwork.dampers.spec import LAW_LEAVES_RANGE, DamperSpec, DependenceLimit, law_limits
from mrwork.identification.result import BuildingCost
from mrwork.records import DamperTest
from mrwork.records.damper_test import loading_of, range_of_tests

# Up to this multiple of the tested velocities the force may fall by this share at most.
_FASTER = 2.0
_FALLS = 0.02
_TOO_STIFF = RemarkKind("too_stiff_for_building", "it takes {cost}", warns=True)
_FALLING = RemarkKind(
    "force_falls",
    "its force falls by {value:.2g} % from {peak:.3g} to {faster:.3g} mm/s in the motion of {0}",
    warns=True,
)


def objections_to(
    spec: DamperSpec, theta: Floats, tests: Sequence[DamperTest], cost: BuildingCost
) -> Iterator[Remark]:
    """Why the parameters, shape (n_params,), are not to be chosen while others are left.

    A positive parameter whose law leaves its range or vanishes within the tested commands, or has an extremum between
    two constant ones, unless it has a value at each of them, through which there is a law without; a force that falls
    when the fastest motion runs faster, since what made it rise has vanished; and a damper that no building can be
    simulated with. That an exponent is on its bound, as n = 1 of a Bouc-Wen loop, is none.
    """
    yield from (limit.remark(LAW_LEAVES_RANGE) for limit in dying_dependences(spec, theta, tests))
    levels = range_of_tests(tests, spec.command_unit).levels
    hidden = () if any(test.has_varying_command for test in tests) else hidden_extrema(spec, theta, levels)
    yield from (
        extremum.remark
        for extremum in hidden
        if extremum.parameter in _positive(spec)
        and spec.laws_by_name[extremum.parameter].n_coefficients < len(levels)
    )
    yield from _falling_force(spec, theta, tests)
    if not cost.is_possible:
        yield _TOO_STIFF.remark(cost=cost.in_words)


def dying_dependences(
    spec: DamperSpec, theta: Floats, tests: Sequence[DamperTest]
) -> tuple[DependenceLimit, ...]:
    """Laws of positive parameters that leave their range or vanish within the tested commands."""
    tested = range_of_tests(tests, spec.command_unit)
    limits = law_limits(spec, theta, tested.command) if tested.command is not None else ()
    return tuple(limit for limit in limits if limit.parameter in _positive(spec))


def _positive(spec: DamperSpec) -> set[str]:
    return {parameter.name for parameter in spec.plain if parameter.is_positive}


def fastest_at_commands(
    spec: DamperSpec, tests: Sequence[DamperTest]
) -> tuple[tuple[DamperTest, Loading], ...]:
    """The fastest motion at each command, with its test; a varying command counts at each of its levels."""
    unit, fastest = spec.command_unit or "A", dict[float, tuple[DamperTest, Loading]]()
    for test in sorted(tests, key=lambda test: float(np.abs(test.velocity).max())):
        loading = loading_of(test, spec)
        for level in [None] if loading.command is None else levels_of_command(loading.command):
            fastest[command_level(level or 0.0, unit)] = test, replace(loading, command=level)
    return tuple(fastest.values())


def _falling_force(spec: DamperSpec, theta: Floats, tests: Sequence[DamperTest]) -> Iterator[Remark]:
    worst, test_of_worst = -_FALLS, None
    for test, loading in fastest_at_commands(spec, tests):
        faster = replace(loading, dt=loading.dt / _FASTER, velocity=test.velocity * _FASTER)
        runs = [simulate_forces(spec, theta[None], each.history()) for each in (loading, faster)]
        if any(run.outcome[0] != Outcome.FINISHED for run in runs):
            continue
        tested, beyond = (float(np.std(run.force[0])) for run in runs)
        if tested > 0.0 and beyond / tested - 1.0 < worst:
            worst, test_of_worst = beyond / tested - 1.0, test
    if test_of_worst is not None:
        peak, fall = 1e3 * float(np.abs(test_of_worst.velocity).max()), Measured(-100.0 * worst, "%")
        yield _FALLING.remark(test_of_worst.name, measured=fall, peak=peak, faster=_FASTER * peak)
