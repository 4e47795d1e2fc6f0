"""`mr.jax.loop`: the results of the core for every law and damper, and derivatives in all of its inputs."""

from dataclasses import replace
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import own_dampers
import own_laws
import pytest
from loop_samples import LAG, five_storeys, rd1005
from refusals import refusal

import mrwork as mr
from mrwork.closed_loop import Fault, LoopSample, UserLaw
from mrwork.closed_loop.simulate import LoopVariation
from mrwork.jax.traced_loop import _simulate
from mrwork.twins.model_twins import EQUATIONS

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

FRAME = mr.buildings.shear_building(
    name="frame", masses=[500.0, 400.0], stiffnesses=[4e5, 3e5], heights=[3.0, 2.5]
)
MOTION = mr.synthetic_motion(rng=0, duration=0.8, peak=3.0)
LATE = mr.Hardware(sample_time=2e-3, step=1e-3, delay=3e-3, command_rate=200.0)
TABLE = 1.0 + np.sin(np.arange(400) / 9.0)[:, None]
GAIN, WEIGHT = [[3e4, -4e4, -2e4, 1.5e4]], [[3e-4, -1e-4, -1e-3, 2e-4]]
CURVE = mr.damper("static_hysteretic").preset("kwok2006")
# Numbers of networks that have learned nothing, for signals in SI units.
NETWORK = np.random.default_rng(7).normal(size=(1, 25))
NETWORK[:, :-1].reshape(1, 4, 6)[:, :, 1:-1] /= [2e-3, 0.05, 500.0, 500.0]
LAWS: dict[str, mr.ControlLaw | Floats] = {
    "passive": mr.ControlLaw(name="passive", gains={"command": [0.7]}),
    "proportional_direct": mr.ControlLaw(
        name="proportional_direct",
        gains={"weight": WEIGHT, "slope": [300.0]},
        curve=(CURVE.spec, CURVE.theta),
    ),
    "signal_network": mr.ControlLaw(name="signal_network", gains={"gain": GAIN, "network": NETWORK}),
    "clipped_optimal": mr.ControlLaw(name="clipped_optimal", gains={"gain": GAIN}, dead_zone=1e-3),
    "modified_clipped_optimal": mr.ControlLaw(
        name="modified_clipped_optimal", gains={"gain": GAIN, "full_force": [2000.0]}
    ),
    "lyapunov": mr.ControlLaw(name="lyapunov", gains={"weight": WEIGHT}, command_slope=100.0),
    "a table": TABLE,
}


def placed(spec: mr.DamperSpec, **changes: Any) -> mr.Device:
    """A damper in the first storey with nominal parameters, of which the first follows the command behind a lag.

    Its current falls slower than it rises.
    """
    first = next(each.name for each in spec.parameters if each.name not in ("f0", "x0"))
    lagged = spec.with_current_laws({first: "linear"}, lag="two_rates")
    nominal = dict(zip(spec.names, spec.nominal, strict=True))
    nominal |= {"eta_fall": 0.3 * LAG} | {
        f"{first}.0": 0.6 * nominal[first],
        f"{first}.1": 0.3 * nominal[first],
    }
    theta = [nominal.get(name, LAG) for name in lagged.names]
    given = {
        "name": "damper",
        "spec": lagged,
        "theta": theta,
        "row": FRAME.storeys[0],
        "largest_command": 2.0,
    }
    return mr.Device(**given | changes)


def by_core(
    devices: list[mr.Device], law: mr.ControlLaw | Floats, building: mr.Building = FRAME
) -> mr.Responses:
    """A table of commands is a law in Python."""

    def command(sample: LoopSample, memory: Floats) -> Floats:
        return TABLE[[round(sample.time / LATE.sample_time)]]

    own = law if isinstance(law, mr.ControlLaw) else UserLaw(name="table", command=command)
    return mr.simulate_loop(building, devices, own, [MOTION], LATE, histories=True)


def assert_as_in_the_core(
    devices: list[mr.Device], law: mr.ControlLaw | Floats, building: mr.Building = FRAME
) -> None:
    """To 1e-11 of the largest of each quantity and signal."""
    expected = by_core(devices, law, building)
    found = mr.jax.loop(building, devices, law, MOTION, LATE, steps=int(expected.steps[0]))()
    for name, numbers in expected.numbers.items():
        if np.isfinite(numbers).all() and numbers.size and name != "energy_error":
            largest = np.abs(numbers).max()
            np.testing.assert_allclose(
                found.numbers[name], numbers[0], rtol=0.0, atol=1e-11 * largest, err_msg=name
            )
    for name, signals in found.history.items():
        kept = expected.histories[0].numbers[name].reshape(signals.shape)
        np.testing.assert_allclose(signals, kept, rtol=0.0, atol=1e-11 * np.abs(kept).max(), err_msg=name)


@pytest.mark.parametrize("law", list(LAWS))
def test_every_law_is_that_of_the_core(law: str) -> None:
    """With a damper of the package, of which two act in opposition."""
    assert_as_in_the_core([placed(mr.damper("normalised_bouc_wen"), differential=True, count=1.5)], LAWS[law])


@pytest.mark.parametrize(("number", "model"), [*enumerate(EQUATIONS)], ids=list(EQUATIONS))
@pytest.mark.long
def test_every_damper_is_that_of_the_core(number: int, model: str) -> None:
    """Each under another law."""
    assert_as_in_the_core([placed(mr.damper(model))], [*LAWS.values()][number % len(LAWS)])


def test_a_damper_of_the_user_and_a_building_of_modes() -> None:
    modal = mr.buildings.modal_truncation(five_storeys(), n_modes=3)
    damper = placed(own_dampers.loop, row=modal.storeys[0])
    assert_as_in_the_core([damper], LAWS["passive"], modal)


def test_dampers_of_several_models_stand_side_by_side() -> None:
    """Without a force of its own, the second leaves the first alone."""
    first, second = placed(mr.damper("bingham")), placed(own_dampers.guo, row=FRAME.storeys[1])
    none = replace(second, count=1e-30)
    both = mr.jax.loop(FRAME, [first, none], TABLE.repeat(2, axis=1), MOTION, LATE, steps=4)()
    alone = mr.jax.loop(FRAME, [first], TABLE, MOTION, LATE, steps=4)()
    np.testing.assert_allclose(both.history["drift"], alone.history["drift"], rtol=1e-12, atol=1e-15)


@cache
def smooth() -> tuple[mr.Building, mr.Device, mr.ControlLaw]:
    """The five storeys with a pair of RD-1005-3 behind its lag, under a law that does not switch."""
    frame, (spec, theta) = five_storeys(), rd1005()
    damper = mr.Device(
        name="pair", spec=spec, theta=theta, row=frame.storeys[0], largest_command=1.88, differential=True
    )
    law = mr.ControlLaw(
        name="proportional_direct",
        gains={"weight": 1e-3 * np.random.default_rng(1).standard_normal((1, 10)), "slope": [2.0]},
        curve=(CURVE.spec, CURVE.theta),
    )
    return frame, damper, law


@cache
def differentiable() -> mr.jax.Loop:
    frame, damper, law = smooth()
    return mr.jax.loop(frame, [damper], law, MOTION, LATE)


def rms_and_end(inputs: mr.jax.LoopInputs) -> jax.Array:
    found = differentiable()(inputs)
    return found.numbers["rms_drift"][0] + found.history["displacement"][-1].sum()


def test_slopes_in_gains_are_those_of_the_core() -> None:
    """Along the gains themselves."""
    loop, (frame, damper, law) = differentiable(), smooth()
    changes = law.gain_rows(1, 10)
    along = LoopVariation(buildings=(frame,), delay=np.zeros(1), seed=np.zeros(1, int), changes=changes)
    (slopes,) = mr.simulate_loop(frame, [damper], law, [MOTION], LATE, variation=along).slopes
    expected = slopes["rms_drift"][0, 0]
    assert abs(expected) > 1e-8

    def rms(gains: dict[str, jax.Array]) -> jax.Array:
        return loop(loop.inputs._replace(gains=gains)).numbers["rms_drift"][0]

    gradient = jax.grad(rms)(loop.inputs.gains)
    found = sum(float(np.sum(slope * loop.inputs.gains[name])) for name, slope in gradient.items())
    assert found == pytest.approx(expected, rel=1e-10)


@pytest.mark.long
def test_slopes_in_all_inputs_are_differences() -> None:
    """Those in reverse mode, against differences of the loop along a direction of each input."""
    inputs = differentiable().inputs
    slopes = jax.grad(rms_and_end)(inputs)
    rng = np.random.default_rng(2)
    for name in ("gains", "theta", "mass", "damping", "stiffness", "acceleration"):
        leaves, shape = jax.tree.flatten(getattr(inputs, name))
        change = [each * rng.standard_normal(np.shape(each)) for each in leaves]
        expected, step = 0.0, 1e-5
        for sign in (1.0, -1.0):
            moved = [each + sign * step * by for each, by in zip(leaves, change, strict=True)]
            value = rms_and_end(inputs._replace(**{name: shape.unflatten(moved)}))
            expected += sign / (2.0 * step) * float(value)
        slope = jax.tree.leaves(getattr(slopes, name))
        found = sum(float(np.sum(each * by)) for each, by in zip(slope, change, strict=True))
        assert found != 0.0
        assert found == pytest.approx(expected, rel=1e-5), name


def test_motions_of_about_one_length_share_a_program() -> None:
    damper = placed(mr.damper("bingham"))
    counts = []
    for seconds in (0.8, 0.95, 0.7):
        motion = mr.synthetic_motion(rng=1, duration=seconds, peak=3.0)
        mr.jax.loop(FRAME, [damper], LAWS["passive"], motion, LATE, steps=4)()
        counts.append(_simulate._cache_size())
    assert counts == counts[:1] * 3


# As sensors of a loop of two storeys read them.
SENSED = replace(LATE, measured_storeys=(1, 0))


@cache
def two_storeys() -> tuple[mr.Building, list[mr.Device]]:
    """Five storeys with two pairs behind their lags."""
    frame, (spec, theta) = five_storeys(), rd1005()
    pairs = [
        mr.Device(
            name=f"pair {k}",
            spec=spec,
            theta=theta,
            row=frame.storeys[k],
            largest_command=1.88,
            differential=True,
        )
        for k in (0, 2)
    ]
    return frame, pairs


@pytest.mark.parametrize("law", own_laws.LAWS)
@pytest.mark.parametrize("dt", [1e-3, 4e-4], ids=["", "finer than a step"])
def test_a_law_of_the_user_is_that_of_the_core(law: str, dt: float) -> None:
    """With memory, settings, delay, a limit of the rate and the lag of drivers; its loss is that of the core."""
    (frame, pairs), given = two_storeys(), own_laws.LAWS[law]()
    motion = mr.synthetic_motion(rng=0, duration=0.6, peak=3.0, dt=dt)
    expected = mr.simulate_loop(frame, pairs, given, [motion], SENSED, histories=True)
    loop = mr.jax.loop(frame, pairs, given, motion, SENSED, steps=int(expected.steps[0]))
    found = loop()
    for name, signals in found.history.items():
        kept = expected.histories[0].numbers[name].reshape(signals.shape)
        np.testing.assert_allclose(signals, kept, rtol=0.0, atol=1e-11 * np.abs(kept).max(), err_msg=name)
    for name in ("rms_drift", "peak_acceleration"):
        np.testing.assert_allclose(found.numbers[name], expected.numbers[name][0], rtol=1e-11)


def test_a_law_may_read_ground_time_and_state() -> None:
    def every(sample: Any, memory: Any, settings: Any) -> Any:
        shaken = sample.ground_acceleration + 5.0 * sample.ground_velocity + sample.state @ settings.row
        memory.seen = 0.9 * memory.seen + shaken * np.cos(4.0 * sample.time)
        return sample.largest * np.abs(np.tanh(memory.seen + sample.deformation[0] * 50.0))

    frame, pairs = two_storeys()
    row = np.linspace(-3.0, 3.0, 10).reshape(10)
    given = mr.own_law(every, memory={"seen": 0.1}, settings={"row": ("1", -5.0, row, 5.0)})
    for dt in (1e-3, 4e-4):
        motion = mr.synthetic_motion(rng=3, duration=0.6, peak=3.0, dt=dt)
        expected = mr.simulate_loop(frame, pairs, given, [motion], LATE, histories=True)
        found = mr.jax.loop(frame, pairs, given, motion, LATE, steps=int(expected.steps[0]))()
        kept = expected.histories[0].numbers["command"].reshape(found.history["command"].shape)
        assert kept.std() > 0.1
        np.testing.assert_allclose(found.history["command"], kept, rtol=0.0, atol=1e-11)


@pytest.mark.long
def test_slopes_in_settings_are_differences_of_the_core() -> None:
    """Of a network of 369 numbers behind a delay and a lag, along two directions, by differences of fourth order."""
    frame, pairs = two_storeys()
    given, motion = own_laws.learned_network(), mr.synthetic_motion(rng=1, duration=1.0, peak=2.0)
    hardware = mr.Hardware(sample_time=2e-3, step=1e-3, delay=3e-3)
    loop = mr.jax.loop(frame, pairs, given, motion, hardware)

    def loss(weights: jax.Array) -> jax.Array:
        found = loop(loop.inputs._replace(gains={"numbers": weights}), histories=False).numbers
        return (found["rms_drift"] ** 2).sum() * 1e6

    def of_core(weights: Floats) -> float:
        run = mr.simulate_loop(frame, pairs, replace(given, gains={"numbers": weights}), [motion], hardware)
        assert run.steps[0] == loop.steps
        return float((run.numbers["rms_drift"] ** 2).sum() * 1e6)

    weights = np.array(given.gains["numbers"])
    assert weights.shape == (369,)
    value, slope = jax.value_and_grad(loss)(jnp.array(weights))
    assert float(value) == pytest.approx(of_core(weights), rel=1e-12)
    for seed in (0, 1):
        along, h = np.random.default_rng(seed).normal(size=weights.size), 1e-4
        ends = [of_core(weights + step * h * along) for step in (-2.0, -1.0, 1.0, 2.0)]
        expected = (ends[0] - 8.0 * ends[1] + 8.0 * ends[2] - ends[3]) / (12.0 * h)
        assert abs(expected) > 1e-2
        assert float(slope @ along) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"law": mr.own_law(lambda sample, *_: max(0.0, sample.rate[0]))}, r"cannot be recorded.*np\.maximum"),
        ({"law": mr.ControlLaw(name="fuzzy", gains={"deformation_scale": [1.0], "rate_scale": [1.0]},
                               tables={"shares": np.ones(4)})}, "the law fuzzy"),
        ({"hardware": mr.Hardware(feedback="observer")}, "an observer"),
        ({"hardware": mr.Hardware(faults=(Fault(channel="force"),))}, "faults"),
        ({"building": mr.buildings.with_friction_damper(FRAME, storey=1, slip_load=100.0, stiffness=1e5)}, "passive"),
        ({"law": np.zeros((10, 2))}, r"\(n_samples, 1\)"),
        ({"steps": 3}, "multiple of 2"),
    ],
)  # fmt: skip
def test_what_the_loop_does_not_have_is_said(changes: dict[str, Any], words: str) -> None:
    given = {
        "building": FRAME,
        "devices": [placed(mr.damper("bingham"))],
        "law": LAWS["passive"],
        "motion": MOTION,
    }
    refusal(mr.jax.loop, **given | changes, match=words)
