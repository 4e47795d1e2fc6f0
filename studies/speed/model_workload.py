"""Task of our kernel of any model and of its twin: one record, one batch of candidates, one misfit each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork import dampers as core
from mrwork.dampers import DamperSpec
from mrwork.errors import MrworkError
from studies.speed.workload import DT, N_TIME, displacement_record, measured_force

# Wide enough that no exponent is whole, which we would raise by products alone.
SPREAD = 0.1
SUBSTEPS = 1
FINEST_DT = DT / 2**20


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
    theta: NDArray[np.float64]
    loading: core.LoadingHistory
    stages: NDArray[np.float64]
    force: NDArray[np.float64]

    @property
    def steps(self) -> int:
        """Runge-Kutta steps in one evaluation of the batch; without a state, evaluations of the force."""
        n_time = len(self.force)
        return len(self.theta) * (n_time if self.spec.n_states == 0 else (n_time - 1) * SUBSTEPS)

    def misfits(self, threads: int) -> tuple[NDArray[np.float64], NDArray[np.uint8], NDArray[np.uint32]]:
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
