"""Printed code on a board: compiled as others compile, words of status, states that are healed, missed samples."""

import ctypes
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from c_programs import STRICT, library
from loop_samples import devices, five_storeys, law_with_gains, rd1005
from printed_laws import printed

import mrwork as mr
from mrwork.closed_loop.printed_loop import printed_loop
from mrwork.dampers.tested_range import OperatingRange
from mrwork.embedded.c_source import CSource, Flavour
from mrwork.embedded.controller_c import controller_source, readings_of_check
from mrwork.embedded.damper_c import damper_source

TESTED = OperatingRange(
    stroke=0.01, velocity=0.08, frequency=None, command=(0.0, 1.2), command_unit="A", force=1e3, power=1.0
)
HARDWARE = mr.Hardware(feedback="observer", known_ground=True, command_rate=50.0)
RATE_LIMITED, HEALED, MISSED, REFUSED, ACCELERATION = 2, 8, 16, 32, 256

_DRIVER = """
#include "law.h"
static law_memory m;
static law_parameters gains;
void begin(int queue) { law_start(&m); m.queue = queue; gains = law_designed; }
void gain(double value) { ((double *)&gains)[0] = value; }
void spoil(double value) { m.state[0] = value; }
unsigned step(unsigned missed, const double *read, double *command) {
    law_input in;
    for (unsigned i = 0; i < sizeof in / sizeof(double); ++i) ((double *)&in)[i] = read[i];
    law_miss(&m, missed);
    law_step(&m, &gains, &in, command);
    return m.status;
}
double state(void) { return m.state[0]; }
double age(int reading) { return (double)m.age[reading]; }
unsigned long healed(void) { return m.healed; }
"""


def damper() -> CSource:
    spec = mr.damper("normalised_bouc_wen")
    return damper_source("code", spec, np.array(spec.nominal), TESTED, Flavour(), sample_time=1e-3)


def law_of(name: str) -> tuple[mr.ControlLaw, list[mr.Device]]:
    loop = devices(rd1005())
    return law_with_gains(name, mr.control.plant_of(five_storeys(), [each.row for each in loop])), loop


class PrintedLaw:
    """A printed controller of five storeys with an observer, and readings for it, shape (n_samples, n_readings)."""

    def __init__(self, folder: Path, name: str = "clipped_optimal") -> None:
        law, loop = law_of(name)
        core, source = printed(five_storeys(), loop, HARDWARE, law)
        files = {each: source.files[each] for each in ("law.h", "law.c")} | {"drive.c": _DRIVER}
        self.library = library(folder, files)
        self.library.spoil.argtypes = self.library.gain.argtypes = [ctypes.c_double]
        self.library.state.restype = self.library.age.restype = ctypes.c_double
        self.n_devices = core.n_commanded
        given = mr._rust.law_readings(core)
        names = [f"{signal}[{entry}]" for signal, count in given for entry in range(count)]
        places = [names.index(each.name) for each in source.inputs]
        self.readings = np.ascontiguousarray(readings_of_check(dict(given))[:, places])

    def step(self, row: np.ndarray, missed: int = 0) -> tuple[np.ndarray, int]:
        command = np.empty(self.n_devices)
        read = np.ascontiguousarray(row)
        status = self.library.step(
            missed, *(each.ctypes.data_as(ctypes.c_void_p) for each in (read, command))
        )
        return command, status


@pytest.mark.parametrize("kind", ["damper", "controller"])
def test_printed_code_compiles_as_others_compile(kind: str, tmp_path: Path) -> None:
    if shutil.which("g++") is None:
        pytest.skip("there is no g++ to compile printed C")
    law, loop = law_of("clipped_optimal")
    source = damper() if kind == "damper" else printed(five_storeys(), loop, HARDWARE, law)[1]
    name = source.name
    for file, text in source.files.items():
        (tmp_path / file).write_text(text)

    def made(*command: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)

    strict = made("gcc", *STRICT, "-Wshadow", "-Wconversion", "-Wno-error=conversion", "-c", f"{name}.c")
    assert strict.returncode == 0, strict.stderr
    for option in ("-ffast-math", "-Ofast", "-ffinite-math-only"):
        refused = made("gcc", "-std=c99", option, "-c", f"{name}.c", "-o", "fast.o")
        assert refused.returncode
        assert "compile without it" in refused.stderr
    (tmp_path / "main.cpp").write_text(
        f'#include "{name}.h"\nint main() {{ static {name}_memory m; '
        + (f"{name}_start(&m, &{name}_fitted, 0.0);" if kind == "damper" else f"{name}_start(&m);")
        + " return static_cast<int>(m.status); }\n"
    )
    linked = made("g++", "-Wall", "-Wextra", "-Werror", "main.cpp", f"{name}.o", "-lm", "-o", "main")
    assert linked.returncode == 0, linked.stderr
    assert subprocess.run([tmp_path / "main"]).returncode == 0


@pytest.mark.parametrize("target", ["run", "run-arm"])
@pytest.mark.parametrize("name", ["clipped_optimal", "passive"])
def test_the_example_runs_through_dead_sensors_and_missed_samples_and_ends_at_zero(
    target: str, name: str, tmp_path: Path
) -> None:
    needed = ["make", "cc"] if target == "run" else ["make", "arm-none-eabi-gcc", "qemu-system-arm"]
    if missing := [each for each in needed if shutil.which(each) is None]:
        pytest.skip(f"there is no {missing[0]} for the example")
    law, loop = law_of(name)
    core = printed_loop(five_storeys(), loop, law, HARDWARE)
    places = {"floor": [*"abcde"], "storey": [*"abcde"], "device": [*"ab"]}
    source = controller_source("law", core, law, places, Flavour(), unit="A", example=True)
    for file, text in source.files.items():
        (tmp_path / file).write_text(text)
    ran = subprocess.run(["make", target], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "warning" not in ran.stderr
    said = re.search(
        r"4003 samples, 12 missed, (\d+) readings replaced, status seen (\S+), largest command (\S+), last (\S+)",
        ran.stdout,
    )
    assert said, ran.stdout
    replaced, status, largest, last = int(said[1]), int(said[2], 16), float(said[3]), float(said[4])
    assert status & MISSED
    # Samples 2001 to 2199, of which the first two were missed.
    assert replaced == (197 if status & ACCELERATION else 0)
    assert 0.0 <= last < 1e-2 * largest <= 0.02


def test_a_reading_that_is_replaced_is_named_and_has_an_age(tmp_path: Path) -> None:
    law = PrintedLaw(tmp_path)
    law.library.begin(0)
    for sample, row in enumerate(law.readings[:60]):
        spoiled = row.copy()
        if 20 <= sample < 50:
            spoiled[1] = np.nan
        _, status = law.step(spoiled)
        assert (status & ACCELERATION != 0) == (20 <= sample < 50)
        assert law.library.age(1) == (sample - 19 if 20 <= sample < 50 else 0)
        assert law.library.age(0) == 0


def test_a_command_that_its_rate_holds_back_is_said(tmp_path: Path) -> None:
    law = PrintedLaw(tmp_path)
    law.library.begin(0)
    sent = np.array([(*command, status) for command, status in map(law.step, law.readings)])
    changed = np.abs(np.diff(sent[:, :-1], axis=0)).max(axis=1) >= 0.9995 * 50.0 * HARDWARE.sample_time
    said = sent[1:, -1].astype(int) & RATE_LIMITED != 0
    assert said.any()
    assert np.all(changed <= said)


def test_an_estimate_that_is_no_number_is_healed_and_counted(tmp_path: Path) -> None:
    law = PrintedLaw(tmp_path)
    law.library.begin(0)
    for value in (np.nan, np.inf):
        law.library.spoil(value)
        command, status = law.step(law.readings[0])
        assert status & HEALED
        assert np.isfinite(command).all()
        assert np.isfinite(law.library.state())
        assert not law.step(law.readings[1])[1] & HEALED
    assert law.library.healed() == 2


def test_gains_that_are_no_numbers_are_refused(tmp_path: Path) -> None:
    commands = []
    law = PrintedLaw(tmp_path)
    for wrong in (False, True):
        law.library.begin(0)
        if wrong:
            law.library.gain(np.nan)
        commands.append([law.step(row) for row in law.readings[:50]])
    for (right, status), (found, refused) in zip(*commands, strict=True):
        np.testing.assert_array_equal(found, right)
        assert refused == status | REFUSED


def test_missed_samples_let_the_estimate_go_on(tmp_path: Path) -> None:
    """As if the readings before had come again, with the command that was sent."""
    law = PrintedLaw(tmp_path)
    states = []
    for missed in (0, 4):
        law.library.begin(0)
        for row in law.readings[:100]:
            law.step(row)
        if not missed:
            for _ in range(4):
                law.step(law.readings[99])
        _, status = law.step(law.readings[104], missed)
        assert (status & MISSED != 0) == (missed > 0)
        states.append(law.library.state())
    assert states[1] == pytest.approx(states[0], rel=0.02)


def test_a_queue_hands_commands_out_later_and_is_set_in_one_place(tmp_path: Path) -> None:
    law = PrintedLaw(tmp_path)
    sent = []
    for queue in (0, 3):
        law.library.begin(queue)
        sent.append(np.array([law.step(row)[0] for row in law.readings[:300]]))
    np.testing.assert_array_equal(sent[1][3:], sent[0][:-3])
    assert np.ptp(sent[0]) > 0.1
