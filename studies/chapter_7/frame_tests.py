"""The frame identified by free vibration, bare and with a known mass on it: table 7.1 in form."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import mrwork as mr
from mrwork.buildings import shear_building
from mrwork.motions import ricker
from studies.chapter_7.free_vibration import ModeEstimate, fourier_peak, logarithmic_decrement
from studies.chapter_7.virtual_rig import (
    FRAME,
    NO_DAMPER,
    TABLE,
    Signals,
    recorded,
    signals_of,
    true_rig,
)
from studies.former.arrays import Floats

ADDED_MASS = 60.0
"""Of the plates that are bolted on for the second test [kg], known."""
PULSE_FREQUENCY, PULSE_PEAK = 3.0, 2.0
"""Ricker pulse that sets the frame in motion [Hz, m/s^2]: the table is back at rest after three periods."""
LENGTH = 30.0
"""Length of the decay that is evaluated [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decay:
    """A recorded decay with its two estimates."""

    record: Signals
    fourier: ModeEstimate
    decrement: ModeEstimate


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifiedFrame:
    """The frame from two decays; each number of `numbers` with its standard error, by name."""

    bare: Decay
    loaded: Decay
    numbers: dict[str, tuple[float, float]]
    frame: mr.Building


def identified_frame(rng: np.random.Generator) -> IdentifiedFrame:
    """Record and evaluate both decays.

    With k unchanged, `f^2 m = f_l^2 (m + added)`: the two frequencies and the known mass give m, and
    `k = (2 pi f)^2 m`. The errors of the two frequencies are independent.
    """
    bare, loaded = decay(0.0, rng), decay(ADDED_MASS, rng)
    f, f_error = bare.decrement.frequency, bare.decrement.frequency_error
    g, g_error = loaded.decrement.frequency, loaded.decrement.frequency_error
    mass = ADDED_MASS * g**2 / (f**2 - g**2)
    stiffness = (2.0 * np.pi * f) ** 2 * mass
    # Derivatives of the logarithms of m and of k = 4 pi^2 added f^2 g^2 / (f^2 - g^2).
    part = f**2 - g**2
    mass_error = mass * np.hypot(2.0 * f / part * f_error, 2.0 * f**2 / (g * part) * g_error)
    stiffness_error = stiffness * np.hypot(
        2.0 * g**2 / (f * part) * f_error, 2.0 * f**2 / (g * part) * g_error
    )
    zeta, zeta_error = bare.decrement.damping_ratio, bare.decrement.damping_ratio_error
    damping = 4.0 * np.pi * f * mass * zeta
    numbers = {
        "mass [kg]": (mass, mass_error),
        "frequency [Hz]": (f, f_error),
        "damping [%]": (100.0 * zeta, 100.0 * zeta_error),
        "stiffness [kN/m]": (1e-3 * stiffness, 1e-3 * stiffness_error),
        "damping coefficient [N s/m]": (damping, damping * np.hypot(zeta_error / zeta, mass_error / mass)),
    }
    frame = shear_building(
        name="identified frame",
        masses=[mass],
        stiffnesses=[stiffness],
        storey_damping=[damping],
        source="identified by free vibration",
    )
    return IdentifiedFrame(
        bare=bare,
        loaded=loaded,
        numbers={name: (float(value), float(error)) for name, (value, error) in numbers.items()},
        frame=frame,
    )


def decay(added_mass: float, rng: np.random.Generator) -> Decay:
    """The decay of the frame without a damper, from the end of the pulse."""
    frame = replace(FRAME, mass=FRAME.mass + added_mass)
    pulse = ricker(amplitude=PULSE_PEAK, frequency=PULSE_FREQUENCY)
    rest = np.zeros(round((LENGTH + 1.0) / pulse.dt))
    motion = TABLE.driven(replace(pulse, acceleration=np.concatenate((pulse.acceleration, rest))))
    (signals,) = signals_of(replace(true_rig(), frame=frame), NO_DAMPER, [motion])
    whole = recorded(signals, rng)
    # The table follows within a few of its own periods.
    first = round((pulse.duration + 5.0 / TABLE.bandwidth) / whole.step)
    record = whole.part(first, first + round(LENGTH / whole.step))
    return Decay(
        record=record,
        fourier=fourier_peak(record.displacement, dt=record.step),
        decrement=logarithmic_decrement(record.displacement, dt=record.step),
    )


def spectrum(record: Signals) -> tuple[Floats, Floats]:
    """Frequencies [Hz] and amplitudes of the displacement of a record [m s]."""
    values = record.displacement - record.displacement.mean()
    padded = 4 * values.size
    amplitude = record.step * np.abs(np.fft.rfft(values, padded))
    return np.fft.rfftfreq(padded, record.step), np.asarray(amplitude)


def truth() -> dict[str, float]:
    """The numbers of table 7.1 of the true frame."""
    mass, stiffness, damping = (float(each[0, 0]) for each in (FRAME.mass, FRAME.stiffness, FRAME.damping))
    return {
        "mass [kg]": mass,
        "frequency [Hz]": float(np.sqrt(stiffness / mass) / (2.0 * np.pi)),
        "damping [%]": 100.0 * damping / (2.0 * np.sqrt(stiffness * mass)),
        "stiffness [kN/m]": 1e-3 * stiffness,
        "damping coefficient [N s/m]": damping,
    }


def figures_of(found: IdentifiedFrame) -> dict[str, Any]:
    """Numbers of the findings: identified, standard errors, deviations from the truth, and both methods."""
    true = truth()
    return {
        "identified": {name: value for name, (value, _) in found.numbers.items()},
        "standard_error": {name: error for name, (_, error) in found.numbers.items()},
        "true": true,
        "in_errors": {name: (value - true[name]) / error for name, (value, error) in found.numbers.items()},
        "fourier": {
            "frequency [Hz]": (found.bare.fourier.frequency, found.bare.fourier.frequency_error),
            "damping [%]": (
                100.0 * found.bare.fourier.damping_ratio,
                100.0 * found.bare.fourier.damping_ratio_error,
            ),
        },
        "extremes": found.bare.decrement.n_extremes,
    }
