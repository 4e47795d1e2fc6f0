"""Forces as an operation of JAX: bits and derivatives of the core, under every transformation, and what is refused."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import own_dampers
import pytest
from damper_samples import sine
from refusals import refusal

import mrwork as mr
from mrwork.dampers.parameters import DRIVER_RATES, Lag
from mrwork.dampers.simulation import Outcome, simulate_forces, simulate_sensitivities
from mrwork.twins import kernel
from mrwork.twins.kernel import Kernel
from mrwork.twins.record_arrays import RecordArrays

SPEC = mr.damper("viscous_dahl")
RECORD = sine(n_time=120)
SMALLEST = np.finfo(float).tiny


def spread(spec: mr.DamperSpec, count: int, seed: int = 0) -> Any:
    """Parameters about the nominal ones."""
    nominal = np.array(spec.nominal)
    return jnp.asarray(nominal * np.random.default_rng(seed).uniform(0.9, 1.1, (count, len(nominal))))


def with_laws(lag: Lag) -> tuple[mr.DamperSpec, Any]:
    """A model whose parameters follow the command, about values of which the command matters."""
    spec = SPEC.with_current_laws({"k_w": "linear", "rho": "log_quadratic:0,0.5,1"}, unit="A", lag=lag)
    return spec, spread(spec, 2)


def flushed(values: Any) -> np.ndarray:
    """Numbers as programs of XLA leave them, which flush what is subnormal to zero."""
    values = np.asarray(values)
    return np.where(np.abs(values) < SMALLEST, 0.0, values)


@pytest.mark.parametrize("spec", mr.damper_models(), ids=lambda spec: spec.name)
def test_forces_and_derivatives_have_the_bits_of_the_core(spec: mr.DamperSpec) -> None:
    theta, history = spread(spec, 3), RECORD.history()
    core = simulate_sensitivities(spec, np.asarray(theta), history)
    record = RecordArrays.of(history)
    force, jacobian = kernel._linearise(Kernel(spec=spec, columns=(*range(len(spec.names)),)), theta, record)
    assert np.array_equal(force, core.force)
    finished = core.outcome == Outcome.FINISHED
    assert np.array_equal(np.asarray(jacobian)[finished], core.jacobian[finished])
    assert not np.asarray(jacobian)[~finished].any()


@pytest.mark.parametrize("command", [0.7, np.linspace(0.1, 0.9, 120)], ids=["held", "varying"])
@pytest.mark.parametrize("lag", DRIVER_RATES)
def test_models_that_follow_the_command_have_the_bits_of_the_core(command: Any, lag: Lag) -> None:
    spec, theta = with_laws(lag)
    loading = mr.Loading(dt=RECORD.dt, displacement=RECORD.displacement, command=command, command_unit="A")
    force = mr.jax.force(spec, loading)
    core = mr.sensitivities(spec, np.asarray(theta), loading)
    assert np.array_equal(force(theta), core.force)
    assert np.array_equal(jax.vmap(jax.jacfwd(force))(theta), flushed(core.jacobian))


def test_every_transformation_has_the_same_bits() -> None:
    force, theta = mr.jax.force(SPEC, RECORD), spread(SPEC, 6)
    whole = np.asarray(mr.simulate(SPEC, np.asarray(theta), RECORD))
    slopes = flushed(mr.sensitivities(SPEC, np.asarray(theta), RECORD).jacobian)
    data = force.data
    assert np.array_equal(force(theta), whole)
    assert np.array_equal(jax.jit(force)(theta), whole)
    donated = jax.jit(lambda point, data: (2.0 * point, force(point, data)), donate_argnums=0)
    assert np.array_equal(donated(theta + 0.0, data)[1], whole)
    assert np.array_equal(jax.lax.map(force, theta), whole)
    assert np.array_equal(jax.lax.scan(lambda _, row: (None, force(row)), None, theta)[1], whole)
    assert np.array_equal(jax.vmap(jax.vmap(force))(theta.reshape(2, 3, -1)).reshape(6, -1), whole)
    assert np.array_equal(force(theta.reshape(2, 3, -1)).reshape(6, -1), whole)
    assert np.array_equal(jax.vmap(jax.jacfwd(force))(theta), slopes)
    assert np.array_equal(jax.vmap(jax.jacrev(force))(theta), slopes)
    assert np.array_equal(jax.jit(jax.vmap(jax.jacrev(force), (0, None)))(theta, data), slopes)


def test_batches_of_records_and_of_parameters_go_together() -> None:
    theta = spread(SPEC, 4)
    records = [sine(n_time=120, frequency=frequency) for frequency in (1.0, 2.5, 4.0)]
    forces = [mr.jax.force(SPEC, record) for record in records]
    together = jax.tree.map(lambda *arrays: jnp.stack(arrays), *(each.data for each in forces))
    expected = np.stack([mr.simulate(SPEC, np.asarray(theta), record) for record in records])
    one = forces[0]
    assert np.array_equal(jax.vmap(one, (None, 0))(theta, together), expected)
    inner = jax.vmap(jax.vmap(one, (0, None)), (None, 0))
    assert np.array_equal(inner(theta, together), expected)
    outer = jax.vmap(jax.vmap(one, (None, 0)), (0, None))
    assert np.array_equal(outer(theta, together), expected.swapaxes(0, 1))
    assert np.array_equal(jax.vmap(one)(theta[:3], together), expected[np.arange(3), np.arange(3)])
    gradients = jax.vmap(jax.jacrev(one), (None, 0))(theta[0], together)
    single = np.stack([jax.jacrev(each)(theta[0]) for each in forces])
    assert np.array_equal(gradients, single)


def test_an_empty_batch_has_an_empty_force() -> None:
    force = mr.jax.force(SPEC, RECORD)
    none = jnp.zeros((0, len(SPEC.names)))
    assert force(none).shape == (0, 120)
    assert jax.vmap(jax.jacfwd(force))(none).shape == (0, 120, len(SPEC.names))


def test_the_shortest_record_has_the_bits_of_the_core() -> None:
    record, theta = sine(n_time=4), np.array([SPEC.nominal])
    force, core = mr.jax.force(SPEC, record), mr.sensitivities(SPEC, theta, record)
    assert np.array_equal(force(theta), core.force)
    assert np.array_equal(jax.jacfwd(force)(jnp.asarray(theta[0])), core.jacobian[0])


def test_a_point_that_fails_is_infinite_with_derivatives_of_zero_and_leaves_others_alone() -> None:
    force, theta = mr.jax.force(SPEC, RECORD), spread(SPEC, 3)
    stiff = theta.at[1, SPEC.names.index("rho")].set(1e9).at[2, 0].set(jnp.nan)
    found, slopes = np.asarray(force(stiff)), np.asarray(jax.vmap(jax.jacfwd(force))(stiff))
    assert np.array_equal(found[0], force(theta)[0])
    assert np.isinf(found[1:]).all()
    assert slopes[0].any()
    assert not slopes[1:].any()


def test_threads_do_not_change_a_bit() -> None:
    theta = spread(mr.damper("bouc_wen"), 40)
    alone, together = (mr.jax.force("bouc_wen", RECORD, threads=threads) for threads in (1, 2))
    assert np.array_equal(alone(theta), together(theta))


def test_threads_of_python_call_at_once() -> None:
    force, theta = jax.jit(mr.jax.force(SPEC, RECORD)), spread(SPEC, 64)
    expected = np.asarray(jax.vmap(force)(theta))
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(force, theta))
    assert np.array_equal(found, expected)


def test_fixed_sub_steps_are_those_of_the_rule_where_it_takes_as_many() -> None:
    spec, theta = mr.damper("bouc_wen"), spread(mr.damper("bouc_wen"), 1)
    (count,) = simulate_forces(spec, np.asarray(theta), RECORD.history()).substeps
    fixed = mr.jax.force(spec, RECORD, substeps=int(count))
    assert np.array_equal(fixed(theta), mr.jax.force(spec, RECORD)(theta))
    finer = mr.jax.force(spec, RECORD, substeps=2 * int(count))(theta)
    assert 0.0 < np.abs(finer - fixed(theta)).max() < 1e-2 * np.abs(finer).max()


def test_a_record_is_an_operand_of_the_program_and_not_a_constant_in_it() -> None:
    force, theta = mr.jax.force(SPEC, sine(n_time=2000)), spread(SPEC, 1)[0]
    given = jax.jit(force).lower(theta, force.data).as_text()
    assert len(given) < 20_000 < len(jax.jit(force).lower(theta).as_text())
    assert len(jax.jit(lambda function, point: function(point)).lower(force, theta).as_text()) < 20_000


def test_dampers_of_users_have_the_forces_and_derivatives_of_mr_simulate() -> None:
    own = own_dampers.guo
    unit = np.random.default_rng(0).uniform(0.3, 0.7, (3, len(own.names)))
    theta = np.asarray(mr.Box.of(own).theta_from_unit(unit))
    record = sine(n_time=40, dt=8e-3)
    force, core = mr.jax.force(own, record), mr.sensitivities(own, theta, record)
    assert np.allclose(force(theta), core.force, rtol=0.0, atol=1e-12 * np.abs(core.force).max())
    slopes = np.asarray(jax.vmap(jax.jacrev(force))(jnp.asarray(theta)))
    assert np.allclose(slopes, core.jacobian, rtol=1e-9, atol=1e-9 * np.abs(core.jacobian).max(axis=1).min())
    theta[0, 0] = np.nan
    assert np.isinf(force(theta)[0]).all()
    assert not np.asarray(jax.jacfwd(force)(jnp.asarray(theta[0]))).any()


def test_the_twin_has_the_forces_and_derivatives_of_the_kernel() -> None:
    command = np.linspace(0.1, 0.9, 120)
    spec, loading = with_laws("two_rates")[0], replace(RECORD, command=command, command_unit="A")
    twin, theta = mr.jax.twin(spec), spread(spec, 1)[0]
    record, substeps = twin.record(loading), twin.substeps(theta, loading)
    force = mr.jax.force(spec, loading)
    expected, slopes = np.asarray(force(theta)), np.asarray(jax.jacfwd(force)(theta))
    simulate = jax.jit(twin.simulate, static_argnums=2)
    found = simulate(theta, record, substeps)
    assert np.allclose(found, expected, rtol=0.0, atol=1e-10 * np.abs(expected).max())
    of_twin = np.asarray(jax.jacfwd(simulate)(theta, record, substeps))
    assert np.all(np.abs(of_twin - slopes) <= 1e-8 * np.abs(slopes).max(axis=0))


def test_the_twin_has_rate_and_force_and_second_derivatives() -> None:
    twin = mr.jax.twin(SPEC)
    theta, state = jnp.array(SPEC.nominal), jnp.array([0.3])
    p = dict(zip(SPEC.names, SPEC.nominal, strict=True))
    assert np.allclose(twin.rate(theta, state, 0.01, -0.2), p["rho"] * (-0.2 - 0.2 * 0.3))
    assert np.allclose(twin.force(theta, state, 0.01, -0.2), p["k_x"] * -0.2 + p["k_w"] * 0.3 + p["f0"])
    record = twin.record(sine(n_time=8))
    twice = jax.jacfwd(jax.jacfwd(lambda theta: jnp.sum(twin.simulate(theta, record, 1) ** 2)))
    energy = jax.jit(twice)(theta)
    assert np.allclose(energy, energy.T)
    assert energy.any()


def test_what_has_no_derivatives_or_device_is_said() -> None:
    force, theta = mr.jax.force(SPEC, RECORD), spread(SPEC, 1)[0]
    refusal(jax.hessian(lambda point: jnp.sum(force(point))), theta, match="second ones from mr.jax.twin")
    refusal(jax.grad(lambda data: jnp.sum(force(theta, data))), force.data, match="not to the record")
    refusal(jax.export.export(jax.jit(force), platforms=["cuda"]), theta, match="compiled for cuda")


def test_wrong_points_and_settings_are_told() -> None:
    force, nominal = mr.jax.force(SPEC, RECORD), np.array(SPEC.nominal)
    for wrong, word in ((nominal.astype(np.float32), "float64"), (nominal[:2], r"\(2,\); give \(4,\)")):
        refusal(force, wrong, match=word)
    refusal(mr.jax.force, SPEC, RECORD, substeps=3, match="power of two")
    refusal(mr.jax.force, with_laws("none")[0], RECORD, match="takes its command in A")
    refusal(mr.jax.twin(SPEC).substeps, nominal * np.nan, RECORD, match="too stiff")


def test_a_wrong_call_is_an_error_of_xla_and_not_a_crash() -> None:
    record, theta = RecordArrays.of(RECORD.history()), jnp.array(SPEC.nominal)
    Kernel(spec=SPEC, columns=())

    def call(*operands: Any, n_time: int = 120, dtype: Any = jnp.float64, **changes: Any) -> Any:
        attributes = {
            "model": SPEC.name,
            "laws": "",
            "rates": np.int64(0),
            "columns": np.arange(2),
            "substeps": np.int64(0),
            "threads": np.int64(1),
        } | changes
        result = jax.ShapeDtypeStruct((n_time,), dtype)
        return jax.ffi.ffi_call("mrwork_damper_force", result)(theta, *operands, **attributes)

    for said, operands, wrong in (
        ("no damper model", record, {"model": "none"}),
        ("no current law", record, {"laws": "cubed"}),
        ("power of two", record, {"substeps": np.int64(3)}),
        ("64-bit integers", record, {"threads": np.int32(2)}),
        ("rows of", record, {"n_time": 119}),
        ("64-bit floats", record, {"dtype": jnp.float32}),
        ("3 operands", record[:2], {}),
        ("leading axes", (jnp.stack([record.splines] * 2), *record[1:]), {}),
    ):
        with pytest.raises(jax.errors.JaxRuntimeError, match=said):
            call(*operands, **wrong)
    assert np.array_equal(call(*record), mr.simulate(SPEC, theta, RECORD))
