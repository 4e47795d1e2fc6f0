"""Task of every contender: one record, one batch of normalised Bouc-Wen candidates, one misfit each.

With `f = c v + k (x - x0) + k_w w` and `w' = rho (v - |w|^n (sigma |v| sgn(w) - (sigma - 1) v))` (Ikhouane &
Rodellar 2007), one classical Runge-Kutta step per sample interval, and the sum over the samples of the
squared difference from the measured force. The inputs at the stage times are tabulated beforehand and given
to all contenders, so that only this arithmetic is timed. The two hysteresis terms share one power.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

MODEL = "normalised_bouc_wen"
N_TIME = 2000
DT = 1e-3

# How a contender forms |w|^n: the general power, the product w w (right for n = 2 alone), or exp(n ln|w|),
# which jax and numba evaluate faster than a power because it keeps to fewer digits for small |w|.
PowerForm: TypeAlias = Literal["power", "square", "exp_log"]

# Ready to be timed: computes the misfits of the whole batch once and waits for them.
Run: TypeAlias = Callable[[], object]


@dataclass(frozen=True, slots=True, kw_only=True)
class Workload:
    """One batch on one record.

    Attributes
    ----------
    theta : (n_batch, 7) candidates, columns c, k, x0, k_w, rho, sigma, n in SI.
    stages : (n_time - 1, 3, 2) displacement [m] and velocity [m/s] at the start, middle and end of each step.
    force : (n_time,) measured force [N].
    dt : sample interval [s].
    """

    theta: NDArray[np.float64]
    stages: NDArray[np.float64]
    force: NDArray[np.float64]
    dt: float

    @property
    def steps(self) -> int:
        """Runge-Kutta steps in one evaluation of the batch."""
        return len(self.theta) * (len(self.force) - 1)


def displacement_record(n_time: int = N_TIME, dt: float = DT) -> NDArray[np.float64]:
    """Return 10 mm at 1 Hz with a 1 mm sweep from 1 to 8 Hz on top, (n_time,) [m]; 0.12 m/s at the most."""
    time = np.arange(n_time) * dt
    sweep = np.sin(2.0 * np.pi * (1.0 + 1.75 * time) * time)
    displacement: NDArray[np.float64] = 0.010 * np.sin(2.0 * np.pi * time) + 0.001 * sweep
    return displacement


def measured_force(displacement: NDArray[np.float64], dt: float = DT) -> NDArray[np.float64]:
    """Return a plausible force for the residuals, (n_time,) [N]: smoothed friction and a dashpot."""
    velocity: NDArray[np.float64] = np.gradient(displacement, dt)
    return 600.0 * np.tanh(velocity / 0.02) + 1500.0 * velocity


def candidates(n_batch: int, *, general_exponent: bool, rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw from a box typical of small dampers, (n_batch, 7); every n is 2 without `general_exponent`.

    The box is mild enough (rho |v| n (2 sigma - 1) dt < 0.15) for one step per sample to resolve all of it.
    """
    lower = np.array([200.0, 500.0, -0.002, 200.0, 50.0, 0.5, 1.2])
    upper = np.array([2000.0, 3000.0, 0.002, 1000.0, 300.0, 1.2, 2.8])
    theta = rng.uniform(lower, upper, size=(n_batch, 7))
    if not general_exponent:
        theta[:, 6] = 2.0
    return theta
