"""How often a printed damper halves its sub-steps by its speed, and up to which speed it was checked."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, exp, log, pi

import numpy as np

from mrwork import _rust
from mrwork.base.values import Floats
from mrwork.dampers.spec import DamperSpec
from mrwork.dampers.tested_range import OperatingRange

# Largest error that is believed, as a share of the largest force; other motions than the check's have twice as much.
_ERROR = 0.0025
# Speeds of the check as multiples of the tested one.
_MULTIPLES = (1.0, 1.5, 2.2, 3.3, 5.0, 7.0, 10.0)
# A sub-step is halved once more for each of these factors of the speed, of which the first that is right is taken: 4
# where its order of accuracy is reached, 2 where the product of speed and step decides, less where a loop is stiffer.
_FACTORS = (4.0, 2.8, 2.0, 1.6)
# Halvings at most, a sub-step for each 64th, and of the sub-steps of all speeds.
_MOST_HALVINGS, _FINER_THROUGHOUT = 6, 3
# The error is against sub-steps finer by this factor, whose own is a sixteenth of it or less.
_FINER = 4
# A motion by so much faster than the tests is within them, as `OperatingRange.exceeded_by` has it.
_TOLERANCE = 0.05
# Samples of each motion of the check, its cycles, and the samples that a command stays.
_SAMPLES, _CYCLES, _HELD = 240, 3.0, 40
_LEVELS = (1.0, 0.0, 0.6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Halving:
    """Largest speeds [m/s] of sub-steps that are not halved, halved once and so on; the last is the largest believed.

    A speed is that of a sub-step and the change of velocity in a sample, so that a motion that turns counts as faster.
    `substeps` are those of a sample that is not halved. `errors` are the largest of each speed that was checked, as
    shares of the largest force, and `fading` is the share of a speed that counts in the next sub-step.
    """

    substeps: int
    speeds: tuple[float, ...]
    fading: float
    errors: tuple[float, ...]

    @property
    def most_substeps(self) -> int:
        """Most sub-steps in a sample."""
        return self.substeps << max(len(self.speeds) - 1, 0)

    @property
    def largest_error(self) -> float:
        """Over all that is believed."""
        return max(self.errors)


def halving_of(
    spec: DamperSpec, theta: Floats, tested: OperatingRange, *, sample_time: float, substeps: int
) -> Halving:
    """Halve sub-steps where a sine, a triangle or noise at a multiple of the tested speed wants it."""
    # A motion is as fast as it was until one at the tested speed and stroke would be at rest.
    fading = exp(-sample_time / substeps * tested.velocity / tested.stroke)

    def halving(count: int, speeds: tuple[float, ...] = ()) -> Halving:
        return Halving(substeps=count, speeds=speeds, fading=fading, errors=())

    def error(motion: Floats, tried: Halving) -> float:
        with np.errstate(all="ignore"):
            exact = straight_forces(spec, theta, motion, sample_time, halving(_FINER * tried.most_substeps))
            off = np.abs(straight_forces(spec, theta, motion, sample_time, tried) - exact).max()
            share = off / np.abs(exact).max()
        return float(share) if np.isfinite(share) else np.inf

    within = (1.0 + _TOLERANCE) * tested.velocity

    def up_to(multiple: float, factor: float) -> tuple[float, ...]:
        """Speeds for motions of a multiple, whose velocity may change by twice of it in a sample."""
        more = min(ceil(log(3.0 * multiple) / log(factor)), _MOST_HALVINGS)
        return *(within * factor**number for number in range(more)), multiple * tested.velocity

    def believed(count: int, first: float) -> Halving:
        """The fewest halvings of so many sub-steps that are right, up to the largest multiple at which they are."""
        best, errors, factors = halving(count, (tested.velocity,)), [first], [*_FACTORS]
        for multiple in _MULTIPLES:
            motion = _motion(tested, multiple, sample_time)
            while factors:
                tried = halving(count, up_to(multiple, factors[0]))
                if (found := error(motion, tried)) <= _ERROR:
                    break
                factors.pop(0)
            else:
                break
            best, errors = tried, [*errors, found]
        return replace(best, errors=tuple(errors))

    smooth = _motion(tested, 1.0, sample_time)[:, : 2 * _SAMPLES]
    found: list[Halving] = []
    for count in (substeps << more for more in range(_FINER_THROUGHOUT + 1)):
        first = error(smooth, halving(count))
        if first <= _ERROR or not found:
            found.append(believed(count, first))
            if first <= _ERROR and found[-1].speeds[-1] >= _MULTIPLES[-1] * tested.velocity:
                return found[-1]
    return max(found, key=lambda each: (each.speeds[-1], -each.errors[0]))


def straight_forces(spec: DamperSpec, theta: Floats, columns: Floats, dt: float, halving: Halving) -> Floats:
    """Force [N] at samples of displacement, velocity and command, shape (3, n_time), with straight lines between."""
    displacement, velocity, command = np.ascontiguousarray(columns)
    force = _rust.straight_forces(
        spec.core_name,
        theta,
        displacement,
        velocity,
        command,
        dt,
        halving.substeps,
        [*map(str, spec.laws)],
        spec.n_rates,
        [*halving.speeds],
        halving.fading,
    )
    return np.asarray(force)


def _motion(tested: OperatingRange, multiple: float, dt: float) -> Floats:
    """Displacement, velocity and command, shape (3, n_time): a sine, a triangle, and noise of a speed."""
    speed = multiple * tested.velocity
    hertz = max(tested.velocity / (2.0 * pi * tested.stroke), _CYCLES / (_SAMPLES * dt))
    phase = 2.0 * pi * hertz * dt * np.arange(_SAMPLES)
    noise = np.random.default_rng(0).uniform(-1.0, 1.0, _SAMPLES)
    velocity = speed * np.concatenate([np.cos(phase), np.sign(np.sin(phase + 0.5)), noise])
    displacement = dt * np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]))])
    lowest, highest = tested.command or (0.0, 0.0)
    levels = np.repeat(np.resize(_LEVELS, ceil(velocity.size / _HELD)), _HELD)[: velocity.size]
    return np.stack([displacement, velocity, lowest + (highest - lowest) * levels])
