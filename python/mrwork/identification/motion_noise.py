"""Errors of the parameters that the noise of the motion makes, which residuals of the force do not show."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import erf, sqrt

import numpy as np
from numpy.typing import NDArray

from mrwork.identification.equivalent import Form
from mrwork.identification.objective import Objective, linearised
from mrwork.identification.progress import Tally, on_every_test
from mrwork.identification.result import remark_of
from mrwork.records import DamperTest
from mrwork.records.damper_test import frozen
from mrwork.records.motion import Smoother, motion_of

Array = NDArray[np.float64]

# Number of motions with more noise that are simulated at most, and in a round.
_DRAWS = 24
_ROUND = 4
# Expected share of the 95 % intervals that hold the parameters, below which the noise of the motion dominates: 90 %,
# and one for the error of the draws.
_HELD = 0.91
_QUANTILE = 1.96
# Standard errors of the mean square of the draws so far by which it may be too small, when no more are drawn.
_SURELY = 2.0


def motion_noise_warning(
    objective: Objective, form: Form, theta: Array, standard_errors: Array, names: Sequence[str]
) -> tuple[str, ...]:
    """A sentence where hardly 90 % of the 95 % intervals are expected to hold, for the noise of the motion.

    A model is driven by the recorded motion, whose noise it integrates: its force is wrong at reversals, where the
    hysteresis depends on it, by errors that the few samples there hardly show. The noise of displacement and velocity,
    estimated from the records, is added once more, and the change of the force is projected on the parameters,

        change of theta = (J'J)^-1 J' (change of the force),

    as its own errors are. Its mean square over draws has the bias and the scatter.

    Parameters
    ----------
    objective
        Sum of squares, in the parameters of the form.
    theta, standard_errors
        The minimum in the parameters of the form, and errors of those of the requested model, shape (n_params,).
    names
        Names of the parameters of the requested model.
    """
    errors = standard_errors
    known = np.isfinite(errors) & (errors > 0.0)
    if not known.any():
        return ()
    changes = np.empty((0, theta.size))
    for changes in _changes_by_noise(objective, form, theta):
        shares = np.sqrt(np.mean(changes**2, axis=0))[known] / errors[known]
        # A mean square of n draws has a relative standard error of sqrt(2/n), a root of it half of that.
        if _held(shares * (1.0 + _SURELY / sqrt(2.0 * len(changes)))) >= _HELD:
            return ()
    if not len(changes) or _held(shares) >= _HELD:
        return ()
    worst = int(np.argmax(shares))
    measured = any(test.velocity_source == "measured" for test in objective.tests)
    remedy = "derive the velocity from the displacement by --repair velocity, or " if measured else ""
    return (
        f"noise of the motion dominates: it moves {np.array(names)[known][worst]} by about {shares[worst]:.2g} times "
        f"the error that the residuals of the force give it, so that 95 % intervals hold about "
        f"{100 * _held(shares):.0f} % of the parameters; {remedy}measure the motion with less noise",
    )


def _held(shares: Array) -> float:
    """Expected share of the 95 % intervals that hold, where noise moves parameters by these shares of their errors."""
    return float(np.mean([erf(_QUANTILE / sqrt(2.0 * (1.0 + each**2))) for each in shares]))


def _changes_by_noise(objective: Objective, form: Form, theta: Array) -> Iterator[Array]:
    """Changes of the parameters of the requested model by noise of the motion, more and more, (n_draws, n_params).

    Draws under which the model cannot be simulated are left out.
    """
    # With a tally of its own, since these are no candidates.
    objective = replace(objective.plain, tally=Tally(), journal=None)
    free = [index for index in form.box.free if remark_of(form.box, index, float(theta[index])) == ""]
    if not free:
        return
    (residuals,), (slopes,) = linearised(objective, theta[None], free)
    inverse = np.linalg.pinv(slopes.T)
    noises = [_MotionNoise.of(test) for test in objective.tests]

    def moved(first: int, index: int, threads: int) -> Array | None:
        parts = []
        for number, each in enumerate(noises):
            observed = objective.compared[number].of_test(each.again([first + index, number]))
            (part,), (failed,) = observed.residuals(theta[None], threads=threads)
            if failed:
                return None
            parts.append(part * observed.weight(len(noises)))
        change = np.zeros(theta.size)
        change[free] = inverse @ (np.concatenate(parts) - residuals)
        return form.to_model.jacobian(theta) @ change

    changes = list[Array]()
    for first in range(0, _DRAWS, _ROUND):
        draws = on_every_test(_ROUND, objective.threads, partial(moved, first))
        changes += [change for change in draws if change is not None]
        if changes:
            yield np.array(changes)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _MotionNoise:
    """A test with the standard deviations of the noise of its displacement [m] and of a measured velocity [m/s]."""

    test: DamperTest
    smoother: Smoother
    displacement: float
    velocity: float

    @classmethod
    def of(cls, test: DamperTest) -> _MotionNoise:
        """The noise that the smoother of the test removes."""
        motion = motion_of(test.displacement, test.dt)
        smoother = motion.smoother
        return cls(
            test=test,
            smoother=smoother,
            displacement=smoother.noise(test.displacement - motion.displacement),
            velocity=smoother.noise(test.velocity - smoother.smooth(test.velocity)),
        )

    def again(self, seed: list[int]) -> DamperTest:
        """The test with such a noise added; that of a derived velocity is the noise of its derivation."""
        test = self.test
        white = np.random.default_rng(seed).standard_normal((2, test.n_time))
        displacement = self.displacement * white[0]
        derived = test.velocity_source == "derived"
        velocity = self.smoother.derivative(displacement) if derived else self.velocity * white[1]
        return replace(
            test,
            displacement=frozen(test.displacement + displacement),
            velocity=frozen(test.velocity + velocity),
        )
