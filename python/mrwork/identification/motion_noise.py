"""Errors of the parameters that the noise of the motion makes, which residuals of the force do not show."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import erf, sqrt

import numpy as np
from numpy.typing import NDArray

from mrwork.identification.covariance import Slopes
from mrwork.identification.progress import on_every_test
from mrwork.records import DamperTest
from mrwork.records.damper_test import frozen
from mrwork.records.motion import Smoother, spectrum

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


def motion_noise_warning(slopes: Slopes, standard_errors: Array, names: Sequence[str]) -> tuple[str, ...]:
    """A sentence where hardly 90 % of the 95 % intervals are expected to hold, for the noise of the motion.

    A model is driven by the recorded motion, whose noise it integrates: its force is wrong at reversals, where the
    hysteresis depends on it, by errors that the few samples there hardly show. The noise of displacement and velocity,
    estimated from the records, is added once more, and the change of the force is projected on the parameters,

        change of theta = (J'J)^-1 J' (change of the force),

    as its own errors are. Its mean square over draws has the bias and the scatter.

    Parameters
    ----------
    slopes
        Of the sum of squares at the minimum.
    standard_errors
        Of the parameters of the requested model, shape (n_params,).
    names
        Names of the parameters of the requested model.
    """
    errors = standard_errors
    known = np.isfinite(errors) & (errors > 0.0)
    if not known.any():
        return ()
    changes = np.empty((0, errors.size))
    for changes in _changes_by_noise(slopes):
        shares = np.sqrt(np.mean(changes**2, axis=0))[known] / errors[known]
        # A mean square of n draws has a relative standard error of sqrt(2/n), a root of it half of that.
        if _held(shares * (1.0 + _SURELY / sqrt(2.0 * len(changes)))) >= _HELD:
            return ()
    if not len(changes) or _held(shares) >= _HELD:
        return ()
    worst = int(np.argmax(shares))
    measured = any(test.velocity_source == "measured" for test in slopes.objective.tests)
    remedy = "derive the velocity from the displacement by --repair velocity, or " if measured else ""
    return (
        f"noise of the motion dominates: it moves {np.array(names)[known][worst]} by about {shares[worst]:.2g} times "
        f"the error that the residuals of the force give it, so that 95 % intervals hold about "
        f"{100 * _held(shares):.0f} % of the parameters; {remedy}measure the motion with less noise",
    )


def _held(shares: Array) -> float:
    """Expected share of the 95 % intervals that hold, where noise moves parameters by these shares of their errors."""
    return float(np.mean([erf(_QUANTILE / sqrt(2.0 * (1.0 + each**2))) for each in shares]))


def _changes_by_noise(slopes: Slopes) -> Iterator[Array]:
    """Changes of the parameters of the requested model by noise of the motion, more and more, (n_draws, n_params).

    Draws under which the model cannot be simulated are left out.
    """
    objective, form, theta = slopes.objective, slopes.form, slopes.theta
    interior = slopes.interior
    if not interior:
        return
    inverse = np.linalg.pinv(slopes.by_interior().T)
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
        change[interior] = inverse @ (np.concatenate(parts) - slopes.residuals)
        return form.to_model.jacobian(theta) @ change

    changes = list[Array]()
    for first in range(0, _DRAWS, _ROUND):
        draws = on_every_test(_ROUND, objective.threads, partial(moved, first))
        changes += [change for change in draws if change is not None]
        if changes:
            yield np.array(changes)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _MotionNoise:
    """A test with the standard deviations of the noise of its displacement [m] and of a measured velocity [m/s].

    The `velocity` is `None` where it is derived from the displacement.
    """

    test: DamperTest
    smoother: Smoother
    displacement: float
    velocity: float | None

    @classmethod
    def of(cls, test: DamperTest) -> _MotionNoise:
        """The noise that the smoother of the test removes."""
        band = spectrum(test.displacement, test.dt)
        smoother = Smoother.for_band(band.band_edge, test.dt, test.n_time)
        measured = test.velocity_source == "measured"
        return cls(
            test=test,
            smoother=smoother,
            displacement=smoother.noise(test.displacement - smoother.smooth(test.displacement)),
            velocity=smoother.noise(test.velocity - smoother.smooth(test.velocity)) if measured else None,
        )

    def again(self, seed: list[int]) -> DamperTest:
        """The test with such a noise added; that of a derived velocity is the noise of its derivation."""
        test = self.test
        rng = np.random.default_rng(seed)
        displacement = self.displacement * rng.standard_normal(test.n_time)
        if self.velocity is None:
            velocity = self.smoother.derivative(displacement)
        else:
            velocity = self.velocity * rng.standard_normal(test.n_time)
        return replace(
            test,
            displacement=frozen(test.displacement + displacement),
            velocity=frozen(test.velocity + velocity),
        )
