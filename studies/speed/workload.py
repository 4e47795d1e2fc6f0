"""Tasks of kernels: one record, one batch of candidates, one misfit each.

`Workload` is that of the normalised Bouc-Wen model, for peers that write it themselves. With `f = c v + k (x - x0) +
k_w w` and `w' = rho (v - |w|^n (sigma |v| sgn(w) - (sigma - 1) v))` (Ikhouane & Rodellar 2007), one classical
Runge-Kutta step per sample interval, and the sum over the samples of the squared difference from the measured force.
The inputs at the stage times are tabulated beforehand and given to all contenders, so that only this arithmetic is
timed. The two hysteresis terms share one power. `ModelWorkload` is the task of any model, for its twin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mrwork import dampers as core
from mrwork.dampers import DamperSpec
from mrwork.errors import MrworkError
from studies.former.arrays import Floats

MODEL = "normalised_bouc_wen"
N_TIME = 2000
DT = 1e-3
# Wide enough that no exponent is whole, which we would raise by products alone.
SPREAD = 0.1
SUBSTEPS = 1
FINEST_DT = DT / 2**20

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

    theta: Floats
    stages: Floats
    force: Floats
    dt: float

    @property
    def steps(self) -> int:
        """Runge-Kutta steps in one evaluation of the batch."""
        return len(self.theta) * (len(self.force) - 1)


def displacement_record(n_time: int = N_TIME, dt: float = DT) -> Floats:
    """Return 10 mm at 1 Hz with a 1 mm sweep from 1 to 8 Hz on top, (n_time,) [m]; 0.12 m/s at the most."""
    time = np.arange(n_time) * dt
    sweep = np.sin(2.0 * np.pi * (1.0 + 1.75 * time) * time)
    displacement: Floats = 0.010 * np.sin(2.0 * np.pi * time) + 0.001 * sweep
    return displacement


def measured_force(displacement: Floats, dt: float = DT) -> Floats:
    """Return a plausible force for the residuals, (n_time,) [N]: smoothed friction and a dashpot."""
    velocity: Floats = np.gradient(displacement, dt)
    return 600.0 * np.tanh(velocity / 0.02) + 1500.0 * velocity


def candidates(n_batch: int, *, general_exponent: bool, rng: np.random.Generator) -> Floats:
    """Draw from a box typical of small dampers, (n_batch, 7); every n is 2 without `general_exponent`.

    The box is mild enough (rho |v| n (2 sigma - 1) dt < 0.15) for one step per sample to resolve all of it.
    """
    lower = np.array([200.0, 500.0, -0.002, 200.0, 50.0, 0.5, 1.2])
    upper = np.array([2000.0, 3000.0, 0.002, 1000.0, 300.0, 1.2, 2.8])
    theta = rng.uniform(lower, upper, size=(n_batch, 7))
    if not general_exponent:
        theta[:, 6] = 2.0
    return theta


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelWorkload:
    """One batch of one model on one record, `SUBSTEPS` sub-steps per sample.

    Attributes
    ----------
    theta : (n_batch, n_params) candidates, in spec order.
    loading : the motion, as our kernel takes it.
    stages : (n_time - 1, 2 SUBSTEPS + 1, 2) the same motion, as the twin takes it.
    force : (n_time,) measured force [N].
    """

    spec: DamperSpec
    theta: Floats
    loading: core.LoadingHistory
    stages: Floats
    force: Floats

    @property
    def steps(self) -> int:
        """Runge-Kutta steps in one evaluation of the batch; without a state, evaluations of the force."""
        n_time = len(self.force)
        return len(self.theta) * (n_time if self.spec.n_states == 0 else (n_time - 1) * SUBSTEPS)

    def misfits(self, threads: int) -> tuple[Floats, NDArray[np.uint8], NDArray[np.uint32]]:
        """Our kernel on the batch: misfit, outcome and sub-steps of each candidate, (n_batch,)."""
        return core.misfits(self.spec.name, self.theta, self.loading, self.force, threads=threads)[:3]


def model_workload(spec: DamperSpec, n_batch: int, n_time: int = N_TIME) -> ModelWorkload:
    """Draw candidates around the nominal values; sample finely enough that one step per sample resolves them all.

    A parameter that is nominally zero stays zero.
    """
    ends = np.stack([(1.0 - SPREAD) * spec.nominal, (1.0 + SPREAD) * spec.nominal])
    lower = np.maximum(ends.min(axis=0), [parameter.lower for parameter in spec.parameters])
    upper = np.minimum(ends.max(axis=0), [parameter.upper for parameter in spec.parameters])
    theta = np.random.default_rng(2007).uniform(lower, upper, size=(n_batch, len(spec.parameters)))
    dt = DT
    while dt >= FINEST_DT:
        displacement = displacement_record(n_time, dt)
        loading = core.LoadingHistory(dt, displacement, None)
        workload = ModelWorkload(
            spec=spec,
            theta=theta,
            loading=loading,
            stages=np.ascontiguousarray(loading.stages(SUBSTEPS)),
            force=measured_force(displacement, dt),
        )
        _, outcome, substeps = workload.misfits(threads=1)
        if not outcome.any() and int(substeps.max()) == SUBSTEPS:
            return workload
        dt /= 2.0
    raise MrworkError(
        f"expected {SUBSTEPS} step per sample to resolve {spec.name} around its nominal values, it asks for more "
        f"even at {FINEST_DT:g} s; look at its nominal values or its stiffness bound"
    )
