"""Passive elements in the loop: independent integrators, closed forms, energy, refinement of the step."""

from collections.abc import Callable

import numpy as np
import pytest
from loop_samples import nothing, sweep
from scipy.integrate import solve_ivp

import mrwork as mr

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

FRAME = mr.building("uts")
of = mr.buildings


def yielding() -> mr.Building:
    return of.with_yielding_damper(
        FRAME, storey=1, yield_force=800.0, yield_displacement=1e-3, post_yield_ratio=0.1
    )


def isolated() -> mr.Building:
    return of.with_lead_rubber_bearings(FRAME, mass=330.0, period=1.5, yield_force=900.0, ratio=0.03)


def swaying() -> mr.Building:
    return of.with_liquid_column(FRAME, floor=5, mass=60.0, frequency=2.9, width_ratio=0.7, head_loss=4.0)


def several() -> mr.Building:
    both = of.with_friction_damper(yielding(), storey="storey 3", slip_load=300.0, stiffness=1e6)
    return of.with_lead_rubber_bearings(both, mass=330.0, period=1.0, yield_force=600.0)


# Of all kinds: `several` has three of them.
KINDS: tuple[Callable[[], mr.Building], ...] = (isolated, swaying, several)


def run(
    building: mr.Building, motion: mr.GroundMotion, *, step: float = 1e-3, factor: int = 1
) -> mr.Responses:
    """The building with an actuator that gives no force."""
    found = mr.simulate_loop(
        building, *nothing(building), [motion], mr.Hardware(step=step), histories=True, step_factor=factor
    )
    assert found.outcome[0] == mr.dampers.Outcome.FINISHED
    return found


def independent(building: mr.Building, motion: mr.GroundMotion, time: Floats) -> Floats:
    """State and loops by an adaptive integrator, over the equations as the docstring has them."""
    n, elements = building.n_coordinates, building.elements
    inverse = np.linalg.inv(building.mass)

    def rates(t: float, y: Floats) -> Floats:
        q, v, w = y[:n], y[n : 2 * n], y[2 * n :]
        resisting = building.stiffness @ q + building.damping @ v
        loops = []
        for own, element in zip(w, elements, strict=True):
            speed, power = float(element.row @ v), np.abs(own) ** (element.sharpness - 1.0)
            resisting = resisting + element.row * (
                element.head_loss * abs(speed) * speed + element.yield_force * own
            )
            rounding = 0.5 * (abs(speed) * power * own + speed * power * abs(own))
            loops.append((speed - rounding) / element.yield_displacement)
        ground = np.interp(t, motion.time, motion.acceleration)
        return np.concatenate([v, -inverse @ resisting - building.influence * ground, loops])

    start = np.zeros(2 * n + len(elements))
    found = solve_ivp(
        rates, (0.0, time[-1]), start, t_eval=time, rtol=1e-9, atol=1e-11, max_step=motion.dt, method="DOP853"
    )
    return np.asarray(found.y.T)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_a_building_with_elements_moves_as_an_independent_integrator_says(
    kind: Callable[[], mr.Building],
) -> None:
    building, motion = kind(), sweep()
    found = run(building, motion, step=2.5e-4)
    history = found.histories[0]
    expected = independent(building, motion, history.time)
    n = building.n_coordinates
    state = expected[:, : 2 * n]
    difference = np.abs(history.state - state).max(axis=0) / np.abs(state).max(axis=0)
    assert difference.max() < 2e-4
    for number, element in enumerate(building.elements):
        x, v = state[:, :n] @ element.row, state[:, n:] @ element.row
        force = (
            element.stiffness * x
            + element.damping * v
            + element.head_loss * np.abs(v) * v
            + element.yield_force * expected[:, 2 * n + number]
        )
        largest = np.abs(force).max()
        assert np.abs(history.element_force[:, number] - force).max() < 2e-3 * largest
        assert found.peak_element_force[0, number] == pytest.approx(largest, rel=2e-3)
        assert found.peak_element_stroke[0, number] == pytest.approx(np.abs(x).max(), rel=1e-3)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_energies_balance_with_the_work_on_the_elements(kind: Callable[[], mr.Building]) -> None:
    building = kind()
    coarse = run(building, sweep(), step=1e-3)
    fine = run(building, sweep(), step=1e-3, factor=4)
    assert fine.energy_error[0] < 1e-6
    assert fine.energy_error[0] < coarse.energy_error[0]
    assert (fine.element_energy[0] > 0.0).all()
    # Without their work the balance would be off by what they take up.
    lost = float(fine.element_energy[0].sum() / fine.input_energy[0])
    assert lost > 100.0 * fine.energy_error[0]


def slow_cycles(amplitude: float, building: mr.Building, cycles: int = 3) -> mr.GroundMotion:
    """Ground acceleration far below the natural frequency that moves one storey sinusoidally by an amplitude."""
    dt, frequency = 0.01, 0.1
    time = dt * np.arange(round(cycles / frequency / dt) + 1)
    push = building.stiffness[0, 0] / building.mass[0, 0] * amplitude
    return mr.GroundMotion(name="slow", dt=dt, acceleration=-push * np.sin(2.0 * np.pi * frequency * time))


def stiff_storey() -> mr.Building:
    return of.shear_building(name="stiff", masses=[100.0], stiffnesses=[4e6], storey_damping=[2e3])


@pytest.mark.parametrize("amplitude", [4e-3, 8e-3])
def test_a_friction_damper_takes_up_the_rectangle_of_its_cycle(amplitude: float) -> None:
    slip, brace = 50.0, 1e5
    frame = of.with_friction_damper(stiff_storey(), storey=1, slip_load=slip, stiffness=brace, sharpness=50.0)
    three, two = (run(frame, slow_cycles(amplitude, frame, cycles)).element_energy[0, 0] for cycles in (3, 2))
    # 4 F_s (X - F_s / k): equivalent damping 2 F_s (X - x_s) / (pi k_s X^2) of a storey of stiffness k_s.
    assert three - two == pytest.approx(4.0 * slip * (amplitude - slip / brace), rel=0.01)


def test_a_yielding_damper_takes_up_the_parallelogram_of_its_cycle() -> None:
    amplitude, force, at, ratio = 8e-3, 60.0, 1e-3, 0.1
    frame = of.with_yielding_damper(
        stiff_storey(),
        storey=1,
        yield_force=force,
        yield_displacement=at,
        post_yield_ratio=ratio,
        sharpness=50.0,
    )
    three, two = (run(frame, slow_cycles(amplitude, frame, cycles)).element_energy[0, 0] for cycles in (3, 2))
    # 4 F_y (1 - r) (X - x_y): of bilinear hysteresis (Chopra, Dynamics of Structures, 7.4).
    assert three - two == pytest.approx(4.0 * force * (1.0 - ratio) * (amplitude - at), rel=0.01)
    whole = run(frame, slow_cycles(amplitude, frame)).peak_element_force[0, 0]
    assert whole == pytest.approx(force + ratio * force / at * (amplitude - at), rel=0.01)


def test_a_liquid_column_without_losses_is_in_the_matrices() -> None:
    frame = of.with_liquid_column(FRAME, floor=5, mass=60.0, frequency=2.9, width_ratio=0.7, head_loss=0.0)
    found = run(frame, sweep())
    assert found.element_energy[0, 0] == 0.0
    assert found.energy_error[0] < 1e-8


def test_a_building_without_elements_has_no_columns_of_them() -> None:
    found = run(FRAME, sweep())
    assert found.element_energy.shape == (1, 0)
    assert found.histories[0].element_force.shape[1] == 0
