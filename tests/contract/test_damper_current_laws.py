"""Current laws of every model: names, plain model at a held command, steps of the command, twin, refusals."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from damper_samples import N_TIME, noise, sine
from refusals import refusal

from mrwork import _rust
from mrwork.dampers import damper
from mrwork.dampers.dependence import CurrentLaws, named_dependences
from mrwork.dampers.parameters import DRIVER_RATES
from mrwork.dampers.simulation import Loading, Outcome, simulate_force, simulate_forces
from mrwork.store import codec
from mrwork.twins.model_twins import parameters_at
from mrwork.twins.record_arrays import RecordArrays
from mrwork.twins.stepping import simulate

LAWS = (
    "linear",
    "tanh:0.2,1",
    "log_quadratic:0,0.5,1",
    "monotone:0,0.3,0.6,1",
    "straight:0,0.5,1",
    "straight_log:0,0.5,1",
    "quadratic",
    "linear:0.2,0.8",
    "exponential:0,1",
    "cubic",
    "exponential",
)


def followed(spec):
    """Parameters that follow the command here: all of log scale, which are forces, stiffnesses, rates."""
    return [parameter.name for parameter in spec.plain if parameter.scale == "log"]


def with_laws(spec, *, lag="none"):
    """The model with a different law for one parameter after the other."""
    laws = {name: LAWS[index % len(LAWS)] for index, name in enumerate(followed(spec))}
    return spec.with_current_laws(laws, lag=lag)


def theta_of(model):
    """A fifth more of each followed parameter per ampere, a twentieth of curvature, -1 in exponents, 1.5 in rates.

    A current falls at a third of the rate at which it rises.
    """
    values = []
    base = 0.0
    for parameter in model.parameters:
        place = parameter.coefficient
        if place is None or (place.number == 0 and place.command is None):
            base = parameter.nominal * (0.3 if parameter.name == "eta_fall" else 1.0)
            values.append(base)
        elif place.command is not None:
            values.append(parameter.nominal * (1.0 + 0.2 * place.command + 0.05 * place.command**2))
        elif place.is_rate:
            values.append(1.5 if parameter.is_positive else -1.0)
        else:
            values.append(base * {1: 0.2, 2: 0.05, 3: -0.05}[place.number])
    return np.array(values)


def stepped_command():
    """0.4 A, then 1 A, then a ramp down."""
    command = np.full(N_TIME, 0.4)
    command[200:500] = 1.0
    command[500:] = np.linspace(1.0, 0.1, N_TIME - 500)
    return command


def test_coefficients_are_named_after_their_parameter(spec):
    model = with_laws(spec)
    names = {parameter.plain_name for parameter in model.parameters}
    assert names == {parameter.name for parameter in spec.plain}
    assert len(model.names) == len(set(model.names)) > len(spec.names)
    assert with_laws(spec, lag="one_rate").names == (*model.names, "eta")
    assert with_laws(spec, lag="two_rates").names == (*model.names, "eta_rise", "eta_fall")


def test_held_command_is_the_plain_model_at_its_values(spec):
    model = with_laws(spec)
    theta = theta_of(model)
    for command in (0.0, 0.6):
        plain = np.array(parameters_at(model, theta, command))
        loading = replace(noise(), command=command, command_unit="A")
        # The laws are evaluated with fused multiply-adds here and without there: one rounding apart.
        expected = simulate_force(spec, plain, noise())
        difference = simulate_force(model, theta, loading) - expected
        assert np.max(np.abs(difference)) <= 1e-9 * np.max(np.abs(expected))


def test_a_constant_array_is_a_held_command_bit_for_bit(spec):
    model = with_laws(spec, lag="one_rate")
    theta = theta_of(model)
    held = simulate_force(model, theta, replace(noise(), command=0.7, command_unit="A"))
    array = simulate_force(model, theta, replace(noise(), command=np.full(N_TIME, 0.7), command_unit="A"))
    np.testing.assert_array_equal(held, array)


@pytest.mark.parametrize("lag", DRIVER_RATES)
def test_twin_agrees_under_a_stepped_command(spec, lag):
    model = with_laws(spec, lag=lag)
    theta = theta_of(model)
    history = replace(sine(), command=stepped_command(), command_unit="A").history()
    run = simulate_forces(model, theta[None], history)
    assert run.outcome[0] == Outcome.FINISHED
    twin = jax.jit(lambda theta, record: simulate(model, theta, record, int(run.substeps[0])))
    force = np.asarray(twin(theta, RecordArrays.of(history)))
    assert np.max(np.abs(force - run.force[0])) <= 1e-10 * np.max(np.abs(run.force[0]))
    steady = simulate_force(model, theta, replace(sine(), command=0.4, command_unit="A"))
    # Before the step nothing is known of it, but its stiffness decides the sub-steps; after it the force is another.
    change = np.abs(run.force[0] - steady) / np.max(np.abs(steady))
    assert np.max(change[:200]) < 5e-3 < 5e-2 < np.max(change[210:])


def test_a_fast_driver_is_no_driver(spec):
    # At 1e5 1/s a step of the command is followed within a hundredth of a sample.
    model, lagged = with_laws(spec), with_laws(spec, lag="one_rate")
    loading = replace(sine(), command=stepped_command(), command_unit="A")
    theta = theta_of(model)
    immediate = simulate_force(model, theta, loading)
    fast = simulate_force(lagged, np.append(theta, 1e5), loading)
    slow = simulate_force(lagged, np.append(theta, 20.0), loading)
    scale = np.max(np.abs(immediate))
    after = np.ones(N_TIME, dtype=bool)
    # At the sample of a step the coil still has the old command: no lag is infinitely fast.
    after[[200, *range(500, N_TIME)]] = False
    behind = np.max(np.abs(slow - immediate)[after])
    assert behind > 1e-3 * scale
    # The first step after a change still begins with the old parameters, which a stiff loop feels for a while.
    assert np.max(np.abs(fast - immediate)[after]) < 0.1 * behind


def test_a_current_rises_by_one_rate_and_falls_by_the_other() -> None:
    """The force of a dashpot whose damping is the current: exponentials from sample to sample."""
    dt, rise, fall = 1e-3, 200.0, 60.0
    sent = np.repeat([0.0, 1.0, 0.4, 0.9, 0.0, 0.7], 40)
    current = [sent[0]]
    for command in sent[:-1]:
        rate = rise if current[-1] < command else fall
        current.append(command + (current[-1] - command) * np.exp(-rate * dt))
    model = damper("bingham").with_current_laws({"c0": "linear"}, lag="two_rates")
    time = dt * np.arange(sent.size)
    motion = Loading(
        dt=dt, displacement=0.1 * time, velocity=np.full(sent.size, 0.1), command=sent, command_unit="A"
    )
    values = {
        "f_c": 1e-3,
        "v_s": 1e2,
        "c0.0": 1e4,
        "c0.1": 1e3,
        "f0": 0.0,
        "eta_rise": rise,
        "eta_fall": fall,
    }
    force = simulate_force(model, [values[name] for name in model.names], motion)
    np.testing.assert_allclose((force / 0.1 - 1e4) / 1e3, current, atol=1e-6)


def test_laws_of_files_have_their_lag_also_those_written_before_it_had_two_rates() -> None:
    spec = damper("dahl").with_current_laws({"k_w": "linear"}, lag="two_rates")
    assert codec.built(CurrentLaws, codec.plain(spec.current_laws)).lag == "two_rates"
    for lagged, lag in ((True, "one_rate"), (False, "none")):
        earlier = {"unit": "A", "laws": ["linear", "constant", "constant"], "lagged": lagged}
        assert codec.built(CurrentLaws, earlier).lag == lag


def test_equal_rates_are_one_rate_bit_for_bit(spec):
    one, two = (with_laws(spec, lag=lag) for lag in ("one_rate", "two_rates"))
    history = replace(sine(), command=stepped_command(), command_unit="A").history()
    theta = theta_of(with_laws(spec))
    forces = [
        simulate_forces(model, np.append(theta, rates)[None], history).force
        for model, rates in ((one, [40.0]), (two, [40.0, 40.0]))
    ]
    np.testing.assert_array_equal(*forces)


def test_rows_of_a_batch_are_independent_under_a_stepped_command(spec):
    model = with_laws(spec, lag="two_rates")
    history = replace(sine(n_time=150), command=stepped_command()[120:270], command_unit="A").history()
    rng = np.random.default_rng(4)
    theta = theta_of(model) * rng.uniform(0.8, 1.2, (37, len(model.parameters)))
    batch = simulate_forces(model, theta, history)
    alone = np.vstack([simulate_forces(model, row[None], history).force for row in theta])
    np.testing.assert_array_equal(batch.force.view(np.uint64), alone.view(np.uint64))


def test_parameters_stay_admissible_at_any_command(spec):
    name = followed(spec)[0]
    model = spec.with_current_laws({name: "linear"})
    index = model.names.index(f"{name}.1")
    theta = model.nominal
    theta[index] = -10.0 * spec.nominal[spec.names.index(name)]
    at_one = parameters_at(model, theta, 1.0)
    assert getattr(at_one, name) == next(p.lower for p in spec.plain if p.name == name)


def test_a_command_in_the_other_unit_and_laws_that_are_none_are_refused(spec):
    name = followed(spec)[0]
    model = spec.with_current_laws({name: "linear"}, unit="V")
    other = replace(sine(), command=1.0, command_unit="A")
    refusal(simulate_force, model, model.nominal, other, match="its command in V, the loading's is in A")
    refusal(simulate_force, model, model.nominal, sine(), match="no stated unit")
    refusal(spec.with_current_laws, {"nothing": "linear"}, match="no parameter 'nothing'")
    refusal(model.with_current_laws, {}, match="has current laws already")


def test_named_laws_are_those_of_the_core_in_the_order_of_their_degree():
    assert [(str(law), law.n_coefficients, law.degree) for law in named_dependences()] == _rust.current_laws()


def test_a_law_is_a_special_case_of_those_that_contain_it():
    raised = {
        str(law): [str(other) for other in named_dependences() if law.is_special_case_of(other)]
        for law in named_dependences()
    }
    assert raised == {
        "constant": ["linear", "quadratic", "cubic", "exponential"],
        "linear": ["quadratic", "cubic"],
        "quadratic": ["cubic"],
        "cubic": [],
        "exponential": [],
    }


def test_a_coefficient_names_its_parameter_and_number() -> None:
    model = damper("dahl").with_current_laws({"k_w": "quadratic", "rho": "exponential"}, lag="one_rate")
    places = [
        (each.coefficient.parameter, each.coefficient.number) for each in model.parameters if each.coefficient
    ]
    assert places == [("k_w", 0), ("k_w", 1), ("k_w", 2), ("rho", 0), ("rho", 1), ("rho", 2)]
    assert [each.name for each in model.parameters if each.coefficient and each.coefficient.is_rate] == [
        "rho.2"
    ]
    assert [each.plain_name for each in model.parameters if each.coefficient is None] == ["f0", "eta"]
    assert [each.plain_name for each in model.parameters if each.scales_with_force] == ["k_w"] * 3 + ["f0"]
