"""Simpler descriptions of tests, and fits to single tests, which make a minimum suspicious where they are better."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mrwork.base.numbers import significant
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.identification.equivalent import Form
from mrwork.identification.fit import STRUCTURE
from mrwork.records import DamperTest
from mrwork.records.checks import TEMPERATURE
from mrwork.records.damper_test import outside_spans, set_points

# A fit whose misfit is not below this share of the misfit of a linear spring and dashpot is linear itself.
LINEAR_SHARE = 0.98
_LINEAR = RemarkKind(
    "damper_linear",
    "{damper} describe the tests to within their noise, {linear:.2f} % for {value:.2f} % of the "
    "fit: as far as the tests show, the damper is linear, and the parameters of its hysteresis mean nothing",
    warns=True,
)
# A force of which a linear spring and dashpot leave this share, as noise, does not follow the motion.
_ALL_NOISE = 0.95
_FORCE_IS_NOISE = RemarkKind(
    "force_is_noise",
    "the force is noise of {noise:.3g} N, in which nothing follows the motion: the fit has {value:.2f} % of it",
    "check the load cell and its channel, and that force and displacement are of one test",
)
# Least ratio of a slow speed of the tests to a fast one that are one speed, of percentiles of those above a share.
_ONE = 0.8
_SLOW_AND_FAST = (10.0, 90.0)
_MOVES = 0.1
_ONE_SPEED = RemarkKind(
    "one_speed",
    "{damper} describe the tests to within their noise, and so would dry friction in place of the dashpot, or a loop: "
    "the tests move at {value:.3g} mm/s alone, which tells none of these from the others",
    "test at other speeds",
)
_NO_BETTER = RemarkKind(
    "no_better_than_linear",
    "the fit, {value:.2f} %, is no better than that of a linear spring and dashpot, {linear:.2f} %: this model cannot "
    "describe the tests, or the minimum is false",
    "try another model (--model all)",
)


class _LinearFit(NamedTuple):
    """Stiffness [N/m], damping [N s/m] and offset [N], (3,), their standard errors, and the squared NRMSE of tests."""

    values: Floats
    standard_errors: Floats
    squares: list[float]

    @property
    def in_words(self) -> str:
        """Spring and dashpot, with their standard errors."""
        stiffness, damping, _ = (
            Measured(value, "", error).in_words()
            for value, error in zip(self.values.tolist(), self.standard_errors.tolist(), strict=True)
        )
        return f"a linear spring of {stiffness} N/m and dashpot of {damping} N s/m"


def linear_misfit(tests: Sequence[DamperTest], *, follows_command: bool = False) -> float:
    """Root mean square NRMSE of a linear spring and dashpot with an offset, one for all tests.

    For a model that follows the command, the tests at each command have their own.
    """
    return _misfit_of(_linear_fits(tests, follows_command=follows_command))


def _linear_fits(tests: Sequence[DamperTest], *, follows_command: bool) -> list[_LinearFit]:
    groups: dict[object, list[DamperTest]] = {}
    for test in tests:
        groups.setdefault((set_points(test) or test.label) if follows_command else None, []).append(test)
    return [_linear_fit(group) for group in groups.values()]


def _misfit_of(fits: Sequence[_LinearFit]) -> float:
    return float(np.sqrt(np.mean([square for fit in fits for square in fit.squares])))


def linear_start(form: Form, tests: Sequence[DamperTest]) -> Floats:
    """Parameters of the form, (n_params,), with which it is about a linear spring and dashpot, fitted to the tests.

    Yield forces are at their lower bounds, and what has no part in such a damper at its nominal value.
    """
    stiffness, damping, offset = _linear_fit(tests).values
    left = {"N/m": stiffness, "N s/m": damping, "N": offset, "m": -offset / (stiffness or 1.0)}
    theta = form.spec.nominal.copy()
    for index, parameter in enumerate(form.spec.parameters):
        if parameter.scale == "log" and parameter.unit == "N":
            theta[index] = form.box.lower[index]
        elif parameter.unit in left and (parameter.scale == "offset" or parameter.unit in ("N/m", "N s/m")):
            # Of several springs, dashpots or offsets the first has all.
            theta[index] = left.pop(parameter.unit)
    return np.asarray(form.box.inside(theta))


def _linear_fit(tests: Sequence[DamperTest]) -> _LinearFit:
    """One spring, dashpot and offset with the least sum of squared NRMSE of the tests; errors are of white noise."""
    forces, motions = [], []
    for test in tests:
        force = test.force[test.counted]
        motion = np.stack([test.displacement, test.velocity, np.ones_like(test.force)], axis=1)[test.counted]
        weight = np.std(force) * np.sqrt(force.size)
        forces.append(force / weight)
        motions.append(motion / weight)
    scale = np.maximum(np.abs(np.concatenate(motions)).max(axis=0), np.finfo(np.float64).tiny)
    columns = np.concatenate(motions) / scale
    solution = np.linalg.lstsq(columns, np.concatenate(forces), rcond=None)[0]
    residuals = [force - (motion / scale) @ solution for force, motion in zip(forces, motions, strict=True)]
    squares = [float(residual @ residual) for residual in residuals]
    variances = (
        np.diag(np.linalg.pinv(columns.T @ columns)) * sum(squares) / max(len(columns) - scale.size, 1)
    )
    # Of one speed, dashpot and offset are one column, and a variance may round to below zero.
    return _LinearFit(solution / scale, np.sqrt(variances.clip(min=0.0)) / scale, squares)


# Degrees between tests; a fluid loses a few tenths of a per cent of its force in each.
_WARMER = 10.0
_TEMPERATURES = RemarkKind(
    "temperatures_differ",
    "the tests were made at {lowest} to {highest} degrees, and no model has a temperature: the fit describes what it "
    "changes by parameters of motion and command",
    "fit tests of like temperature, or test each motion cold and warm",
)


def unlike_temperatures(tests: Sequence[DamperTest]) -> Iterator[Remark]:
    """Warn of tests whose recorded temperatures differ, which a fit takes for an effect of motion and command."""
    degrees = [
        remark.measured.value
        for test in tests
        for remark in test.remarks
        if remark.code == TEMPERATURE.code and remark.measured is not None
    ]
    if degrees and (lowest := min(degrees)) + _WARMER <= (highest := max(degrees)):
        yield _TEMPERATURES.remark(lowest=significant(lowest, 3), highest=significant(highest, 3))


def no_better_than_linear(
    nrmse: float, tests: Sequence[DamperTest], *, follows_command: bool = False
) -> Iterator[Remark]:
    """Warn that a fit with this misfit is no better than a linear spring and dashpot."""
    fits = _linear_fits(tests, follows_command=follows_command)
    linear = _misfit_of(fits)
    if nrmse < LINEAR_SHARE * linear:
        return
    deviation = float(np.sqrt(np.mean([np.var(test.force[test.counted]) for test in tests])))
    noise, kind = force_noise(tests), _NO_BETTER
    measured = Measured(100.0 * (1.0 - nrmse), "%")
    if linear * deviation <= STRUCTURE * noise:
        speeds = np.concatenate([np.abs(test.velocity[test.counted]) for test in tests])
        slow, fast = np.percentile(speeds[speeds >= _MOVES * speeds.max()], _SLOW_AND_FAST)
        kind = _LINEAR if linear < _ALL_NOISE else _FORCE_IS_NOISE
        if kind is _LINEAR and slow > _ONE * fast:
            kind, measured = _ONE_SPEED, Measured(1e3 * float(fast), "mm/s")
    damper = fits[0].in_words if len(fits) == 1 else "a linear spring and dashpot, their own at each command,"
    yield kind.remark(
        measured=measured,
        linear=100.0 * (1.0 - linear),
        damper=damper,
        noise=noise,
    )


_ORDER = 3


def force_noise(tests: Sequence[DamperTest]) -> float:
    """Standard deviation of the noise of the forces [N], from third differences.

    Those of white noise have twenty times its variance, and those of a force between its corners none; neither have
    those of a clipped one, which are left out with all samples that are not compared.
    """
    rough = np.concatenate([_differences(test) for test in tests])
    return float(np.median(np.abs(rough))) / NormalDist().inv_cdf(0.75) / float(np.sqrt(20.0))


def _differences(test: DamperTest) -> Floats:
    """The third differences of the force over compared samples, or of these alone where no four are in a row."""
    outside = outside_spans(test)
    counted = outside[:-3] & outside[1:-2] & outside[2:-1] & outside[3:]
    if counted.any():
        return np.diff(test.force, _ORDER)[counted]
    return np.diff(test.force[outside] if np.count_nonzero(outside) > _ORDER else test.force, _ORDER)


# A test is far worse in a joint fit than alone above this multiple of the NRMSE of its own fit, which is at least
# `_RESOLVED`. On nine measured tests the best minimum of one set of laws reaches 3.1, a false one 3 to 14.
_FAR_WORSE = 5.0
_RESOLVED = 0.02
# Tests that a remark names.
_TESTS_NAMED = 3
_WORSE = "{worse} of {tests} tests are described far worse together than alone: {0}"
_FALSE_MINIMUM = RemarkKind(
    "false_minimum",
    f"false minimum suspected: {_WORSE}",
    "try other laws (--law auto), or other models (--model A,B)",
)
_WORSE_TOGETHER = RemarkKind(
    "worse_together",
    f"{_WORSE}; no start found a better minimum",
    "check command, unit, zero and temperature of these tests, let more parameters follow the command by laws of a "
    "higher degree (--law auto tries both), or compare other models (--model A,B)",
)


def far_worse(joint: Floats, alone: Floats) -> NDArray[np.intp]:
    """Indices of the tests whose `joint` NRMSE, shape (n_tests,), is far above their own, which may be NaN."""
    return np.flatnonzero(joint > _FAR_WORSE * np.maximum(alone, _RESOLVED))


def worse_together(
    tests: Sequence[DamperTest], worse: NDArray[np.intp], joint: Floats, alone: Floats, *, suspected: bool
) -> Remark:
    """The warning of tests whose NRMSE in the joint fit, where a minimum may be false, is far above that alone."""
    both = [
        f"{tests[index].name} ({100.0 * (1.0 - joint[index]):.1f} % for {100.0 * (1.0 - alone[index]):.1f} %)"
        for index in worse
    ]
    kind = _FALSE_MINIMUM if suspected else _WORSE_TOGETHER
    return kind.remark(list_names(both, _TESTS_NAMED), worse=len(worse), tests=len(tests))
