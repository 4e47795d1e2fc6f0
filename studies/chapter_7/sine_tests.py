"""Sine tests with a constant current: response amplitudes, and the damper's force over its motion.

A steady displacement is a Fourier series, fitted to the noisy samples of ten cycles. Its derivative is the velocity; a
difference of samples would have noise as large as the velocity at which the damper's friction changes sign.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import mrwork as mr
from mrwork.records import DamperTest, build_damper_test
from studies.chapter_7.virtual_rig import SENSORS, TABLE, Rig, Sensors, Signals, recorded, signals_of
from studies.former.arrays import Floats
from studies.former.scores import constant_commands

SWEEP = (1.5, 2.0, 2.5, 2.75, 3.0, 3.25, 3.5, 4.0, 5.0)
"""Frequencies of the sine tests at the currents of the chapter [Hz]."""
SWEEP_CURRENTS = (0.0, 0.25)
"""Currents of the chapter [A]."""
SWEEP_PEAK = 2.0
"""Of the table in the sine tests of the chapter [m/s^2]."""
PEAKS = {0.0: 2.0, 0.125: 2.0, 0.25: 2.0, 0.375: 3.0, 0.5: 3.5}
"""Of the table in the tests for identification [m/s^2], by current [A]: more current takes more to move the frame."""
IDENTIFIED_AT = (2.0, 3.0, 4.0)
"""Frequencies of the tests for identification [Hz]."""
SMALL_PEAKS = {0.25: 0.8, 0.5: 1.6}
"""Of tests at 3 Hz in which the damper nearly holds the frame [m/s^2], by current [A]."""
_RAMP, _SETTLE, _CYCLES = 2.0, 3.0, 10
HARMONICS = 25
"""Of the Fourier series of the displacement."""
# Of the 1 kHz of the sensors, and how many cycles: more says little that is new.
_EVERY, _TEST_CYCLES = 2, 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """A sine test: constant current [A], frequency [Hz] and peak acceleration of the table [m/s^2]."""

    current: float
    frequency: float
    peak: float

    @property
    def name(self) -> str:
        return f"{self.frequency:g} Hz, {self.peak:g} m/s2, {self.current:g} A"


def sweep(*, quick: bool) -> list[Wanted]:
    """The sine tests of the chapter."""
    return [
        Wanted(current=current, frequency=frequency, peak=SWEEP_PEAK)
        for current in SWEEP_CURRENTS
        for frequency in (SWEEP[::4] if quick else SWEEP)
    ]


def between(tests: list[Wanted]) -> list[Wanted]:
    """The tests, and others halfway between those of neighbouring frequencies."""
    return [
        replace(each, frequency=frequency)
        for each, after in zip(tests, [*tests[1:], None], strict=True)
        for frequency in (
            (each.frequency,)
            if after is None or after.current != each.current
            else (each.frequency, 0.5 * (each.frequency + after.frequency))
        )
    ]


def for_identification(*, quick: bool) -> list[Wanted]:
    """The sine tests from which the damper is identified."""
    currents = (0.0, 0.25, 0.5) if quick else PEAKS
    return [
        Wanted(current=current, frequency=frequency, peak=PEAKS[current])
        for current in currents
        for frequency in (IDENTIFIED_AT[1:2] if quick else IDENTIFIED_AT)
    ] + [Wanted(current=current, frequency=3.0, peak=peak) for current, peak in SMALL_PEAKS.items()]


@dataclass(frozen=True, slots=True, kw_only=True)
class SineTest:
    """A steady sine test: the sensors' record of its cycles, and amplitudes [m, m/s^2] of the first harmonic.

    `residual` [m] is what the Fourier series leaves of the displacement, rms.
    """

    wanted: Wanted
    record: Signals
    series: Floats
    displacement: float
    acceleration: float
    residual: float


def sine_command(frequency: float, peak: float) -> mr.GroundMotion:
    """A sine of the table's displacement that grows over two seconds, so that the table stays about its middle."""
    dt, omega = 1e-3, 2.0 * np.pi * frequency
    time = dt * np.arange(round((_RAMP + _SETTLE + _CYCLES / frequency) / dt) + 1)
    w = np.pi / _RAMP
    rising = time < _RAMP
    ramp = np.where(rising, 0.5 * (1.0 - np.cos(w * time)), 1.0)
    slope = np.where(rising, 0.5 * w * np.sin(w * time), 0.0)
    bend = np.where(rising, 0.5 * w**2 * np.cos(w * time), 0.0)
    sine, cosine = np.sin(omega * time), np.cos(omega * time)
    acceleration = -peak / omega**2 * (bend * sine + 2.0 * slope * omega * cosine - ramp * omega**2 * sine)
    return mr.GroundMotion(
        name=f"sine of {frequency:g} Hz", dt=dt, acceleration=acceleration, source="computed"
    )


def sine_tests(
    rig: Rig,
    wanted: list[Wanted],
    rng: np.random.Generator | None,
    *,
    sensors: Sensors = SENSORS,
    threads: int,
) -> list[SineTest]:
    """The tests as the sensors record them; without a generator, the signals as they are."""
    found = []
    for current in sorted({each.current for each in wanted}):
        alike = [each for each in wanted if each.current == current]
        motions = [TABLE.driven(sine_command(each.frequency, each.peak)) for each in alike]
        law = constant_commands(current)
        for each, signals in zip(alike, signals_of(rig, law, motions, threads=threads), strict=True):
            found.append(_evaluated(signals if rng is None else recorded(signals, rng, sensors), each))
    return found


def _evaluated(signals: Signals, wanted: Wanted) -> SineTest:
    steady = signals.last(round(_CYCLES / wanted.frequency / signals.step))
    shapes = _shapes(steady.time, wanted.frequency)
    series = np.linalg.lstsq(shapes, steady.displacement)[0]
    acceleration = np.linalg.lstsq(shapes, steady.acceleration)[0]
    return SineTest(
        wanted=wanted,
        record=steady,
        series=series,
        displacement=float(np.hypot(*series[1:3])),
        acceleration=float(np.hypot(*acceleration[1:3])),
        residual=float(np.std(steady.displacement - shapes @ series)),
    )


def _shapes(time: Floats, frequency: float, harmonics: int = HARMONICS) -> Floats:
    """One, then sine and cosine of each harmonic, shape (n_time, 1 + 2 harmonics)."""
    angles = 2.0 * np.pi * frequency * np.outer(time, np.arange(1, harmonics + 1))
    pairs = np.stack([np.sin(angles), np.cos(angles)], axis=2).reshape(time.size, -1)
    return np.column_stack([np.ones(time.size), pairs])


def damper_test(test: SineTest, harmonics: int = HARMONICS) -> DamperTest:
    """Force of the load cell over the motion of the first harmonics of the Fourier series, three cycles."""
    frequency = test.wanted.frequency
    part = test.record.last(round(_TEST_CYCLES / frequency / test.record.step))
    time = part.time[::_EVERY]
    rates = np.repeat(2.0 * np.pi * frequency * np.arange(1, harmonics + 1), 2)
    shapes, series = _shapes(time, frequency, harmonics), test.series[: 1 + 2 * harmonics]
    # The derivative of each sine is a cosine with the rate of its harmonic, of each cosine a negative sine.
    turned = shapes[:, 1:].reshape(time.size, -1, 2)[:, :, ::-1] * [1.0, -1.0]
    return build_damper_test(
        name=test.wanted.name,
        time=time - time[0],
        displacement=shapes @ series,
        velocity=(turned.reshape(time.size, -1) * rates) @ series[1:],
        force=part.force[::_EVERY],
        current=test.wanted.current,
        amplitude=test.displacement,
        frequency=frequency,
        synthetic=True,
        path=f"virtual:{test.wanted.name}",
    )


def figures_of(measured: list[SineTest], predicted: list[SineTest]) -> dict[str, Any]:
    """For each current the highest response, the residual of the series, and amplitudes beside those predicted."""
    by_test = {test.wanted: test for test in predicted}
    found: dict[str, Any] = {}
    for current in sorted({test.wanted.current for test in measured}):
        alike = [test for test in measured if test.wanted.current == current]
        top = max(alike, key=lambda test: test.displacement)
        found[f"{current:g} A"] = {
            "peak_frequency_hz": top.wanted.frequency,
            "peak_displacement_mm": 1e3 * top.displacement,
            "residual_um": 1e6 * max(test.residual for test in alike),
            "amplitudes": {
                f"{test.wanted.frequency:g} Hz": {
                    "displacement_mm": 1e3 * test.displacement,
                    "predicted_mm": 1e3 * by_test[test.wanted].displacement,
                    "acceleration": test.acceleration,
                    "predicted_acceleration": by_test[test.wanted].acceleration,
                }
                for test in alike
            },
        }
    return found
