"""Peaks under `inverse_direct` are those of a loop in NumPy that tries 48 currents at every sample."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

import mrwork as mr
from mrwork.closed_loop import Hardware, simulate_loop
from mrwork.control import DesignProblem, design_law

LARGEST, RATE, N_CURRENTS = 1.88, 190.0, 48
SAMPLE_TIME, STEPS = 1e-3, 2
RD1005 = {
    "c": (1232.0, 1929.0),
    "k": (5100.0, -1700.0),
    "alpha": (32.0, 918.0, -244.0),
    "beta": (100.0,),
    "delta": (0.58, 0.30),
    "x_s": (1e-4,),
    "f0": (57.0, -18.0),
}
# Only parameters inside the tanh follow the current: the force saturates early, and no parabola has this shape.
INSIDE = RD1005 | {
    "c": (1232.0,),
    "k": (5100.0,),
    "alpha": (700.0,),
    "beta": (0.5, 10.0, 100.0),
    "delta": (0.0, 0.3, 1.0),
}
DAMPERS = {"RD-1005": RD1005, "current inside the tanh": INSIDE}
LAWS = ("constant", "linear", "quadratic")


def force(values: Mapping[str, tuple[float, ...]], x: float, v: float, current: np.ndarray) -> np.ndarray:
    """Force of the pair in opposition at many currents; its offset cancels."""
    p = {name: np.polynomial.polynomial.polyval(current, laws) for name, laws in values.items()}
    return np.asarray(
        2.0
        * (p["c"] * v + p["k"] * x + p["alpha"] * np.tanh(p["beta"] * v + p["delta"] * np.tanh(x / p["x_s"])))
    )


def ground(time: np.ndarray) -> np.ndarray:
    return np.asarray(2.5 * np.sin(np.pi * time / 4.0) * np.sin(2.0 * np.pi * (1.0 + 0.6 * time) * time))


def brute_force(
    building: mr.buildings.Building, gain: np.ndarray, values: Mapping[str, tuple[float, ...]]
) -> dict[str, np.ndarray]:
    """Peaks of drift and absolute acceleration; classical Runge-Kutta, ground straight between samples of 10 ms."""
    n, row = building.n_coordinates, building.storeys[0]
    inverse = np.linalg.inv(building.mass)
    A = np.block(
        [[np.zeros((n, n)), np.eye(n)], [-inverse @ building.stiffness, -inverse @ building.damping]]
    )
    B, E = np.concatenate([np.zeros(n), -inverse @ row]), np.concatenate([np.zeros(n), -building.influence])
    knots = 0.01 * np.arange(401)
    h = SAMPLE_TIME / STEPS
    currents = np.linspace(0.0, LARGEST, N_CURRENTS)
    state, peaks = np.zeros(2 * n + 1), {"drift": np.zeros(n), "acceleration": np.zeros(n)}

    def rate(time: float, y: np.ndarray, command: float) -> np.ndarray:
        s, i = y[:-1], y[-1]
        pull = force(values, row @ s[:n], row @ s[n:], np.array(i))
        a_g = np.interp(time, knots, ground(knots))
        return np.append(A @ s + B * pull + E * a_g, -RATE * (i - command))

    for sample in range(4000):
        s = state[:-1]
        error = force(values, row @ s[:n], row @ s[n:], currents) + gain @ s
        command = currents[np.abs(error).argmin()]
        for step in range(STEPS):
            t = sample * SAMPLE_TIME + step * h
            k1 = rate(t, state, command)
            k2 = rate(t + 0.5 * h, state + 0.5 * h * k1, command)
            k3 = rate(t + 0.5 * h, state + 0.5 * h * k2, command)
            k4 = rate(t + h, state + h * k3, command)
            state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            relative = rate(t + h, state, command)[n : 2 * n]
            absolute = relative + building.influence * np.interp(t + h, knots, ground(knots))
            peaks["drift"] = np.maximum(peaks["drift"], np.abs(building.storeys @ state[:n]))
            peaks["acceleration"] = np.maximum(peaks["acceleration"], np.abs(absolute))
    return peaks


def peak_errors(name: str, *laws: str) -> list[float]:
    """Largest relative difference of the peaks under each law from those of trying many currents."""
    values, frame = DAMPERS[name], mr.building("uts")
    spec = mr.damper("static_hysteretic").with_current_laws(
        {each: LAWS[len(numbers) - 1] for each, numbers in values.items()}, lagged=True
    )
    theta = np.array([number for numbers in values.values() for number in numbers] + [RATE])
    pair = mr.Device(
        name="pair", spec=spec, theta=theta, row=frame.storeys[0], largest_command=LARGEST, differential=True
    )
    problem = DesignProblem(building=frame, devices=[pair], sample_time=SAMPLE_TIME)
    motion = mr.motions.GroundMotion(name="sweep", dt=0.01, acceleration=ground(0.01 * np.arange(401)))
    hardware = Hardware(sample_time=SAMPLE_TIME, step=SAMPLE_TIME / STEPS)
    designed = [design_law(law, problem, {"drifts": 1.0, "control_weight": 3e-12}) for law in laws]
    expected = brute_force(frame, np.asarray(designed[0].gains["gain"])[0], values)
    errors = []
    for law in designed:
        found = simulate_loop(frame, [pair], law, [motion], hardware)
        ratios = [
            found.peak_drift[0] / expected["drift"],
            found.peak_acceleration[0] / expected["acceleration"],
        ]
        errors.append(float(np.abs(np.concatenate(ratios) - 1.0).max()))
    return errors


def test_peaks_are_those_of_trying_many_currents() -> None:
    (error,) = peak_errors("RD-1005", "inverse_direct")
    assert error < 5e-3


def test_a_current_inside_the_tanh_is_inverted_too_and_the_parabola_does_not() -> None:
    error, parabola = peak_errors("current inside the tanh", "inverse_direct", "inverse_parabola")
    assert error < 5e-3
    assert parabola > 1e-2
