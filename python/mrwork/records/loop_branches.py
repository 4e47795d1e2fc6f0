"""The two branches of a force loop: their difference, the thickness of the loop, and their mean, its backbone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.base.arguments import checked
from mrwork.base.hints import Within
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import RecordError, SettingError
from mrwork.records.damper_test import DamperTest
from mrwork.records.motion import regular_cycles

Mask = NDArray[np.bool_]
Abscissa = Literal["velocity", "displacement"]

_OTHER: Final[Mapping[Abscissa, Abscissa]] = {"velocity": "displacement", "displacement": "velocity"}


@array_dataclass(repr=False)
class Branches(Summarised):
    """The two branches of the loops of a periodic test, made by `branches`.

    Over the velocity, `positive` is the force where the displacement is beyond its mean, which is while the velocity
    decreases, and `negative` where it is below; over the displacement they are the strokes of positive and of negative
    velocity. Both [N] have shape (n_cycles, n_points). The `abscissa` [m/s or m], shape (n_points,), is symmetric about
    its middle point: velocity 0, or the mean displacement.
    """

    over: Abscissa
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


@checked
def branches(
    test: DamperTest,
    *,
    over: Abscissa = "velocity",
    force: ArrayLike | None = None,
    points: Annotated[int, Within(least=3, most=100_001)] = 81,
) -> Branches:
    """Split the loops of a periodic test into their two branches.

    Each branch of each whole cycle is interpolated linearly between its samples, in the order of the abscissa, at equal
    steps over the range that every branch of every cycle covers. Average over the cycles, and take their standard
    deviation, along the first axis.

    White noise of standard deviation s on the force scatters the thickness of one cycle by s to 1.4 s, since the
    interpolation averages two samples or takes one, and the mean by half of it. A force that is late by T adds
    `2 T |a| F'(v)` to the thickness over the velocity, with the acceleration a and the slope F' of the mean, and a
    moving average flattens both: compare forces of models that were observed as the record was.

    Parameters
    ----------
    test
        A test of constant command with two cycles or more, of which those that are compared with a model count.
    over
        What the branches are functions of.
    force
        Force on the same motion, for instance of a model, shape (n_time,) [N]; that of the test if `None`.
    points
        Number of points of the abscissa; an even number is raised by one.

    Raises
    ------
    RecordError
        If the motion of the test is not periodic, or too coarse for a branch, or its command varies.
    SettingError
        If `force` does not have a value for each sample.

    Examples
    --------
    >>> import mrwork as mr
    >>> loop = mr.records.branches(mr.synthetic_test("rd1005_1a"))
    >>> loop.thickness.shape
    (3, 81)
    >>> float(loop.thickness.mean(axis=0).max()) > 100.0
    True
    """
    if test.has_varying_command:
        raise RecordError(
            f"the command of {test.label} varies, branches belong to one command; cut it to a part of constant command"
        )
    given = np.asarray(test.force if force is None else force, dtype=np.float64)
    if given.shape != test.force.shape:
        raise SettingError(
            f"`force` has shape {given.shape}, {test.label} has {test.force.shape}; give a value for each sample"
        )
    abscissa, other = getattr(test, over)[test.counted], getattr(test, _OTHER[over])[test.counted]
    # From upward or from downward crossings, of which a record may hold one more.
    cycles = max(regular_cycles(other), regular_cycles(-other), key=len) if other.size else ()
    if not cycles:
        raise RecordError(
            f"the motion of {test.label} is not periodic over two cycles or more; give a harmonic test of equal cycles"
        )
    whole = slice(cycles[0].start, cycles[-1].stop)
    beyond = other > np.mean(other[whole])
    # The mean of a velocity over whole samples of a period is not quite zero.
    middle = 0.0 if over == "velocity" else float(np.mean(abscissa[whole]))
    counted = given[test.counted]

    def branch(cycle: slice, chosen: Mask) -> tuple[Floats, Floats]:
        """Abscissae in order, and their forces."""
        along, force = abscissa[cycle][chosen[cycle]], counted[cycle][chosen[cycle]]
        order = np.argsort(along, kind="stable")
        return along[order], force[order]

    sides = [[branch(cycle, chosen) for cycle in cycles] for chosen in (beyond, ~beyond)]
    reach = min(min(middle - along[0], along[-1] - middle) for side in sides for along, _ in side)
    if reach <= 0.0:
        raise RecordError(
            f"{test.label} has too few samples a cycle, both branches must pass {middle:g}; give a finer record"
        )
    at = middle + reach * np.linspace(-1.0, 1.0, 2 * (points // 2) + 1)
    positive, negative = (np.array([np.interp(at, *each) for each in side]) for side in sides)
    return Branches(over=over, abscissa=at, positive=positive, negative=negative)


def _first_zero(distance: Floats, values: Floats) -> float:
    """Distance at which values that begin above zero first fall to it, NaN where they do not."""
    below = np.flatnonzero(values <= 0.0)
    if not below.size:
        return float("nan")
    after = int(below[0])
    share = values[after - 1] / (values[after - 1] - values[after])
    return float(distance[after - 1] + share * (distance[after] - distance[after - 1]))
