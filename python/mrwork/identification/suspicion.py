"""What makes a minimum suspicious: descriptions of the same tests, simpler or of single ones, that are better."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mrwork.records import DamperTest
from mrwork.records.command_signal import command_level

# A fit whose misfit is not below this share of that of a linear spring and dashpot has lost its non-linear part.
LINEAR_SHARE = 0.98


def linear_misfit(tests: Sequence[DamperTest], *, follows_command: bool = False) -> float:
    """Misfit of a linear spring and dashpot with an offset: root mean square NRMSE.

    All tests have one spring and dashpot, as they have one set of constant parameters; for a model that follows the
    command, those at each command have their own.
    """
    groups: dict[object, list[DamperTest]] = {}
    for test in tests:
        groups.setdefault(_command_of(test) if follows_command else None, []).append(test)
    squares = [square for group in groups.values() for square in _linear_squares(group)]
    return float(np.sqrt(np.mean(squares)))


def _command_of(test: DamperTest) -> object:
    """What tests at one command share; a test whose command varies is by itself."""
    if test.has_varying_command:
        return test.label
    return tuple((unit, command_level(float(np.mean(command)), unit)) for command, unit in test.commands)


def _linear_squares(tests: Sequence[DamperTest]) -> list[float]:
    """Squared NRMSE of each test, for one spring and dashpot that minimises their sum."""
    forces, motions = [], []
    for test in tests:
        force = test.force[test.counted]
        motion = np.stack([test.displacement, test.velocity, np.ones_like(test.force)], axis=1)[test.counted]
        weight = np.std(force) * np.sqrt(force.size)
        forces.append(force / weight)
        motions.append(motion / weight)
    scale = np.maximum(np.abs(np.concatenate(motions)).max(axis=0), np.finfo(np.float64).tiny)
    solution = np.linalg.lstsq(np.concatenate(motions) / scale, np.concatenate(forces), rcond=None)[0]
    residuals = [force - (motion / scale) @ solution for force, motion in zip(forces, motions, strict=True)]
    return [float(residual @ residual) for residual in residuals]


def linear_warning(
    nrmse: float, tests: Sequence[DamperTest], *, follows_command: bool = False
) -> tuple[str, ...]:
    """A warning where a fit with this misfit is no better than a linear spring and dashpot."""
    linear = linear_misfit(tests, follows_command=follows_command)
    if nrmse < LINEAR_SHARE * linear:
        return ()
    return (
        f"the fit, {100.0 * (1.0 - nrmse):.2f} %, is no better than that of a linear spring and dashpot, "
        f"{100.0 * (1.0 - linear):.2f} %: the minimum is false, or this model cannot describe the tests; "
        "try another seed or another model",
    )


# A test is far worse in a joint fit than alone above this multiple of the NRMSE of its own fit, which is at least
# `_RESOLVED`. On nine measured tests the best minimum of one set of laws reaches 3.1, a false one 3 to 14.
_FAR_WORSE = 5.0
_RESOLVED = 0.02
# Tests that a sentence names.
_SHOWN = 3


def far_worse(joint: NDArray[np.float64], alone: NDArray[np.float64]) -> NDArray[np.intp]:
    """Indices of the tests that a joint fit describes far worse than their own fits do.

    Both are NRMSE, shape (n_tests,). NaN stands for a test without a fit of its own.
    """
    return np.flatnonzero(joint > _FAR_WORSE * np.maximum(alone, _RESOLVED))


def far_worse_sentence(
    tests: Sequence[DamperTest],
    worse: NDArray[np.intp],
    joint: NDArray[np.float64],
    alone: NDArray[np.float64],
    *,
    found_again: bool,
) -> str:
    """A sentence on tests that are far worse jointly than alone."""
    shown = ", ".join(
        f"{tests[index].name} ({100.0 * (1.0 - joint[index]):.1f} % for {100.0 * (1.0 - alone[index]):.1f} %)"
        for index in worse[:_SHOWN]
    )
    further = f" and {len(worse) - _SHOWN} more" if len(worse) > _SHOWN else ""
    tests_shown = (
        f"{len(worse)} of {len(tests)} tests are described far worse together than alone: {shown}{further}"
    )
    if found_again:
        return (
            f"{tests_shown}; several starts end in this minimum, so these laws cannot follow the tests: let more "
            "parameters follow the command, or give laws of a higher degree"
        )
    return f"false minimum suspected: {tests_shown}; try another seed, or other laws"
