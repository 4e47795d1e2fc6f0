"""Detectors of a stroke, force, pace or command that no damper test has, as of a unit that is off by a thousand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from mrwork.base.units import CommandUnit
from mrwork.records.damper_test import DamperTest, Finding, Measured
from mrwork.records.motion import SmoothMotion

# The longest dampers of bridges have about 2 m.
_LONGEST_STROKE: Final = 5.0
# Rods and mounts are stressed by some 20 MPa at full force, and then stretch by 1e-4 of their length to either side: by
# 0.1 mm for a damper of 1 kN with its fixture of half a metre. Lengths grow from a damper of 1 kN to one of 200 kN by
# about this power of the force.
_SHORTEST_STROKE: Final = 1e-4
_OF_FORCE: Final = 1e3
_GROWS: Final = 0.4
# The seal of the smallest cylinder takes some newtons; the largest magnetorheological dampers built have 400 to 500 kN.
_SMALLEST_FORCE: Final = 2.0
_LARGEST_FORCE: Final = 6e5
_NEWTONS: Final = ((1e6, "MN"), (1e3, "kN"), (1.0, "N"))
# Slow tests have some mm/s, and are sampled twenty times in a second or more often; recoil dampers reach some 15 m/s
# and 100 g, and mounts are tested up to some 300 Hz.
_SLOWEST: Final = 5e-4
_COARSE_STEP: Final = 0.05
_FASTEST: Final = 20.0
_LARGEST_ACCELERATION: Final = 1e4
_HIGHEST_FREQUENCY: Final = 500.0
# The coils of the largest dampers take some 10 A, and no driver of them is set by more than the voltage of the mains.
_LARGEST_COMMANDS: Final[Mapping[CommandUnit, float]] = {"A": 20.0, "V": 240.0}


def stroke_finding(test: DamperTest, _: SmoothMotion) -> tuple[Finding, ...]:
    """Warn of a stroke that is longer than that of any damper, or that its rod and mounts alone would give."""
    stroke, force = float(np.ptp(test.displacement)), float(np.abs(test.force).max())
    if stroke > _LONGEST_STROKE:
        message = f"the displacement spans {stroke:.3g} m, more than any damper"
        action = "check its channel and its unit"
    elif stroke < _SHORTEST_STROKE * (force / _OF_FORCE) ** _GROWS:
        message = (
            f"the displacement spans {1e6 * stroke:.3g} um, no more than rod and mounts of a damper of "
            f"{_in_newtons(force)} stretch"
        )
        action = "check its channel and its unit: are millimetres taken for micrometres?"
    else:
        return ()
    measured = Measured(value=stroke, unit="m")
    return (Finding.warning("displacement_unusual", message, action=action, measured=measured),)


def force_finding(test: DamperTest, _: SmoothMotion) -> tuple[Finding, ...]:
    """Warn of a force that is larger than that of any damper, or smaller than that of a seal."""
    force = float(np.abs(test.force).max())
    if force > _LARGEST_FORCE:
        bound, taken = f"more than the {_in_newtons(_LARGEST_FORCE)} of the largest dampers", "N taken for kN"
    elif force < _SMALLEST_FORCE:
        bound, taken = "less than the seal of a damper takes", "kN taken for N"
    else:
        return ()
    message = f"the force reaches {_in_newtons(force)}, {bound}"
    action = f"check its channel and its unit: are {taken}?"
    return (
        Finding.warning("force_unusual", message, action=action, measured=Measured(value=force, unit="N")),
    )


def pace_finding(test: DamperTest, motion: SmoothMotion) -> tuple[Finding, ...]:
    """Warn of a motion that is far slower, and sampled so, or far faster than a damper is tested."""
    speed = float(np.percentile(np.abs(motion.velocity), 99.0))
    acceleration = 2.0 * np.pi * motion.frequency * speed
    slow = speed < _SLOWEST and test.dt >= _COARSE_STEP
    fast = speed > _FASTEST or motion.frequency > _HIGHEST_FREQUENCY or acceleration > _LARGEST_ACCELERATION
    if not slow and not fast:
        return ()
    message = (
        f"the motion has {motion.frequency:.2g} Hz and {1e3 * speed:.2g} mm/s in steps of {test.dt:.3g} s, "
        f"{'slower' if slow else 'faster'} than a damper is tested"
    )
    taken = "ms taken for s" if slow else "s taken for ms"
    action = f"check the unit of the time (are {taken}?), and that of the displacement"
    measured = Measured(value=motion.frequency, unit="Hz")
    return (Finding.warning("time_unusual", message, action=action, measured=measured),)


def command_finding(test: DamperTest, _: SmoothMotion) -> tuple[Finding, ...]:
    """Warn of a command that is larger than any coil or driver takes."""
    return tuple(
        Finding.warning(
            "command_unusual",
            f"the command reaches {highest:.4g} {unit}, more than a damper takes",
            action=f"check its column and its unit: are m{unit} taken for {unit}?",
            measured=Measured(value=highest, unit=unit),
        )
        for command, unit in test.commands
        for highest in [float(np.max(command))]
        if highest > _LARGEST_COMMANDS.get(unit, np.inf)
    )


def _in_newtons(force: float) -> str:
    scale, unit = next(each for each in _NEWTONS if force >= each[0] or each[0] == 1.0)
    return f"{force / scale:.3g} {unit}"
