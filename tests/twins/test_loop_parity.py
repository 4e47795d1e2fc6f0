"""The Rust loop and its twin agree to rounding in all results of a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from loop_twin_run import run_loop
from loop_twin_samples import LAG, STEP
from twin_laws import ClippedOptimal, LyapunovBangBang, ModifiedClippedOptimal, Passive

import mrwork as mr
from mrwork import Device
from mrwork.buildings import shear_building
from mrwork.closed_loop import Hardware, simulate_loop
from mrwork.closed_loop.responses import run_quantities
from mrwork.control import ControlLaw
from mrwork.dampers import DamperSpec
from mrwork.motions import GroundMotion
from mrwork.twins.loop_laws import LyapunovDirect, SignalNetwork
from mrwork.twins.loop_stepping import LoopDevice, LoopPlant, half_steps

# Tolerance for two thousand steps with another order of summation, and powers accurate to some ulp. A switch that
# close to its threshold would give a much larger difference.
AGREEMENT = 1e-9
LARGEST = 2.0
N_STEPS = 2000

STATIC = (
    mr.damper("static_hysteretic").with_current_laws({"c": "linear", "alpha": "quadratic"}, lagged=True),
    [20.0, 10.0, 100.0, 4.0, 9.0, -1.0, 50.0, 0.5, 1e-3, 3.0, LAG],
)
LAGGED = (
    mr.damper("normalised_bouc_wen").with_current_laws({"c": "linear", "k_w": "linear"}, lagged=True),
    [10.0, 10.0, 100.0, 1e-3, 4.0, 8.0, 500.0, 0.8, 1.5, LAG],
)
PROMPT = (
    mr.damper("normalised_bouc_wen").with_current_laws({"k_w": "exponential"}, lagged=False),
    [10.0, 100.0, 1e-3, 30.0, -26.0, -0.8, 500.0, 0.8, 1.5],
)
GAIN = np.array([[10.0, -40.0, -120.0, 15.0]])
NETWORK = np.random.default_rng(3).normal(size=(1, 25))
WEIGHT = np.array([[0.3, -0.1, -1.0, 0.2]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A control law in Rust and in the twin, with a damper."""

    damper: tuple[DamperSpec, list[float]]
    rust: ControlLaw
    twin: Any
    count: float = 1.0
    differential: bool = False
    steps: int = 2
    delay: int = 0


CASES = {
    "passive": Case(
        damper=LAGGED,
        rust=ControlLaw(name="passive", gains={"command": [1.2]}),
        twin=Passive(jnp.array([1.2])),
    ),
    "clipped-optimal, late": Case(
        damper=LAGGED,
        rust=ControlLaw(name="clipped_optimal", gains={"gain": GAIN}),
        twin=ClippedOptimal(jnp.asarray(GAIN)),
        delay=3,
    ),
    "modified clipped-optimal, no lag": Case(
        damper=PROMPT,
        rust=ControlLaw(name="modified_clipped_optimal", gains={"gain": GAIN, "full_force": [30.0]}),
        twin=ModifiedClippedOptimal(jnp.asarray(GAIN), jnp.array([30.0])),
        count=1.5,
    ),
    "Lyapunov, differential pair": Case(
        damper=LAGGED,
        rust=ControlLaw(name="lyapunov", gains={"weight": WEIGHT}),
        twin=LyapunovBangBang(jnp.asarray(WEIGHT.T)),
        differential=True,
    ),
    "direct current, differential pair": Case(
        damper=STATIC,
        rust=ControlLaw(name="proportional_direct", gains={"weight": WEIGHT, "slope": [0.5]}, curve=STATIC),
        twin=LyapunovDirect(jnp.array(0.5), jnp.asarray(WEIGHT.T)),
        differential=True,
        steps=1,
    ),
    "network of signals, late": Case(
        damper=LAGGED,
        rust=ControlLaw(name="signal_network", gains={"gain": GAIN, "network": NETWORK}),
        twin=SignalNetwork(jnp.asarray(GAIN), jnp.asarray(NETWORK)),
        delay=1,
    ),
    "direct current, by a belief": Case(
        damper=LAGGED,
        rust=ControlLaw(name="proportional_direct", gains={"weight": WEIGHT, "slope": [0.5]}, curve=STATIC),
        twin=LyapunovDirect(jnp.array(0.5), jnp.asarray(WEIGHT.T)),
    ),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_rust_and_twin_keep_the_same_of_a_run(case: Case) -> None:
    building = shear_building(
        name="frame", masses=[22.7, 22.7], stiffnesses=[29.7e3, 29.7e3], heights=[3.0, 2.5]
    )
    time = 0.01 * np.arange(401)
    record = np.sin(2.0 * np.pi * (1.0 + 2.0 * time) * time)
    spec, theta = case.damper
    hardware = Hardware(sample_time=case.steps * STEP, step=STEP, delay=case.delay * STEP)
    device = Device(
        name="damper",
        spec=spec,
        theta=theta,
        row=building.storeys[0],
        largest_command=LARGEST,
        count=case.count,
        differential=case.differential,
    )
    motion = GroundMotion(name="sweep", dt=0.01, acceleration=record)
    found = simulate_loop(building, [device], case.rust, [motion], hardware)
    assert found.outcome[0] == 0
    factor = int(found.steps[0]) // hardware.steps
    twin_device = LoopDevice(
        spec=spec,
        theta=jnp.array(theta),
        row=jnp.asarray(building.storeys[0]),
        count=case.count,
        differential=case.differential,
    )
    believed = LoopDevice(
        spec=STATIC[0], theta=jnp.array(STATIC[1]), row=twin_device.row, differential=case.differential
    )
    expected = run_loop(
        LoopPlant.of(
            mass=building.mass,
            damping=building.damping,
            stiffness=building.stiffness,
            influence=building.influence,
            floors=building.floors,
            storeys=building.storeys,
            unit_drifts=building.unit_drifts,
            heights=building.heights,
        ),
        (twin_device,),
        case.twin,
        jnp.asarray(half_steps(record, 0.01, STEP / factor, N_STEPS * factor)),
        step_time=STEP / factor,
        largest_command=jnp.array([LARGEST]),
        steps_per_sample=int(found.steps[0]),
        delay=case.delay * factor,
        believed=(believed,),
    ).summary()  # fmt: skip
    assert set(expected) == {quantity.name for quantity in run_quantities()}
    for name, values in expected.items():
        if name != "energy_error":  # in Rust the largest of several balances
            np.testing.assert_allclose(
                np.atleast_1d(getattr(found, name)[0]), values, rtol=AGREEMENT, err_msg=name
            )
    assert 0.01 < found.mean_current[0, 0] < 0.99 * LARGEST
