"""Where JAX computes: on the processor, whatever its default device is; results lie where the caller has the point."""

import os
import sys
from pathlib import Path

import pytest
from command_line import ran

# A second device of the processor, which is the default, stands for a graphics card.
_TWO = {"XLA_FLAGS": "--xla_force_host_platform_device_count=2 --xla_backend_optimization_level=0"}
_TASK = """
import jax
import jax.numpy as jnp
import numpy as np
processor, other = jax.devices()
jax.config.update("jax_default_device", other)
import mrwork as mr
test = mr.synthetic_test("spencer1997")

def on(array):
    (device,) = array.devices()
    return device

misfit = mr.jax.misfit("bingham", test)
start = np.array(misfit.start)
for device in (processor, other):
    point = jax.device_put(start, device)
    several = jnp.stack([point, point])
    for value in (
        misfit(point), misfit(several), jax.grad(misfit)(point), jax.jacfwd(misfit)(point),
        jax.vmap(jax.grad(misfit))(several), jax.jit(jax.grad(misfit))(point),
    ):
        assert on(value) == device, (value, device)
    assert np.isclose(float(misfit(point)), mr.objective("bingham", test)(start), rtol=1e-12)
assert on(misfit(start)) == other
assert {on(array) for array in jax.tree.leaves(misfit.data)} == {processor}

twin = mr.jax.twin("bouc_wen")
record, theta = twin.record(test), jnp.array(twin.spec.nominal)
assert on(record.splines) == processor
assert on(twin.simulate(theta, record, 1)) == on(theta) == other
assert on(jax.jacfwd(lambda theta: twin.simulate(theta, record, 1))(theta)) == other

before = {id(array) for array in jax.live_arrays()}
def force(p, state, displacement, velocity):
    return p.f_y * jnp.tanh(velocity / p.v_s) + p.c * velocity
parameters = {"f_y": ("N", 1, 100, 1e4), "v_s": ("m/s", 1e-4, 0.01, 1), "c": ("N s/m", 1, 500, 1e5)}
own = mr.own_damper("sliding", parameters=parameters, force=force)
fit = mr.identify(own, test, engine="optimistix")
assert fit.fit_percent > 50.0
# Compiled functions and records are kept, for the next call.
kept = {on(array) for array in jax.live_arrays() if id(array) not in before}
assert kept == {processor}, kept
"""


@pytest.mark.long
def test_values_are_where_the_point_is_and_what_is_kept_leaves_the_default_device_alone(
    tmp_path: Path,
) -> None:
    script = tmp_path / "task.py"
    script.write_text(_TASK)
    ran(sys.executable, script, env=os.environ | _TWO, check=True)
