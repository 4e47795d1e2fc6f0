"""The equations of a damper model in JAX, for derivatives of any order and for integrators of others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jax import Array

from mrwork.base.arguments import AnyArray, checked
from mrwork.base.summary import Summarised
from mrwork.dampers.simulation import Loading, refuse_failure, simulate_forces
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import SettingError
from mrwork.identification.candidates import loading_for
from mrwork.records import DamperTest
from mrwork.twins.model_twins import begin, evaluate_on_processor, parameters_at, twin_of
from mrwork.twins.record_arrays import RecordArrays
from mrwork.twins.stepping import simulate


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DamperTwin(Summarised):
    """Rate, force and simulated force of a damper model, all differentiable to any order, for `jit`, `vmap` and `grad`.

    They are the equations of the Rust core, written once more in `jax.numpy`: with `theta` the parameters in the order
    of `spec.names`, (n_params,), at a displacement x [m] and velocity v [m/s], the states z, (n_states,), have the rate
    z'(z, x, v), and the force is f(z, x, v) [N]; dampers begin at z = 0. Where parameters follow the command, it is
    that received by the coil.

    The force agrees with `mr.simulate` to 1e-8 of its largest, for the same number of sub-steps. The twin is a
    reference: it is slower than `mr.jax.force`, and says nothing where a motion is not resolved or diverges.
    """

    _made_by: ClassVar[str] = "mr.jax.twin(model)"

    spec: DamperSpec

    def rate(self, theta: Array, state: Array, displacement: Any, velocity: Any, command: Any = 0.0) -> Array:
        """Rate of the states, shape (n_states,), at a motion [m, m/s] and a command [A or V] that the coil receives."""
        p = parameters_at(self.spec, jnp.asarray(theta), jnp.asarray(command, dtype=jnp.float64))
        return twin_of(self.spec).rate(p, state, displacement, velocity)

    def force(
        self, theta: Array, state: Array, displacement: Any, velocity: Any, command: Any = 0.0
    ) -> Array:
        """Force [N] at a motion [m, m/s] and a command [A or V] that the coil receives."""
        p = parameters_at(self.spec, jnp.asarray(theta), jnp.asarray(command, dtype=jnp.float64))
        return twin_of(self.spec).force(p, state, displacement, velocity)

    def record(self, record: DamperTest | Loading) -> RecordArrays:
        """Motion and command of a test or a loading as a pytree of arrays."""
        return RecordArrays.of(loading_for(record, self.spec).history())

    def simulate(self, theta: Array, record: RecordArrays, substeps: int) -> Array:
        """Force of a record [N], shape (n_time,), with a number of sub-steps per sample, see `substeps`."""
        if not (isinstance(substeps, int) and substeps > 0):
            raise SettingError(f"`substeps` is {substeps}; give a whole number, see `substeps` of the twin")

        def force(theta: Array, record: RecordArrays) -> Array:
            return simulate(self.spec, theta, record, substeps)

        return evaluate_on_processor(force, jnp.asarray(theta), record)

    @checked
    def substeps(self, theta: AnyArray, record: DamperTest | Loading) -> int:
        """Sub-steps per sample that `mr.simulate` takes for these parameters, (n_params,).

        Raises
        ------
        SimulationError
            Where the simulation fails.
        """
        history = loading_for(record, self.spec).history()
        run = simulate_forces(self.spec, np.asarray(theta)[None], history)
        refuse_failure(self.spec.name, run.outcome[0])
        return int(run.substeps[0])


@checked
def twin(model: DamperSpec | str) -> DamperTwin:
    """The equations of a damper model in JAX.

    Parameters
    ----------
    model
        A model or its name, with current laws or without; or a damper of your own.

    Examples
    --------
    >>> import jax, jax.numpy as jnp, mrwork as mr
    >>> twin, test = mr.jax.twin("bouc_wen"), mr.synthetic_test("spencer1997")
    >>> theta, record = jnp.array(twin.spec.nominal), twin.record(test)
    >>> substeps = twin.substeps(theta, test)
    >>> jax.jacfwd(lambda theta: twin.simulate(theta, record, substeps))(theta).shape
    (2001, 8)
    """
    begin()
    spec = damper(model) if isinstance(model, str) else model
    twin_of(spec)
    return DamperTwin(spec=spec)
