"""A sample rig: synthetic tests of one damper under several motions and currents, as files of a rig.

It stands apart from `mrwork init`, which writes what a study needs, too, without the simulation that is loaded here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrwork.base.table import csv_text
from mrwork.dampers.parameters import LawName
from mrwork.dampers.simulation import Loading, simulate_force
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.records.rig_table import Use

# Sampling of a slow rig, and the white noise of its sensors: standard deviations.
_DT = 0.005
_SECONDS = 3.0
_DISPLACEMENT_NOISE_M = 5e-6
_FORCE_NOISE_N = 4.0
_SEED = 2006
# Polynomials in the current [A] for a damper of about 1 kN, numbers of our own; all else as published.
_LAWS = {"k_w": (300.0, 500.0, -80.0), "c": (1500.0, 1500.0)}

COLUMNS = {"time": "Running Time:s", "displacement": "Axial Displacement:mm", "force": "Axial Force:kN"}
"""Columns of the files, as the table of tests names them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RigTest:
    """A sinusoidal test at a constant current, and what it is for: amplitude [mm], frequency [Hz], current [A]."""

    amplitude: float
    frequency: float
    current: float
    use: Use

    @property
    def file(self) -> str:
        """Name of its file."""
        label = f"{self.amplitude:g}mm{self.frequency:g}Hz{self.current:g}A".replace(".", "x")
        return f"{label}.csv"

    def text(self, rng: np.random.Generator) -> str:
        """The file of the test: the damper is simulated from rest at mid-stroke, and noise is added."""
        spec, theta = _damper()
        time = _DT * np.arange(round(_SECONDS / _DT) + 1)
        omega = 2.0 * np.pi * self.frequency
        displacement = 1e-3 * self.amplitude * np.sin(omega * time)
        velocity = 1e-3 * self.amplitude * omega * np.cos(omega * time)
        loading = Loading(
            dt=_DT, displacement=displacement, velocity=velocity, command=self.current, command_unit="A"
        )
        force = simulate_force(spec, theta, loading)
        displacement = displacement + _DISPLACEMENT_NOISE_M * rng.standard_normal(time.size)
        force = force + _FORCE_NOISE_N * rng.standard_normal(time.size)
        rows = zip(time, 1e3 * displacement, 1e-3 * force, strict=True)
        names, units = zip(*(column.split(":") for column in COLUMNS.values()), strict=True)
        numbers = ([f"{t:.3f}", f"{x:.4f}", f"{f:.5f}"] for t, x, f in rows)
        return csv_text([names, [f"({unit})" for unit in units], *numbers])


def _damper() -> tuple[DamperSpec, list[float]]:
    """The damper of the rig: a model with its nominal parameters, of which some follow the current."""
    plain = damper("normalised_bouc_wen")
    nominal = dict(zip(plain.names, plain.nominal.tolist(), strict=True))
    laws: dict[str, LawName] = {"k_w": "quadratic", "c": "linear"}
    theta = [number for name in plain.names for number in _LAWS.get(name, (nominal[name],))]
    return plain.with_current_laws(laws, unit="A"), theta


def _at(amplitude: float, frequency: float, currents: Sequence[float], use: Use) -> tuple[RigTest, ...]:
    return tuple(
        RigTest(amplitude=amplitude, frequency=frequency, current=current, use=use) for current in currents
    )


TESTS = (
    *_at(10.0, 1.0, (0.0, 0.6, 1.2), "fit"),
    *_at(6.0, 2.0, (0.0, 0.6, 1.2), "fit"),
    *_at(8.0, 1.5, (0.3, 0.6, 0.9, 1.2), "calibration"),
    *_at(9.0, 1.2, (0.3, 0.9), "test"),
)
"""The tests of the rig: two motions at three currents for the fit, others for calibration and test."""


def rig_files() -> dict[str, bytes]:
    """The files of the tests by name; the same bytes in every call."""
    rng = np.random.default_rng(_SEED)
    return {test.file: test.text(rng).encode() for test in TESTS}
