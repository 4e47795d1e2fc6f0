"""Printed controllers, driven by readings and as processes in the loop."""

import ctypes
from collections.abc import Callable
from pathlib import Path

import numpy as np
from c_programs import compiled, library
from loop_samples import Floats, sweep

import mrwork as mr
from mrwork.closed_loop.printed_loop import PrintedLoop, printed_loop
from mrwork.embedded.c_source import CSource, Flavour
from mrwork.embedded.controller_c import controller_source, readings_of_check

SANITIZED = "-fsanitize=undefined,address", "-fno-sanitize-recover"


def printed(
    frame: mr.Building,
    loop: list[mr.Device],
    hardware: mr.Hardware,
    law: mr.ControlLaw,
    flavour: Flavour | None = None,
) -> tuple[PrintedLoop, CSource]:
    storeys = [frame.storey_names[storey] for storey in hardware.measured_storeys]
    places = {"floor": frame.floor_names, "storey": storeys, "device": [each.name for each in loop]}
    core = printed_loop(frame, loop, law, hardware)
    return core, controller_source("law", core, law, places, flavour or Flavour(), unit="A")


def hostile(core: PrintedLoop) -> Floats:
    """Readings of which the second half has holes, infinities, huge numbers and a sensor that sticks."""
    given = dict(mr._rust.law_readings(core))
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


def driven(
    folder: Path, core: PrintedLoop, source: CSource, readings: Floats
) -> tuple[Floats, Callable[[bool], tuple[Floats, int]]]:
    """What the printed law reads; and its commands with the count of what it replaced, trusting its sensors or not."""
    given = mr._rust.law_readings(core)
    names = [f"{signal}[{entry}]" for signal, count in given for entry in range(count)]
    read = np.ascontiguousarray(readings[:, [names.index(each.name) for each in source.inputs]])
    functions = library(
        folder, {name: source.files[name] for name in ("law.h", "law.c")} | {"drive.c": DRIVER}
    )

    def commands(trusts: bool) -> tuple[Floats, int]:
        command = np.empty((len(read), core.n_commanded))
        ends = read.ctypes.data_as(ctypes.c_void_p), command.ctypes.data_as(ctypes.c_void_p)
        return command, functions.drive(len(read), read.shape[1], core.n_commanded, trusts, *ends)

    return read, commands


def assert_a_process_is_the_law(
    folder: Path, frame: mr.Building, loop: list[mr.Device], hardware: mr.Hardware, law: mr.ControlLaw
) -> Floats:
    """The program has the commands of the law in the loop, which are returned."""
    _, source = printed(frame, loop, hardware, law)
    program = compiled(folder, {name: text for name, text in source.files.items() if "check" not in name})
    readings = ["acceleration", "ground_acceleration", "deformation", "force"]
    outside = mr.closed_loop.ProcessLaw(name="law", program=[str(program)], readings=readings)
    mine, own = (
        mr.simulate_loop(frame, loop, each, [sweep(0.4)], hardware, histories=True).histories[0].command
        for each in (outside, law)
    )
    np.testing.assert_array_equal(mine, own)
    return own
