"""The predictive rollout in C: the commands of the core, whatever its model and its timing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from c_programs import compiled, output_of
from loop_samples import devices, five_storeys, hysteretic, rd1005
from printed_laws import SANITIZED, assert_a_process_is_the_law, driven, hostile, printed

import mrwork as mr
from mrwork import Building, Device
from mrwork.closed_loop import Hardware
from mrwork.control import ControlLaw, DesignProblem, design_law

OBSERVED = Hardware(feedback="observer", known_ground=True)
YIELDS = mr.buildings.with_storeys_that_yield(five_storeys(), yield_drift=5e-3, post_yield_ratio=0.05)


def rollout(frame: Building, loop: list[Device], hardware: Hardware, **settings: object) -> ControlLaw:
    driven = [each for each in loop if each.is_commanded]
    problem = DesignProblem(
        building=frame,
        devices=driven,
        beside=loop[len(driven) :],
        sample_time=hardware.sample_time,
        delay=hardware.delay,
    )
    given = {"base": 0.4, "drift": 4e-3, "acceleration": 3.0, "horizon": 0.06, **settings}
    return design_law("predictive_rollout", problem, given)


# The second device is not commanded.
HOLDS = [devices(rd1005())[0], replace(devices(rd1005())[1], command=0.5)]
# Delays of no, a part of a, one, and more than one sample, with steps of the model that differ from them.
CASES = {
    "elastic": (five_storeys(), devices(rd1005()), OBSERVED, {"force_correction": 0.5}),
    "state": (
        five_storeys(),
        devices(rd1005(lag="none"), second=False),
        Hardware(delay=0.5e-3),
        {"order": 16},
    ),
    "states of dampers": (five_storeys(), devices(hysteretic()), replace(OBSERVED, delay=3.5e-3), {}),
    "no forecast": (five_storeys(), HOLDS, replace(OBSERVED, delay=1e-3), {"forecast": "zero"}),
    "yields": (
        YIELDS,
        devices(rd1005()),
        replace(OBSERVED, delay=1.5e-3),
        {"model": "building", "residual_weight": 1.0, "adaptation": 5.0},
    ),
    "offsets": (
        YIELDS,
        devices(hysteretic(), second=False),
        OBSERVED,
        {"model": "building", "shear_offsets": True},
    ),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.filterwarnings("ignore:.*observer")
def test_a_printed_rollout_sends_the_commands_of_the_core_whatever_sensors_give(
    case: str, tmp_path: Path
) -> None:
    frame, loop, hardware, settings = CASES[case]
    law = rollout(frame, loop, hardware, **settings)
    core, source = printed(frame, loop, hardware, law)
    # From good readings into holes, huge numbers and a sensor that sticks.
    readings = hostile(core)[np.r_[1300:1700, 2100:2400]].copy()
    wanted = mr._rust.law_commands(core, readings)[:, : core.n_commanded]
    command, _ = driven(tmp_path, core, source, readings)[1](True)
    np.testing.assert_array_equal(command, wanted)
    assert len(np.unique(wanted[:200])) > 2
    assert (command >= 0.0).all()
    assert command.max() <= loop[0].largest_command
    # Of its gains, the horizon alone is fixed.
    assert {each.name.partition("[")[0] for each in source.parameters} == law.gains.keys() - {"horizon"}


@pytest.mark.parametrize("frame", [five_storeys(), YIELDS], ids=["elastic", "yields"])
@pytest.mark.filterwarnings("ignore:.*observer")
def test_as_a_process_it_sends_the_commands_of_the_rollout_in_the_loop(
    frame: Building, tmp_path: Path
) -> None:
    loop = devices(rd1005())
    hardware = replace(OBSERVED, acceleration_noise=0.01, force_noise=1.0, delay=2.5e-3)
    law = rollout(frame, loop, hardware, model="building")
    command = assert_a_process_is_the_law(tmp_path, frame, loop, hardware, law)
    assert len(np.unique(command)) > 3


@pytest.mark.filterwarnings("ignore:.*observer")
def test_its_program_checks_it(tmp_path: Path) -> None:
    loop = devices(rd1005())
    law = rollout(YIELDS, loop, OBSERVED, model="building")
    _, source = printed(YIELDS, loop, OBSERVED, law)
    assert "It decides every 10 samples: its model then takes 880 steps" in source.notes[-1]
    files = {name: text for name, text in source.files.items() if "process" not in name}
    assert output_of(compiled(tmp_path, files, *SANITIZED)).startswith("0 of 2000")
