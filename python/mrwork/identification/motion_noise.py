"""Errors of the parameters that the noise of the motion makes, which residuals of the force do not show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import erf, sqrt

import numpy as np
from numpy.typing import NDArray

from mrwork.identification.equivalent import Form
from mrwork.identification.linearisation import linearised
from mrwork.identification.objective import Objective
from mrwork.identification.result import remark_of
from mrwork.records import DamperTest
from mrwork.records.damper_test import frozen
from mrwork.records.motion import Smoother, motion_of

Array = NDArray[np.float64]

# Number of motions with more noise that are simulated.
_DRAWS = 24
# Expected share of the 95 % intervals that hold the parameters, below which the noise of the motion dominates: 90 %,
# and one for the error of the draws.
_HELD = 0.91
_QUANTILE = 1.96


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
    moved = moved_by_noise(objective, form, theta)
    known = np.isfinite(standard_errors) & (standard_errors > 0.0) & np.isfinite(moved)
    if not known.any():
        return ()
    share = np.divide(moved, standard_errors, out=np.zeros_like(moved), where=known)
    held = float(np.mean([erf(_QUANTILE / sqrt(2.0 * (1.0 + each**2))) for each in share[known]]))
    if held >= _HELD:
        return ()
    worst = int(np.argmax(share))
    measured = any(test.velocity_source == "measured" for test in objective.tests)
    remedy = "derive the velocity from the displacement by --repair velocity, or " if measured else ""
    return (
        f"noise of the motion dominates: it moves {names[worst]} by about {share[worst]:.2g} times the error that "
        f"the residuals of the force give it, so that 95 % intervals hold about {100 * held:.0f} % of the parameters; "
        f"{remedy}measure the motion with less noise",
    )


def moved_by_noise(objective: Objective, form: Form, theta: Array) -> Array:
    """Rms change of the parameters of the requested model, shape (n_params,), by the noise of the motion.

    Draws under which the model cannot be simulated are left out.
    """
    # With a tally of its own, since these are no candidates.
    plain = _on(objective, objective.tests)
    free = [index for index in form.box.free if remark_of(form.box, index, float(theta[index])) == ""]
    changed = list[Array]()
    if not free:
        return np.zeros(theta.size)
    (residuals,), (slopes,) = linearised(plain, theta[None], free)
    inverse = np.linalg.pinv(slopes.T)
    noises = [_MotionNoise.of(test) for test in plain.tests]
    for draw in range(_DRAWS):
        noisy = _on(objective, tuple(each.again([draw, index]) for index, each in enumerate(noises)))
        if all(np.isfinite(run.squared_error[0]) for run in noisy.misfits(theta[None])):
            change = np.zeros(theta.size)
            change[free] = inverse @ (noisy.residuals(theta[None])[0] - residuals)
            changed.append(change)
    if not changed:
        return np.zeros(theta.size)
    return np.asarray(np.sqrt(np.mean((np.array(changed) @ form.to_model.jacobian(theta).T) ** 2, axis=0)))


def _on(objective: Objective, tests: tuple[DamperTest, ...]) -> Objective:
    return Objective.of(
        objective.spec,
        tests,
        nuisances=objective.nuisances,
        force_exponent=objective.force_exponent,
        threads=objective.threads,
    )


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
