"""A law in Python runs in the loop of every law: the same bits, in a batch as alone; its errors are sentences."""

import numpy as np
import pytest
from loop_samples import devices, five_storeys, friction, rd1005, still, sweep
from refusals import refusal

import mrwork as mr
from mrwork.closed_loop import Fault, Hardware, LoopSample, Responses, UserLaw
from mrwork.control import lyapunov_function, plant_of
from mrwork.dampers.simulation import Outcome

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
CASES = {
    "plain": Hardware(),
    "observer with noise and delay": Hardware(
        feedback="observer", acceleration_noise=0.01, force_noise=1.0, delay=2e-3, command_rate=100.0
    ),
}


def run(law: mr.ControlLaw | UserLaw, hardware: Hardware | None = None, **settings: int) -> Responses:
    loop = devices(rd1005(), second=True)
    return mr.simulate_loop(five_storeys(), loop, law, [sweep(0.5), sweep(0.7)], hardware, **settings)


def friction_law(n_candidates: int = 1) -> UserLaw:
    """A command in proportion to the rate, which differs by candidate."""

    def command(sample: LoopSample, memory: Floats) -> Floats:
        return (1.0 + sample.candidate[:, None]) * np.abs(sample.rate)

    return UserLaw(name="friction", command=command, n_candidates=n_candidates)


@pytest.mark.parametrize("hardware", CASES.values(), ids=CASES)
def test_the_formula_of_a_law_gives_its_bits(hardware: Hardware) -> None:
    """Maximum energy dissipation, which has no sums: the largest command where force and rate have one sign."""

    def command(sample: LoopSample, memory: Floats) -> Floats:
        return np.where(sample.force * sample.rate > 0.0, sample.largest, 0.0)

    ours = run(mr.ControlLaw(name="maximum_energy_dissipation"), hardware)
    users = run(UserLaw(name="dissipation", command=command), hardware)
    for quantity in ("peak_drift", "rms_acceleration", "mean_current", "device_energy"):
        np.testing.assert_array_equal(getattr(users, quantity), getattr(ours, quantity))


def test_a_law_of_the_state_is_that_of_the_registry() -> None:
    loop = devices(rd1005(), second=True)
    plant = plant_of(five_storeys(), np.array([device.row for device in loop]))
    weight = lyapunov_function(plant).vectors

    def command(sample: LoopSample, memory: Floats) -> Floats:
        return np.where((sample.state @ weight.T) * sample.force < 0.0, sample.largest, 0.0)

    # The sums are of another order, so that rare switches may come a sample earlier or later.
    ours = run(mr.ControlLaw(name="lyapunov", gains={"weight": weight}))
    users = run(UserLaw(name="lyapunov", command=command))
    np.testing.assert_allclose(users.peak_drift, ours.peak_drift, rtol=1e-3)


def test_candidates_in_a_batch_are_those_alone() -> None:
    many = run(friction_law(40))
    assert many.shape == (40, 2, 1)
    alone = run(friction_law(1))
    np.testing.assert_array_equal(many.peak_drift[:2], alone.peak_drift)
    assert np.unique(many.mean_current[::2, 0]).size == 40


def test_memory_is_of_a_run_and_begins_at_zero() -> None:
    """Counted samples ramp the command up, also where a stiff damper repeats the run with a shorter step."""

    def command(sample: LoopSample, memory: Floats) -> Floats:
        np.testing.assert_allclose(memory, round(sample.time / 1e-3))
        memory += 1.0
        return np.minimum(1e-3 * memory, sample.largest)

    law = UserLaw(name="ramp", command=command, n_memory=1)
    for model in (rd1005(), friction()):
        loop = devices(model, second=False)
        found = mr.simulate_loop(five_storeys(), loop, law, [still(1.0)], histories=True)
        ramp = 1e-3 * np.arange(1, len(found.histories[0].time))
        np.testing.assert_allclose(found.histories[0].command[:, 0], [*ramp, ramp[-1]])


def test_a_command_that_is_no_number_fails_safe_where_a_reading_is_none() -> None:
    broken = Fault(channel="deformation", index=0, start=0.2, end=0.3, value=np.nan)
    sensors = Hardware(feedback="observer", measured_floors=(0,), faults=(broken,))
    law = UserLaw(name="of the reading", command=lambda sample, memory: np.abs(sample.deformation))
    found = run(law, sensors)
    assert set(found.outcome) == {Outcome.FAILED_SAFE}


def test_a_law_that_makes_no_number_of_numbers_is_named_with_its_line() -> None:
    def broken(sample: LoopSample, memory: Floats) -> Floats:
        command = np.zeros_like(sample.rate)
        if sample.time > 0.1:
            command[:, 1] = np.nan
        return command

    words = r"^broken \(.*test_user_law.py, line \d+\) .* \(NaN\) for device 2 at 0\.101 s"
    refusal(run, UserLaw(name="broken", command=broken), match=words)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (lambda sample, memory: np.zeros(3), r"shape \(3,\) at 0 s; give \(1, 2\)"),
        (
            lambda sample, memory: sample.speed,
            r"failed at 0 s in .*test_user_law.py, line \d+: AttributeError",
        ),
        (lambda sample, memory: None, "None; give an array"),
    ],
)
def test_a_mistake_in_a_law_is_told_with_its_place(command: object, words: str) -> None:
    refusal(run, UserLaw(name="mine", command=command), match=rf"^mine.*{words}")


def test_ctrl_c_in_a_law_ends_the_run() -> None:
    def command(sample: LoopSample, memory: Floats) -> Floats:
        if sample.time > 0.1:
            raise KeyboardInterrupt
        return np.zeros_like(sample.rate)

    with pytest.raises(KeyboardInterrupt):
        run(UserLaw(name="stopped", command=command))


def test_a_law_for_dampers_that_follow_none_is_refused() -> None:
    spec = mr.damper("dahl")
    dahl = mr.Device(
        name="dahl", spec=spec, theta=spec.nominal, row=five_storeys().storeys[0], largest_command=1.0
    )
    refusal(mr.simulate_loop, five_storeys(), [dahl], friction_law(), [still(0.1)], match="have no effect")
