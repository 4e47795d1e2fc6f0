"""Corners of a motion, as of ramps, triangles and stops: where velocity and force leap from one sample to the next."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.remark import ONCE, Measured, Remark, RemarkKind
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.command import sample_runs
from mrwork.records.damper_test import VelocitySource
from mrwork.records.motion import Differentiator, SmoothMotion, robust_deviation

# Samples to either side of a corner, from which its change of velocity is seen, and seen again twice as far.
_BESIDE: Final = 2
# Least share of either change in the other: 1 of a corner, 1/2 of a motion that bends throughout, or of a jump.
_OF_CORNER: Final = 0.75
# Least change, in the largest velocity and in its standard errors, and of the force, in its usual steps.
_LEAST_CHANGE: Final = 0.2
_CHANGE_ERRORS: Final = 8.0
_FORCE_LEAPS: Final = 6.0
# Samples to either side of a corner over which its velocity goes from one side to the other, and those beside them.
_TRANSITION: Final = 2
_LEFT_OUT: Final = _TRANSITION + 1
# Samples of the shortest side of a corner.
_SHORTEST_SIDE: Final = 16
_CORNERS: Final = RemarkKind(
    "velocity_leaps",
    "velocity and force leap {0} {at:.6g} s; the velocity is {1}, and {value:.0f} {2} not compared",
    verbs=ONCE,
)


@array_dataclass()
class Corners:
    """Corners of a motion at which the force leaps: a force that does not leap shows no velocity of a sample.

    A derivative across a corner is wrong by up to half the change of velocity; the waves beside it, or of a spline
    through a measured velocity that leaps, change the state of a model for the rest of the record.

    `places`: sample of each. `dividing`: of those whose sides are long enough that the velocity of each is derived by
    itself. Samples, shape (n_time,): `about` corners, which are not compared, and `reached` by windows across them.
    """

    places: tuple[int, ...]
    dividing: tuple[int, ...]
    about: NDArray[np.bool_]
    reached: NDArray[np.bool_]

    @classmethod
    def of(cls, displacement: Floats, force: Floats, motion: SmoothMotion) -> Corners:
        """Those of a displacement [m] and a force [N], each of shape (n_time,), with the smoothed motion."""
        dt, half = motion.differentiator.dt, motion.differentiator.windows // 2
        # Of five samples, the shortest window, a cubic removes half of the variance of the noise.
        error = np.sqrt(12.0) * robust_deviation(displacement - motion.displacement) / (_BESIDE * dt)

        def changes(by: int) -> Floats:
            ends = displacement[2 * by :] + displacement[: -2 * by]
            return np.abs(ends - 2.0 * displacement[by:-by]) / (by * dt)

        near, far = changes(_BESIDE)[_BESIDE:-_BESIDE], changes(2 * _BESIDE)
        least = max(_LEAST_CHANGE * float(np.abs(motion.velocity).max()), _CHANGE_ERRORS * error)
        of_corner = (near > _OF_CORNER * far) & (far > _OF_CORNER * near) & (near > least)
        steps = np.abs(np.diff(force))
        leap, (about, reached) = (
            _FORCE_LEAPS * robust_deviation(steps),
            np.zeros((2, force.size), dtype=np.bool_),
        )
        places, dividing = list[int](), list[int]()
        for first, last in sample_runs(np.pad(of_corner, 2 * _BESIDE)):
            reach, corner = int(half[first:last].max()), (first + last) // 2
            beside = slice(max(first - reach, 0), last + reach)
            if steps[beside].max() <= leap:
                continue
            places.append(corner)
            reached[beside] = True
            before = dividing[-1] if dividing else 0
            if min(corner - before, force.size - 1 - corner) >= _SHORTEST_SIDE:
                dividing.append(corner)
                beside = slice(corner - _LEFT_OUT, corner + _LEFT_OUT + 1)
            about[beside] = True
        return cls(places=tuple(places), dividing=tuple(dividing), about=about, reached=reached)

    def leaping(self, velocity: Floats) -> Corners:
        """Those that divide, at which a measured velocity, shape (n_time,), leaps within two samples, too."""
        places, about = list[int](), np.zeros_like(self.about)
        for corner in self.dividing:
            near, far = (abs(velocity[corner + by] - velocity[corner - by]) for by in (1, _LEFT_OUT))
            if min(near, far) > _OF_CORNER * max(near, far):
                places.append(corner)
                about[corner - _LEFT_OUT : corner + _LEFT_OUT + 1] = True
        return Corners(places=tuple(places), dividing=tuple(places), about=about, reached=self.reached)

    def remarks(self, time: Floats, source: VelocitySource) -> Iterator[Remark]:
        """What was found, if anything, and what is done to the velocity; `time` [s], shape (n_time,)."""
        if not self.places:
            return
        one = len(self.places) == 1
        yield _CORNERS.remark(
            "at" if one else f"{len(self.places)} times, first at",
            "derived on either side" if source == "derived" else "taken across in a smooth step",
            "samples about it are" if one else "samples are",
            measured=Measured(int(np.count_nonzero(self.about)), ""),
            at=time[self.places[0]],
        )

    def velocity(self, velocity: Floats, displacement: Floats, dt: float, source: VelocitySource) -> Floats:
        """A velocity with a smooth step across each corner that divides, derived anew on either side if it is derived.

        A step is about the instant at which the motions of both sides meet, so that the travel is theirs.
        """
        if not self.dividing:
            return velocity
        moved = displacement
        if source == "derived":
            moved, velocity = np.empty((2, displacement.size))
            for before, after in pairwise([-1, *self.dividing, displacement.size]):
                side = slice(before + 1, after)
                differentiator = Differentiator.of(displacement[side], dt)
                moved[side] = differentiator.smooth(displacement[side])
                velocity[side] = differentiator.derivative(displacement[side])
        result = velocity.copy()
        for corner in self.dividing:
            before, after = velocity[corner - 1], velocity[corner + 1]
            travel = moved[corner + 1] - moved[corner - 1]
            meeting = np.clip((travel / dt - before - after) / ((before - after) or np.inf), -1.0, 1.0)
            near = np.arange(corner - _LEFT_OUT, corner + _LEFT_OUT + 1)
            step = np.clip((near - corner - meeting) / _TRANSITION, -1.0, 1.0)
            share = 0.5 + step * (15.0 - 10.0 * step**2 + 3.0 * step**4) / 16.0
            earlier = np.where(near < corner, velocity[near], before)
            later = np.where(near > corner, velocity[near], after)
            result[near] = earlier + share * (later - earlier)
        return result
