"""On its surface the building moves as designed, and the gains bring it there."""

import numpy as np
import pytest
from control_samples import plant
from refusals import refusal

import mrwork as mr
from mrwork.control import Plant, optimal_surface, plant_of
from mrwork.control.laws.sliding import SlidingSettings, SlidingSurface


@pytest.mark.parametrize("n_devices", [1, 2])
def test_a_force_moves_its_own_surface_alone(n_devices: int) -> None:
    system = plant(n_devices)
    surface = optimal_surface(system)
    np.testing.assert_allclose(surface.S @ system.B, np.eye(n_devices), atol=1e-9)
    np.testing.assert_allclose(surface.drift, surface.S @ system.A)
    np.testing.assert_allclose(surface.ground, surface.S @ system.E)


@pytest.mark.parametrize("n_devices", [1, 2])
def test_motion_on_the_surface_has_the_poles_of_the_design(n_devices: int) -> None:
    """Held by f = -drift s, the loop has the poles of the surface, and zero for each sigma, which stays."""
    system = plant(n_devices)
    surface = optimal_surface(system)
    closed = np.linalg.solve(system.scaling, (system.A - system.B @ surface.drift) @ system.scaling)
    poles = np.linalg.eigvals(closed)
    still = np.argsort(np.abs(poles))[:n_devices]
    assert np.abs(poles[still]).max() < 1e-6 * np.abs(poles).max()
    moving = np.delete(poles, still)
    # Sorted by frequency: a pair of conjugates, and a real pole of another size, keep their places.
    np.testing.assert_allclose(np.sort(np.abs(moving)), np.sort(np.abs(surface.poles)), rtol=1e-6)
    assert moving.real.max() < 0.0


def test_no_other_surface_has_a_lower_cost() -> None:
    """`int s'Q s dt` from the unit vectors of x_1, each started on sigma = 0."""
    system = plant()
    surface = optimal_surface(system)

    def cost(S: np.ndarray) -> float:
        closed = system.A - system.B @ (S @ system.A) / (S @ system.B)
        closed = np.linalg.solve(system.scaling, closed @ system.scaling)
        row = S @ system.scaling
        # States on the surface that differ by the direction of B alone count as one: its part along B follows from x_1.
        direction = np.linalg.solve(system.scaling, system.B)
        basis = np.linalg.svd(direction.T)[2][1:].T
        start = basis - direction @ (row @ basis) / (row @ direction)
        projector = np.eye(6) - direction @ row / (row @ direction)
        time, values = np.linalg.eig(closed)
        weights = np.linalg.solve(values, start)
        keep = np.abs(time) > 1e-6 * np.abs(time).max()
        assert np.all(time[keep].real < 0.0)
        values, weights, time = values[:, keep], weights[keep], time[keep]
        gram = (values.conj().T @ projector.T @ projector @ values) / -(time.conj()[:, None] + time)
        return float(np.real(np.trace(weights.conj().T @ gram @ weights)))

    least = cost(surface.S)
    rng = np.random.default_rng(12)
    size = np.linalg.norm(surface.S @ system.scaling)
    for _ in range(10):
        step = rng.standard_normal((1, 6))
        step *= 0.02 * size / np.linalg.norm(step)
        assert cost(surface.S + step @ np.linalg.inv(system.scaling)) > least * (1.0 + 1e-9)


def excite(system: Plant, surface: SlidingSurface, gains: dict[str, np.ndarray], law: str) -> np.ndarray:
    """|sigma| under a ground acceleration of 2 m/s^2 at 4 Hz, by Euler's rule, from two boundaries off."""
    h, n_steps = 2e-5, 100_000
    T = system.scaling
    A, B, E = (np.linalg.solve(T, each) for each in (system.A @ T, system.B[:, 0], system.E))
    S, drift = surface.S[0] @ T, surface.drift[0] @ T
    z = B * 0.02 * gains["switching"][0] / (S @ B)
    w, gain = 0.0, gains["floor"][0]
    history = np.empty(n_steps)
    for step in range(n_steps):
        sigma = S @ z
        history[step] = abs(sigma)
        if law == "layer":
            force = -gains["switching"][0] * np.clip(sigma / gains["boundary"][0], -1.0, 1.0)
        elif law == "adaptive":
            rate = gains["adaptation"][0] * abs(sigma) * np.sign(abs(sigma) - gains["boundary"][0])
            gain = np.clip(gain + h * rate, gains["floor"][0], gains["ceiling"][0])
            force = -gain * np.clip(sigma / gains["boundary"][0], -1.0, 1.0)
        else:
            w -= h * gains["integral_gain"][0] * np.sign(sigma)
            force = -gains["root_gain"][0] * np.sqrt(abs(sigma)) * np.sign(sigma) + w
        ground = 2.0 * np.sin(2.0 * np.pi * 4.0 * step * h)
        z = z + h * (A @ z + B * (force - drift @ z) + E * ground)
    return history


SETTINGS = SlidingSettings(peak_acceleration=2.0, largest_force=3000.0)


@pytest.mark.parametrize(("law", "bound"), [("layer", 1.0), ("adaptive", 4.0), ("twisting", 0.05)])
def test_an_ideal_actuator_is_brought_to_the_surface_and_held(law: str, bound: float) -> None:
    """In units of the boundary: switching within it, an adapting gain near it, the super-twisting a hundredth of it."""
    system = plant()
    surface = optimal_surface(system)
    gains = SETTINGS.gains(surface)
    history = excite(system, surface, gains, law)
    assert history[0] > 1.5 * gains["boundary"][0]
    assert history[50_000:].max() < bound * gains["boundary"][0]


def test_gains_follow_their_formulas() -> None:
    surface = optimal_surface(plant(2, mr.building("uts")))
    gains = SETTINGS.gains(surface)
    assert np.all(gains["switching"] > 2.0 * np.abs(surface.ground))
    np.testing.assert_allclose(gains["boundary"] * 100.0, gains["switching"])
    # Levant: k_2 > L and k_1^2 > 2 L with L the bound of the slope, all of 1.2 times that of 2 m/s^2 at 5 Hz.
    slope = 1.2 * 2.0 * np.pi * 5.0 * 2.0 * np.abs(surface.ground)
    np.testing.assert_allclose(gains["integral_gain"], 1.1 * slope)
    np.testing.assert_allclose(gains["root_gain"] ** 2, 2.25 * slope)


def test_what_has_no_surface_is_refused() -> None:
    building = mr.building("uts")
    twice = plant_of(building, building.storeys[[0, 0]])
    refusal(optimal_surface, twice, match="act on the building in the same way")
