"""A clean test of a known damper, and the files it is written to in the record tests."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import mrwork as mr
from mrwork.records import DamperTest

Columns = dict[str, NDArray[np.float64]]

N_TIME = 400
DT = 0.005
FREQUENCY = 2.0
AMPLITUDE = 0.01


def clean_columns() -> Columns:
    """A 2 Hz sine of 10 mm through a damper of 300 N friction and 500 N s/m, with its exact velocity."""
    time = DT * np.arange(N_TIME)
    phase = 2.0 * np.pi * FREQUENCY * time
    velocity = AMPLITUDE * 2.0 * np.pi * FREQUENCY * np.cos(phase)
    return {
        "t_s": time,
        "displacement_m": AMPLITUDE * np.sin(phase),
        "velocity_mps": velocity,
        "force_n": 300.0 * np.tanh(50.0 * velocity) + 500.0 * velocity,
    }


def write_text(path: Path, columns: Mapping[str, NDArray[np.float64]], delimiter: str = ",") -> Path:
    """Write columns so that every float64 survives."""
    rows = zip(*columns.values(), strict=True)
    lines = [delimiter.join(columns), *(delimiter.join(repr(float(cell)) for cell in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def write_test(path: Path, test: DamperTest) -> Path:
    """Write the signals of a test, and its current where it has one."""
    time = test.dt * np.arange(test.n_time)
    columns = {"t_s": time, "displacement_m": test.displacement, "velocity_mps": test.velocity}
    columns["force_n"] = test.force
    if test.current is not None:
        columns["current_a"] = np.broadcast_to(test.current, time.shape)
    return write_text(path, columns)


def codes(test: DamperTest) -> list[str]:
    """Remarks of the checks, by code."""
    return [remark.code for remark in test.remarks]


def built(
    columns: Mapping[str, NDArray[np.float64]],
    current: NDArray[np.float64] | None = None,
    *,
    keep_velocity: bool = False,
) -> DamperTest:
    """The test of columns, without a file."""
    return mr.test_from_arrays(
        name="rig",
        time=columns["t_s"],
        displacement=columns["displacement_m"],
        velocity=columns.get("velocity_mps"),
        force=columns["force_n"],
        current=current,
        keep_velocity=keep_velocity,
    )


def message(test: DamperTest, code: str) -> str:
    """Text of the one remark of that code."""
    (text,) = [remark.message for remark in test.remarks if remark.code == code]
    return text
