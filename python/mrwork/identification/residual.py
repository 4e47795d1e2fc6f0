"""Residuals of a model on one test: simulation, observation model, nuisance parameters, weight.

Misfits, local minimisations, likelihoods and predictions all use them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mrwork import _rust
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import RecordError, SettingError, SimulationError
from mrwork.identification.nuisance import (
    Nuisance,
    NuisanceName,
    linearised_without_nuisance,
    nuisance_of,
    without_nuisance,
)
from mrwork.records import AS_IT_IS, DamperTest
from mrwork.records.damper_test import loading_of
from mrwork.records.detectors.velocity import refuse_velocity
from mrwork.simulate import Outcome, simulate_forces, simulate_sensitivities
from mrwork.values import Floats, holds_arrays


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class ObservedTest:
    """One test that a model is compared with; the splines of its `history` are computed once for all candidates.

    `share` is the weight of its squared NRMSE among other tests. Residuals are the model's force minus the measured one
    [N], over the samples that are compared, with the nuisance parameters at their least-squares values for each
    candidate. `counted` are these samples, `measured` is the force there [N], shape (n_counted,), and `variance` its
    variance [N^2]: found once, because every simulation needs them.
    """

    spec: DamperSpec
    test: DamperTest
    history: _rust.LoadingHistory
    nuisances: tuple[NuisanceName, ...] = ()
    share: float = 1.0
    counted: slice | NDArray[np.intp] = field(init=False)
    measured: Floats = field(init=False)
    variance: float = field(init=False)

    def __post_init__(self) -> None:
        counted = self.test.counted
        measured = self.test.force[counted]
        object.__setattr__(self, "counted", counted)
        object.__setattr__(self, "measured", measured)
        object.__setattr__(self, "variance", float(np.var(measured)))

    @classmethod
    def of(cls, spec: DamperSpec, test: DamperTest, nuisances: tuple[NuisanceName, ...] = ()) -> ObservedTest:
        """Compute the splines of the test's motion."""
        if len(set(nuisances)) != len(nuisances):
            raise SettingError(f"`nuisances` are {', '.join(nuisances)}; name each once")
        refuse_velocity(test)
        if test.n_counted == 0:
            raise SettingError(
                f"{test.label}: none of its {test.n_time} samples is compared, `n_settle` is {test.n_settle}"
                f"{f' and the model force {beyond}' if (beyond := test.observation.in_words) else ''}; give less"
            )
        for channel, samples in (("force", test.force[test.counted]), ("displacement", test.displacement)):
            if np.ptp(samples) == 0.0:
                raise RecordError(
                    f"{test.label}: the {channel} is constant, so there is nothing to compare; check the channel"
                )
        return cls(spec=spec, test=test, history=loading_of(test, spec).history(), nuisances=nuisances)

    def of_test(self, test: DamperTest) -> ObservedTest:
        """Another test, compared as this one, with its share."""
        return replace(ObservedTest.of(self.spec, test, self.nuisances), share=self.share)

    @property
    def deviation(self) -> float:
        """Standard deviation of the measured force that is compared [N]."""
        return float(np.sqrt(self.variance))

    def weight(self, n_tests: int) -> float:
        """Factor on residuals [N] with which the sum of their squares over all tests is the squared misfit."""
        return float(np.sqrt(self.share) / np.sqrt(self.variance * self.measured.size * n_tests))

    def forces(self, theta: Floats, *, threads: int = 0) -> tuple[Floats, NDArray[np.bool_]]:
        """Force of each row of `theta` as recorded [N], shape (n_batch, n_time), and which rows failed.

        For a row that failed, the observation model is applied to a force of zero.
        """
        run = simulate_forces(self.spec, theta, self.history, threads=threads)
        failed = run.outcome != Outcome.FINISHED
        run.force[failed] = 0.0
        return self.test.observation.observe(run.force, self.test.dt), failed

    def residuals(self, theta: Floats, *, threads: int = 0) -> tuple[Floats, NDArray[np.bool_]]:
        """Residuals of each row of `theta` [N], shape (n_batch, n_counted), and which rows failed."""
        force, failed = self.forces(theta, threads=threads)
        return without_nuisance(force[:, self.counted], self.measured, self.nuisances), failed

    def linearise_residuals(
        self, theta: Floats, columns: Sequence[int], *, threads: int = 0
    ) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Residuals with their exact derivatives, from one simulation of each row, and which rows failed.

        Derivatives with respect to columns of `theta`, shape (n_batch, n_columns, n_counted), zero where a row failed.
        """
        run = simulate_sensitivities(self.spec, theta, self.history, columns=columns, threads=threads)
        failed = run.outcome != Outcome.FINISHED
        run.force[failed] = 0.0
        run.jacobian[failed] = 0.0
        observation, dt, counted = self.test.observation, self.test.dt, self.counted
        force, slope = run.force, run.jacobian
        if observation != AS_IT_IS:
            force = observation.observe(force, dt)
            slope = replace(observation, offset=0.0).observe(slope, dt)
        residuals, derivative = linearised_without_nuisance(
            force[:, counted], slope[..., counted], self.measured, self.nuisances
        )
        return residuals, derivative, failed

    def with_nuisance(self, force: Floats) -> tuple[Floats, Nuisance]:
        """Apply the least-squares nuisance parameters to a recorded `force` [N], shape (n_time,); return them too."""
        nuisance = nuisance_of(force[self.counted], self.measured, self.test.dt, self.nuisances)
        return nuisance.apply_to(force, self.test.dt) if self.nuisances else force, nuisance

    def predict_force(self, theta: Floats, *, substep_factor: int = 1) -> tuple[Floats, Nuisance, int]:
        """Force of one set of parameters as recorded [N], shape (n_time,), nuisance parameters, number of sub-steps."""
        run = simulate_forces(self.spec, theta[None], self.history, substep_factor=substep_factor)
        outcome = Outcome(run.outcome[0])
        if outcome is not Outcome.FINISHED:
            raise SimulationError(
                f"{self.spec.name} on {self.test.name} ended as {outcome.name.lower()}: {outcome.remedy}"
            )
        force, nuisance = self.with_nuisance(self.test.observation.observe(run.force[0], self.test.dt))
        return force, nuisance, int(run.substeps[0])
