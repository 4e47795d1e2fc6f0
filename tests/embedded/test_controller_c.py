"""Printed controllers: the commands of the core to the bit, also from readings that no sensor gives."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from c_programs import compiled, library, output_of
from loop_samples import devices, five_storeys, law_with_gains, rd1005, sweep
from refusals import refusal

import mrwork as mr
from mrwork.closed_loop.printed_loop import PrintedLoop, printed_loop
from mrwork.embedded.c_source import CSource, Flavour
from mrwork.embedded.controller_c import controller_source, readings_of_check

LAWS = [law.name for law in mr.control.control_laws()]
OBSERVED = mr.Hardware(feedback="observer", known_ground=True, command_rate=200.0)


def law_of(name: str) -> mr.ControlLaw:
    return law_with_gains(name, mr.control.plant_of(five_storeys(), [each.row for each in devices(rd1005())]))


def loop_of(name: str, hardware: mr.Hardware = OBSERVED, law: mr.ControlLaw | None = None) -> PrintedLoop:
    return printed_loop(five_storeys(), devices(rd1005()), law or law_of(name), hardware)


def printed(
    name: str, loop: PrintedLoop, flavour: Flavour | None = None, *, law: mr.ControlLaw | None = None
) -> CSource:
    frame = five_storeys()
    storeys = [frame.storey_names[storey] for storey in loop.hardware.measured_storeys]
    places = {"floor": frame.floor_names, "storey": storeys, "device": ["pair", "two"]}
    return controller_source("law", loop, law or law_of(name), places, flavour or Flavour(), unit="A")


def hostile(given: dict[str, int]) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Readings of which the second half has holes, infinities, huge numbers and a sensor that sticks."""
    rng = np.random.default_rng(5)
    readings = np.resize(readings_of_check(given), (3000, sum(given.values()))).copy()
    odd = rng.random((1500, readings.shape[1])) > 0.99
    values = np.array([np.nan, np.inf, -np.inf, 1e300, -1e300, -0.0, 5e-324])
    readings[1500:][odd] = rng.choice(values, odd.sum())
    readings[2200:2600, -1] = readings[2200, -1]
    return readings


DRIVER = """
#include "law.h"
#include <math.h>
#include <string.h>
int drive(int n, int width, int devices, int trusts, const double *readings, double *command) {
    static law_memory m;
    law_start(&m);
    double *limits = (double *)&m.limits;
    for (unsigned i = 0; trusts && i < sizeof m.limits / sizeof *limits; ++i) limits[i] = INFINITY;
    for (int i = 0; i < n; ++i) {
        law_input in;
        memcpy(&in, readings + (long)i * width, sizeof in);
        law_step(&m, &law_designed, &in, command + (long)i * devices);
    }
    return (int)m.replaced;
}
"""


@pytest.mark.parametrize("feedback", ["observer", "state"])
@pytest.mark.parametrize("name", LAWS)
def test_a_printed_law_sends_the_commands_of_the_core_whatever_sensors_give(
    name: str, feedback: str, tmp_path: Path
) -> None:
    law = law_of(name)
    hardware = OBSERVED if feedback == "observer" else mr.Hardware(command_rate=200.0)
    loop = loop_of(name, hardware, law)
    source = printed(name, loop, law=law)
    given = dict(mr._rust.law_readings(loop))
    readings = hostile(given)
    wanted = mr._rust.law_commands(loop, readings)[:, : loop.n_commanded]
    names = [f"{signal}[{entry}]" for signal, count in given.items() for entry in range(count)]
    read = np.ascontiguousarray(readings[:, [names.index(each.name) for each in source.inputs]])
    files = {each: text for each, text in source.files.items() if each in ("law.c", "law.h")} | {
        "drive.c": DRIVER
    }
    functions, command = library(tmp_path, files), np.empty_like(wanted)
    ends = read.ctypes.data_as(ctypes.c_void_p), command.ctypes.data_as(ctypes.c_void_p)
    functions.drive(len(read), read.shape[1], loop.n_commanded, 1, *ends)
    np.testing.assert_array_equal(command, wanted)
    most = np.inf if law.spec.commands_force else devices(rd1005())[0].largest_command
    assert np.isfinite(command).all()
    assert np.abs(command).max() <= most
    # With limits, what no sensor gives is replaced, and counted.
    replaced = functions.drive(len(read), read.shape[1], loop.n_commanded, 0, *ends)
    assert replaced == np.count_nonzero(~(np.abs(read) < 1e200)) or not read.size
    assert np.isfinite(command).all()


@pytest.mark.parametrize("single", [False, True])
def test_its_program_checks_it(single: bool, tmp_path: Path) -> None:
    flavour = Flavour(single=single)
    law = law_of("proportional_direct" if single else "inverse_direct")
    source = printed(law.name, loop_of(law.name, law=law), flavour, law=law)
    files = {name: text for name, text in source.files.items() if "process" not in name}
    sanitized = "-fsanitize=undefined,address", "-fno-sanitize-recover"
    differ = output_of(compiled(tmp_path, files, *sanitized)).split()[0]
    assert (differ == "0") is not single


@pytest.mark.parametrize("name", ["modified_clipped_optimal", "inverse_direct"])
def test_as_a_process_it_sends_the_commands_of_the_law_in_the_loop(name: str, tmp_path: Path) -> None:
    law, motion = law_of(name), sweep(0.5)
    hardware = replace(OBSERVED, acceleration_noise=0.01, force_noise=1.0, delay=2e-3)
    source = printed(name, loop_of(name, hardware, law), law=law)
    program = compiled(tmp_path, {each: text for each, text in source.files.items() if "check" not in each})
    outside = mr.closed_loop.ProcessLaw(
        name="law",
        program=[str(program)],
        readings=["acceleration", "ground_acceleration", "deformation", "force"],
    )
    mine, own = (
        mr.simulate_loop(
            five_storeys(), devices(rd1005()), each, [motion], hardware, histories=True
        ).histories[0]
        for each in (outside, law)
    )
    np.testing.assert_array_equal(mine.command, own.command)
    assert np.ptp(own.command) > 0.5


def test_a_name_of_the_user_ends_no_comment(tmp_path: Path) -> None:
    law, names = law_of("inverse_direct"), ["roof */ int x; /*\nground"] * 5
    places = {"floor": names, "storey": names, "device": names}
    loop, name = loop_of(law.name, law=law), "a */ title"
    source = controller_source("law", loop, law, places, Flavour(), unit="A", origin=(name,))
    files = {each: text for each, text in source.files.items() if "process" not in each}
    assert output_of(compiled(tmp_path, files)).startswith("0 of 2000")


def test_what_no_rig_has_is_refused() -> None:
    stuck = mr.closed_loop.Fault(channel="force", index=0, start=1.0, end=2.0, value=0.0)
    refusal(loop_of, "passive", mr.Hardware(faults=(stuck,)), match="faults are of a simulation")
    refusal(loop_of, "passive", mr.Hardware(ground_preview=0.1), match="no sensor tells the ground ahead")
