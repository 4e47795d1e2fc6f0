"""Controllers outside Python: one in C that is compiled with the numbers of a loop, and one in Python to be spoilt."""

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import mrwork as mr
from mrwork.closed_loop import Hardware
from mrwork.closed_loop.observer import loop_observer

COMPILER = shutil.which("cc")
compiled = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler")
CONTROLLER = """
import struct, sys, time
def numbers(count):
    read = sys.stdin.buffer.read(8 * count)
    return struct.unpack(f"<{count}d", read) if len(read) == 8 * count else sys.exit(0)
def write(*values):
    sys.stdout.buffer.write(struct.pack(f"<{len(values)}d", *values))
    sys.stdout.buffer.flush()
kept = 0.0
while True:
    message, sample, now, missed, rate = numbers(5)
    kept += 1.0
"""
"""The loop of a controller of the rate, without an answer."""
RIGHT = "    write(message, 10.0 * abs(rate))"
"""The answer in proportion to the rate."""


def _c_array(name: str, values: np.ndarray) -> str:
    size = "".join(f"[{count}]" for count in values.shape)
    kind, text = ("int", str) if values.dtype.kind == "i" else ("double", float.hex)
    return f"static const {kind} {name}{size} = {{{', '.join(map(text, values.flat))}}};"


def build(
    folder: Path, frame: mr.Building, loop: Sequence[mr.Device], law: mr.ControlLaw, hardware: Hardware
) -> Path:
    """The controller of a clipped-optimal law in C, with an observer of its own where the hardware has one."""
    observes, floors = hardware.feedback == "observer", len(frame.floors)
    numbers = {
        "OBSERVER": observes,
        "N_DEVICES": len(loop),
        "N_STATES": 2 * frame.n_coordinates,
        "N_FLOORS": floors,
    }
    numbers["MODIFIED"] = "full_force" in law.gains
    arrays = {"gain_k": np.reshape(law.gains["gain"], (len(loop), -1))}
    arrays["largest"] = np.array([device.largest_command for device in loop])
    if numbers["MODIFIED"]:
        arrays["full_force"] = np.ravel(law.gains["full_force"])
    if observes:
        observer = loop_observer(frame, loop, hardware)
        measured = range(floors) if hardware.measured_floors is None else hardware.measured_floors
        numbers |= {"N_ACCELERATIONS": len(measured), "N_DRIFTS": len(hardware.measured_storeys)}
        numbers |= {"N_MEASURED": len(observer.C), "KNOWN_GROUND": hardware.observes_ground}
        arrays |= {
            "transition": observer.Ad,
            "input": observer.Bd,
            "output": observer.C,
            "direct": observer.D,
        }
        arrays |= {"gain_l": observer.gain, "moved": observer.Ed, "direct_ground": observer.G}
        arrays["measured_floors"] = np.array(measured)
    lines = [f"#define {name} {int(value)}" for name, value in numbers.items()]
    lines += [_c_array(name, values) for name, values in arrays.items()]
    # Rows of matrices without braces of their own are C, too, but for a warning.
    (folder / "design.h").write_text("\n".join(lines) + "\n")
    program = folder / "controller"
    flags = [
        "-std=c99",
        "-O2",
        "-Wall",
        "-Wextra",
        "-Wno-missing-braces",
        "-Werror",
        "-pedantic",
        "-ffp-contract=off",
    ]
    command = [
        COMPILER,
        *flags,
        "-I",
        folder,
        Path(__file__).with_name("clipped_optimal.c"),
        "-lm",
        "-o",
        program,
    ]
    subprocess.run(list(map(str, command)), check=True)
    return program
