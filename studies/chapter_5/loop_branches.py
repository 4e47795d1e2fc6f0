"""The two branches of a force loop: their difference, the thickness of the loop, and their mean, its backbone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.records import DamperTest, regular_cycles
from studies.former.arrays import Floats

Abscissa = Literal["velocity", "displacement"]

_POINTS = 81


@dataclass(frozen=True, slots=True, kw_only=True)
class Branches:
    """The two branches of the loops of a periodic test.

    Over the velocity, `positive` is the force where the displacement is beyond its mean, which is while the velocity
    decreases, and `negative` where it is below; over the displacement they are the strokes of positive and of negative
    velocity. Both [N] have shape (n_cycles, n_points). The `abscissa` [m/s or m], shape (n_points,), is symmetric about
    its middle point: velocity 0, or the mean displacement.
    """

    abscissa: Floats
    positive: Floats
    negative: Floats

    @property
    def thickness(self) -> Floats:
        """Force of the positive branch less that of the negative one [N], shape (n_cycles, n_points)."""
        return self.positive - self.negative

    @property
    def mean(self) -> Floats:
        """Mean of the two branches [N], shape (n_cycles, n_points)."""
        return 0.5 * (self.positive + self.negative)

    @property
    def width(self) -> float:
        """Full width [m/s or m] at half of the thickness in the middle point, NaN where it does not fall to that.

        Of the mean of the cycles, between the places on either side where it first falls to the half.
        """
        thickness = self.thickness.mean(axis=0)
        middle = thickness.size // 2
        if thickness[middle] == 0.0:
            return float("nan")
        above = thickness / thickness[middle] - 0.5
        # The abscissa is symmetric, so that distances to the right are those to the left.
        distance = self.abscissa[middle:] - self.abscissa[middle]
        return _first_zero(distance, above[middle:]) + _first_zero(distance, above[middle::-1])


def branches(test: DamperTest, *, over: Abscissa = "velocity", force: Floats | None = None) -> Branches:
    """Split the loops of a periodic test, or of another force on its motion, into their two branches.

    Each branch of each whole cycle is interpolated linearly between its samples, in the order of the abscissa, at equal
    steps over the range that every branch of every cycle covers.

    White noise of standard deviation s on the force scatters the thickness of one cycle by s to 1.4 s, since the
    interpolation averages two samples or takes one, and the mean by half of it. A force that is late by T adds
    `2 T |a| F'(v)` to the thickness over the velocity, with the acceleration a and the slope F' of the mean, and a
    moving average flattens both: compare forces of models that were observed as the record was.
    """
    counted = (test.force if force is None else force)[test.counted]
    displacement, velocity = test.displacement[test.counted], test.velocity[test.counted]
    abscissa, other = (velocity, displacement) if over == "velocity" else (displacement, velocity)
    # From upward or from downward crossings, of which a record may hold one more.
    cycles = max(regular_cycles(other), regular_cycles(-other), key=len) if other.size else ()
    if not cycles:
        raise RecordError(f"the motion of {test.label} is not periodic over two cycles or more")
    whole = slice(cycles[0].start, cycles[-1].stop)
    beyond = other > np.mean(other[whole])
    # The mean of a velocity over whole samples of a period is not quite zero.
    middle = 0.0 if over == "velocity" else float(np.mean(abscissa[whole]))

    def branch(cycle: slice, chosen: NDArray[np.bool_]) -> tuple[Floats, Floats]:
        """Abscissae in order, and their forces."""
        along, force = abscissa[cycle][chosen[cycle]], counted[cycle][chosen[cycle]]
        order = np.argsort(along, kind="stable")
        return along[order], force[order]

    sides = [[branch(cycle, chosen) for cycle in cycles] for chosen in (beyond, ~beyond)]
    reach = min(min(middle - along[0], along[-1] - middle) for side in sides for along, _ in side)
    at = middle + reach * np.linspace(-1.0, 1.0, _POINTS)
    positive, negative = (np.array([np.interp(at, *ordered) for ordered in side]) for side in sides)
    return Branches(abscissa=at, positive=positive, negative=negative)


def _first_zero(distance: Floats, values: Floats) -> float:
    """Distance at which values that begin above zero first fall to it, NaN where they do not."""
    below = np.flatnonzero(values <= 0.0)
    if not below.size:
        return float("nan")
    after = int(below[0])
    share = values[after - 1] / (values[after - 1] - values[after])
    return float(distance[after - 1] + share * (distance[after] - distance[after - 1]))
