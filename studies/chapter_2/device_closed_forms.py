"""What the loop finds for a device, beside what its textbook says."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from typing import Any

import numpy as np
from scipy.linalg import solve_continuous_lyapunov
from scipy.optimize import minimize

import mrwork as mr
from mrwork.buildings import Building, PassiveElement
from mrwork.closed_loop import Responses
from studies.former.frame import actuator, idle

_STIFFNESS, _MASS = 4e6, 100.0
_SHARP = 50.0
# Frequency of slow cycles [Hz], far below the 32 Hz of the storey.
_SLOW = 0.1


ClosedForm = dict[str, Any]
"""A figure of the loop and that of a formula, the relative deviation of the loop from it, and what the formula says."""


def _beside(loop: float, formula: float, says: str) -> ClosedForm:
    return {"loop": loop, "formula": formula, "deviation": loop / formula - 1.0, "says": says}


def closed_forms() -> dict[str, ClosedForm]:
    """Every comparison by its name."""
    return {
        **{f"friction damper, X = {ratio:g} x_s": _friction_cycle(ratio) for ratio in (2.0, 5.0, 20.0)},
        **{f"yielding damper, X = {ratio:g} x_y": _yielding_cycle(ratio) for ratio in (2.0, 5.0, 20.0)},
        "slip load that bounds resonance": _bounding_slip_load(),
        "loss of head": _head_loss_cycle(),
        **_column_optimum(),
    }


def _storey() -> Building:
    return mr.buildings.shear_building(
        name="storey", masses=[_MASS], stiffnesses=[_STIFFNESS], storey_damping=[2e3]
    )


def _friction_cycle(ratio: float) -> ClosedForm:
    slip, brace = 50.0, 1e5
    frame = mr.buildings.with_friction_damper(
        _storey(), storey=1, slip_load=slip, stiffness=brace, sharpness=_SHARP
    )
    amplitude = ratio * slip / brace
    loop = _damping_ratio(frame, amplitude)
    formula = 2.0 * slip * (amplitude - slip / brace) / (pi * _STIFFNESS * amplitude**2)
    return _beside(loop, formula, "2 F_s (X - x_s) / (pi k X^2)")


def _yielding_cycle(ratio: float) -> ClosedForm:
    force, displacement, share = 60.0, 5e-4, 0.1
    frame = mr.buildings.with_yielding_damper(
        _storey(),
        storey=1,
        yield_force=force,
        yield_displacement=displacement,
        post_yield_ratio=share,
        sharpness=_SHARP,
    )
    amplitude = ratio * displacement
    loop = _damping_ratio(frame, amplitude)
    formula = 2.0 * force * (1.0 - share) * (amplitude - displacement) / (pi * _STIFFNESS * amplitude**2)
    return _beside(loop, formula, "2 (1 - r) F_y (X - x_y) / (pi k X^2)")


def _damping_ratio(frame: Building, amplitude: float) -> float:
    """Energy of the third of three slow cycles, over 4 pi times the strain energy of the storey."""
    energies = [_taken(frame, amplitude, cycles) for cycles in (2, 3)]
    return (energies[1] - energies[0]) / (4.0 * pi * 0.5 * _STIFFNESS * amplitude**2)


def _taken(frame: Building, amplitude: float, cycles: int) -> float:
    push = frame.stiffness[0, 0] / frame.mass[0, 0] * amplitude
    motion = _sine(push, _SLOW, cycles / _SLOW)
    return float(_run_alone(frame, motion).element_energy[0, 0])


def _bounding_slip_load() -> ClosedForm:
    """Least friction that bounds the resonance of an undamped mass: pi / 4 of the amplitude of the push."""
    push, stiffness = 100.0, _MASS * (2.0 * pi) ** 2

    def is_bounded(load: float) -> bool:
        frame = mr.buildings.with_friction_damper(
            mr.buildings.shear_building(name="mass", masses=[_MASS], stiffnesses=[stiffness]),
            storey=1,
            slip_load=load * push,
            stiffness=20.0 * stiffness,
        )
        drifts = [
            _run_alone(frame, _sine(push / _MASS, 1.0, cycles)).peak_drift[0, 0] for cycles in (30.0, 60.0)
        ]
        return bool(drifts[1] < 1.05 * drifts[0])

    lower, upper = 0.6, 1.0
    while upper - lower > 0.01:
        middle = 0.5 * (lower + upper)
        lower, upper = (lower, middle) if is_bounded(middle) else (middle, upper)
    return _beside(upper, pi / 4.0, "F_s = (pi / 4) m a_g (Den Hartog)")


def _head_loss_cycle() -> ClosedForm:
    """Energy of a cycle of a loss of head, over 4 pi times the strain energy of the storey."""
    loss, amplitude = 1e7, 8e-3
    frame = _storey()
    element = PassiveElement(name="orifice", row=frame.storeys[0], head_loss=loss)
    formula = 8.0 / 3.0 * loss * (2.0 * pi * _SLOW) ** 2 * amplitude**3
    return _beside(
        _damping_ratio(replace(frame, elements=(element,)), amplitude),
        formula / (4.0 * pi * 0.5 * _STIFFNESS * amplitude**2),
        "4 d omega^2 X / (3 pi k)",
    )


def _column_optimum() -> dict[str, ClosedForm]:
    """Frequency and damping ratio with the least mean square displacement under a white force."""
    mass_ratio, width_ratio = 0.02, 0.7
    published = mr.buildings.liquid_column_optimum(mass_ratio, width_ratio)
    one = mr.buildings.shear_building(name="one", masses=[1.0], stiffnesses=[(2.0 * pi) ** 2])

    def mean_square(at: np.ndarray) -> float:
        column = mr.buildings.with_liquid_column(
            one, floor=1, mass=mass_ratio, frequency=at[0], width_ratio=width_ratio, head_loss=0.0
        )
        damping = np.diag([0.0, 2.0 * at[1] * mass_ratio * 2.0 * pi * at[0]])
        A, _, _ = replace(column, damping=damping).state_matrices()
        push = np.concatenate([np.zeros(2), np.linalg.solve(column.mass, [1.0, 0.0])])
        return float(solve_continuous_lyapunov(A, -np.outer(push, push))[0, 0])

    found = minimize(
        mean_square, [1.0, 0.05], method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-12}
    ).x
    names = ("liquid column, best frequency ratio", "liquid column, best damping ratio")
    return {
        name: _beside(float(loop), formula, "Yalla, Kareem (2000)")
        for name, loop, formula in zip(names, found, published, strict=True)
    }


def _run_alone(building: Building, motion: mr.GroundMotion) -> Responses:
    """A building with its passive elements alone."""
    return mr.simulate_loop(building, [actuator(building.storeys[0])], idle(building), [motion], threads=1)


def _sine(amplitude: float, frequency: float, duration: float) -> mr.GroundMotion:
    dt = 0.01
    time = dt * np.arange(round(duration / dt) + 1)
    acceleration = -amplitude * np.sin(2.0 * pi * frequency * time)
    return mr.GroundMotion(name="sine", dt=dt, acceleration=acceleration)
