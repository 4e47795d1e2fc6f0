"""Repairs of a test, which are recorded as remarks, and its observation model.

An observation model is given in words of a setting: a moving average that was detected in the record, or given values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Final, Literal, get_args

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.remark import OF_FILES, ONCE, REMARK_KINDS, Measured, Remark, RemarkKind
from mrwork.base.values import freeze_samples
from mrwork.dampers.command import Command
from mrwork.errors import SettingError

# Kinds of remarks that a repair cures are declared there, too.
from mrwork.records import contradictions as contradictions
from mrwork.records.checks import rest_before_motion, samples_at_rest, static_force
from mrwork.records.command_column import command_of
from mrwork.records.corners import Corners
from mrwork.records.damper_test import DamperTest, fields_of_commands
from mrwork.records.motion import smooth_motion, spectrum
from mrwork.records.observation import (
    AS_IT_IS,
    EFFECTS,
    Observation,
    Observe,
    Observing,
)
from mrwork.records.pulses import pulses_of
from mrwork.records.window import cut, spans_with

RepairKind = Literal["rest", "pulses", "offset", "velocity"]
REPAIR_KINDS: Final[tuple[RepairKind, ...]] = get_args(RepairKind)

_REPAIRED: Final = {
    kind: RemarkKind(f"repaired_{kind}", "{message}", verbs=ONCE, repaired=True) for kind in REPAIR_KINDS
}
_NO_CAUSE: Final = {
    kind: RemarkKind(f"no_{kind}", f"no {kind} to repair: {{reason}}", verbs=OF_FILES)
    for kind in REPAIR_KINDS
}


@checked
def repair(
    test: DamperTest, kinds: Iterable[RepairKind], *, amounts: Mapping[RepairKind, float] | None = None
) -> tuple[DamperTest, tuple[Remark, ...]]:
    """Apply repairs to a test in the order of `REPAIR_KINDS`; return the repaired test and a log.

    Parameters
    ----------
    test
        Test to repair. It is not changed; the repaired test has it as its `original`.
    kinds
        `rest`: the rest before the motion is cut off. `pulses`: a command of pulses is replaced by its mean over their
        periods. `offset`: the static force is subtracted. `velocity`: the measured velocity is replaced by the
        derivative of the displacement.
    amounts
        Known offset [N] by kind, used instead of the estimate from the record.

    Returns
    -------
    test, log
        The log is also part of the remarks of the test; a repair that was not needed is recorded as a note.

    Examples
    --------
    >>> import mrwork as mr
    >>> test, log = repair(mr.synthetic_test("spencer1997"), ["offset"], amounts={"offset": 50.0})
    >>> log[0].message
    'a static force of +50 N was subtracted'
    """
    amount_of = dict(amounts or {})
    for kind, amount in amount_of.items():
        if kind not in _AMOUNTS:
            raise SettingError(
                f"repair {kind} was given {amount:g}; a number goes with {AMOUNTS_IN_WORDS} alone"
            )
    wanted = set(kinds) | set(amount_of)
    repaired, log = test, list[Remark]()
    for kind in REPAIR_KINDS:
        if kind not in wanted:
            continue
        done = _REPAIRS[kind](repaired, amount_of.get(kind))
        if isinstance(done, str):
            entry = _NO_CAUSE[kind].remark(reason=done)
        else:
            changed, measured, message = done
            entry = _REPAIRED[kind].remark(measured=measured, message=message)
            cured = {found.code for found in REMARK_KINDS.values() if found.cured_by == kind}
            remarks = tuple(remark for remark in changed.remarks if remark.code not in cured)
            repaired = replace(changed, remarks=remarks, original=test.original or test)
        repaired = replace(repaired, remarks=(*repaired.remarks, entry))
        log.append(entry)
    return repaired, tuple(log)


# The repaired test, the amount, and what was done; or why nothing was.
_Done = tuple[DamperTest, Measured, str] | str


def seconds_of_pulses(test: DamperTest) -> float:
    """The time [s] over which pulses of its command were averaged, 0 where they were not."""
    pulses = (entry for entry in test.remarks if entry.code == _REPAIRED["pulses"].code)
    return max((entry.measured.value for entry in pulses if entry.measured), default=0.0)


def _rest(test: DamperTest, _: float | None) -> _Done:
    if not any(rest_before_motion(test, smooth_motion(test.displacement, test.dt))):
        return "the motion starts within a quarter of a cycle"
    rest = samples_at_rest(test.displacement)
    seconds = rest * test.dt
    shorter = cut(test, start=float(test.time[rest]))
    return shorter, Measured(seconds, "s"), f"the first {seconds:.3g} s, at rest, were cut off"


def _pulses(test: DamperTest, _: float | None) -> _Done:
    found = [(command, pulses) for command in test.commands if (pulses := pulses_of(command, test.dt))]
    if not found:
        return "no command goes from zero to one level and back regularly, or within milliseconds"
    log, means = list[str](), list[Command]()
    for command, pulses in found:
        means.append(command_of(pulses.mean, command.unit, source=test.label)[0])
        replaced = f"the pulses of the {command.quantity} were replaced by their mean over {1e3 * pulses.window:.3g} ms"
        log.append(f"{replaced}, {means[-1].in_words}; {pulses.unknown}")
    window = Measured(found[0][1].window, "s")
    return replace(test, **fields_of_commands(means)), window, "; ".join(log)


def _offset(test: DamperTest, amount: float | None) -> _Done:
    if test.has_varying_command and amount is None:
        return "the mean force under a varying command is no static one; give one"
    motion = smooth_motion(test.displacement, test.dt)
    offset = static_force(test.displacement, test.force, motion.velocity) if amount is None else amount
    if offset is None:
        return "no speed is shown both out and back, from which a static force is told; give one"
    message = f"a static force of {offset:+.4g} N was subtracted"
    return replace(test, force=freeze_samples(test.force - offset)), Measured(offset, "N"), message


def _velocity(test: DamperTest, _: float | None) -> _Done:
    if test.velocity_source == "derived":
        return "it is the derivative of the displacement already"
    motion = smooth_motion(test.displacement, test.dt)
    corners = Corners.of(test.displacement, test.force, motion)
    derived = corners.velocity(motion.velocity, test.displacement, test.dt, "derived")
    changed = float(np.sqrt(np.mean((test.velocity - derived) ** 2) / np.mean(derived**2)))
    message = (
        f"the velocity was derived from the displacement anew; it changed by {100 * changed:.2g} % (rms)"
    )
    repaired = replace(
        test,
        velocity=freeze_samples(derived),
        velocity_source="derived",
        uncompared=spans_with(test.uncompared, corners.about),
        remarks=(*test.remarks, *corners.remarks(test.time, "derived")),
    )
    return repaired, Measured(changed, ""), message


_REPAIRS: Final[Mapping[RepairKind, Callable[[DamperTest, float | None], _Done]]] = {
    "rest": _rest, "pulses": _pulses, "offset": _offset, "velocity": _velocity,
}  # fmt: skip
_AMOUNTS: Final[Mapping[RepairKind, str]] = {"offset": "N"}
AMOUNTS_IN_WORDS: Final = ", ".join(f"{kind} [{unit}]" for kind, unit in _AMOUNTS.items())
"""What may be given an amount, with its unit, for help."""


@checked
def observed(test: DamperTest, observe: Observe) -> DamperTest:
    """The test with the observation model that the words ask for; a model that the test already has is kept.

    `detect` averages over the window that was found in the force of the whole record, see `detect_smoothing`; where
    none was found it has no effect.
    """
    if test.observation != AS_IT_IS:
        _check_fits(test, test.observation)
        return test
    observing, values = Observing.of(observe), dict[str, float]()
    # With a window in the displacement alone, the force was not averaged.
    if observing.detects and test.smoothing is not None and "force" in test.smoothing.channels:
        values["average_seconds"] = test.smoothing.window_seconds
    values |= observing.given(lambda: 1.0 / (test.frequency or spectrum(test.displacement, test.dt).dominant))
    if not values:
        return test
    observation = Observation(**values)
    _check_fits(test, observation)
    return replace(test, observation=observation)


def _check_fits(test: DamperTest, observation: Observation) -> None:
    """Refuse an average, lag or delay longer than the record, and a filter above what its samples hold."""
    duration, nyquist = (test.n_time - 1) * test.dt, 0.5 / test.dt
    for name, effect in EFFECTS.items():
        value = getattr(observation, effect.field)
        start = f"{test.label}: `{effect.field}` of its observation, --observe {name}, is {value:g}"
        if effect.of_time and abs(value) >= duration:
            raise SettingError(f"{start} s, the record lasts {duration:.4g} s; give less")
        if name == "lowpass" and value >= nyquist:
            raise SettingError(
                f"{start} Hz, and samples every {test.dt:.4g} s hold nothing above {nyquist:.4g} Hz; give less, or "
                "leave it out"
            )
