"""Operating ranges of tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrwork.arguments import Samples
from mrwork.errors import SettingError
from mrwork.records.damper_test import DamperTest
from mrwork.records.motion import whole_cycles
from mrwork.tested_range import Exceedance as Exceedance
from mrwork.tested_range import OperatingRange as OperatingRange
from mrwork.tested_range import Outside as Outside
from mrwork.tested_range import covering, least_stroke
from mrwork.units import COMMAND_SCALES, CommandUnit

# Share of the cycles that are longer, and that are shorter, than those of the frequency range.
_RARE = 0.1


def range_of_test(test: DamperTest, unit: CommandUnit | None, force: Samples | None = None) -> OperatingRange:
    """Ranges of a test with its command in `unit`; `force` replaces the measured one [N], shape (n_time,)."""
    load = test.force if force is None else force
    if load.size != test.n_time:
        raise SettingError(
            f"`force` has {load.size} samples; give one for each of the {test.n_time} of {test.label}"
        )
    command = test.command_in(unit)
    return OperatingRange(
        stroke=0.5 * float(np.ptp(test.displacement)),
        velocity=float(np.abs(test.velocity).max()),
        frequency=_frequencies(test),
        command=None if command is None else (float(np.min(command)), float(np.max(command))),
        command_unit=None if command is None else unit,
        force=float(np.abs(load).max()),
        power=max(0.0, float(np.mean(load * test.velocity))),
        least_stroke=least_stroke(test.displacement),
    )


def range_of_tests(tests: Sequence[DamperTest], unit: CommandUnit | None = None) -> OperatingRange:
    """Ranges of one or more tests together; without a `unit`, that in which most of the commands are known."""
    if not tests:
        raise SettingError("the range of no test was asked for; give at least one test")
    if unit is None:
        # Of several units with as many commands a current, then a voltage.
        units: Sequence[CommandUnit] = [own for test in tests for _, own in test.commands]
        known: list[CommandUnit] = [each for each in COMMAND_SCALES if each in units]
        unit = max(known, key=units.count) if known else None
    return covering([range_of_test(test, unit) for test in tests])


def _frequencies(test: DamperTest) -> tuple[float, float] | None:
    """Frequencies of the cycles [Hz], without the slowest and the fastest tenth; `None` without a whole cycle."""
    seconds = [test.dt * (cycle.stop - cycle.start) for cycle in whole_cycles(test.displacement)]
    if not seconds:
        return None
    lowest, highest = np.quantile(1.0 / np.array(seconds), [_RARE, 1.0 - _RARE])
    return float(lowest), float(highest)
