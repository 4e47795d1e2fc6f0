"""The predictive rollout in C: the commands of the core, whatever its model and its timing."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from c_programs import compiled, library, output_of
from loop_samples import LAG, devices, five_storeys, rd1005, sweep
from test_controller_c import DRIVER, hostile

import mrwork as mr
from mrwork import Building, Device, _rust
from mrwork.closed_loop import Hardware
from mrwork.closed_loop.printed_loop import PrintedLoop, printed_loop
from mrwork.control import ControlLaw, DesignProblem, design_law
from mrwork.embedded.c_source import CSource, Flavour
from mrwork.embedded.controller_c import controller_source

OBSERVED = Hardware(feedback="observer", known_ground=True)
YIELDS = mr.buildings.with_storeys_that_yield(five_storeys(), yield_drift=5e-3, post_yield_ratio=0.05)


def hysteretic() -> tuple[mr.DamperSpec, np.ndarray[tuple[int, ...], np.dtype[np.float64]]]:
    """A Bouc-Wen loop of 230 N that the command raises, behind a lag."""
    spec = mr.damper("bouc_wen").with_current_laws({"alpha": "linear", "c0": "linear"}, lagged=True)
    return spec, np.array([700.0, 900.0, 800.0, 0.0, 3e4, 4e4, 1e6, 1e6, 120.0, 2.0, LAG])


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


def printed(
    frame: Building, loop: list[Device], hardware: Hardware, law: ControlLaw, flavour: Flavour | None = None
) -> tuple[PrintedLoop, CSource]:
    places = {
        "floor": frame.floor_names,
        "storey": frame.storey_names,
        "device": [each.name for each in loop],
    }
    core = printed_loop(frame, loop, law, hardware)
    return core, controller_source("law", core, law, places, flavour or Flavour(), unit="A")


# The second device is not commanded.
HOLDS = [devices(rd1005())[0], replace(devices(rd1005())[1], command=0.5)]
# Delays of no, a part of a, one, and more than one sample, with steps of the model that differ from them.
CASES = {
    "elastic": (five_storeys(), devices(rd1005()), OBSERVED, {"force_correction": 0.5}),
    "state": (
        five_storeys(),
        devices(rd1005(lagged=False), second=False),
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
    given = dict(_rust.law_readings(core))
    # From good readings into holes, huge numbers and a sensor that sticks.
    readings = hostile(given)[np.r_[1300:1700, 2100:2400]].copy()
    wanted = _rust.law_commands(core, readings)[:, : core.n_commanded]
    names = [f"{signal}[{entry}]" for signal, count in given.items() for entry in range(count)]
    read = np.ascontiguousarray(readings[:, [names.index(each.name) for each in source.inputs]])
    functions = library(
        tmp_path, {name: source.files[name] for name in ("law.h", "law.c")} | {"drive.c": DRIVER}
    )
    wanted = np.ascontiguousarray(wanted)
    command = np.empty_like(wanted)
    ends = read.ctypes.data_as(ctypes.c_void_p), command.ctypes.data_as(ctypes.c_void_p)
    functions.drive(len(read), read.shape[1], core.n_commanded, 1, *ends)
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
    _, source = printed(frame, loop, hardware, law)
    program = compiled(tmp_path, {name: text for name, text in source.files.items() if "check" not in name})
    outside = mr.closed_loop.ProcessLaw(
        name="law",
        program=[str(program)],
        readings=["acceleration", "ground_acceleration", "deformation", "force"],
    )
    mine, own = (
        mr.simulate_loop(frame, loop, each, [sweep(0.3)], hardware, histories=True).histories[0]
        for each in (outside, law)
    )
    np.testing.assert_array_equal(mine.command, own.command)
    assert len(np.unique(own.command)) > 3


@pytest.mark.filterwarnings("ignore:.*observer")
def test_its_program_checks_it(tmp_path: Path) -> None:
    loop = devices(rd1005())
    law = rollout(YIELDS, loop, OBSERVED, model="building")
    _, source = printed(YIELDS, loop, OBSERVED, law)
    assert "It decides every 10 samples: its model then takes 880 steps" in source.notes[-1]
    files = {name: text for name, text in source.files.items() if "process" not in name}
    sanitized = "-fsanitize=undefined,address", "-fno-sanitize-recover"
    assert output_of(compiled(tmp_path, files, *sanitized)).startswith("0 of 2000")
