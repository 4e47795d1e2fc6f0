"""Buildings on which controllers are designed in tests, and the cost that a regulator minimises."""

import numpy as np
import scipy.linalg

import mrwork as mr
from mrwork.buildings import Building
from mrwork.control import Plant, plant_of


def frame(name: str, mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray) -> Building:
    """A frame whose coordinates are the displacements of its floors."""
    n = len(mass)
    names = tuple(str(floor + 1) for floor in range(n))
    return Building(
        name=name, mass=mass, damping=damping, stiffness=stiffness, floor_names=names, storey_names=names
    )


def shear_frame(n_storeys: int) -> Building:
    """Equal storeys of 1000 t and 1 GN/m, about 2 % of damping in the lowest modes."""
    mass = 1e6 * np.eye(n_storeys)
    stiffness = 1e9 * (2.0 * np.eye(n_storeys) - np.eye(n_storeys, k=1) - np.eye(n_storeys, k=-1))
    stiffness[-1, -1] = 1e9
    lowest = np.sqrt(np.linalg.eigvalsh(stiffness)[0] / 1e6)
    return frame(f"{n_storeys} storeys", mass, 0.02 * (lowest * mass + stiffness / lowest / 9.0), stiffness)


def plant(n_devices: int = 1, building: Building | None = None) -> Plant:
    """Devices across the lowest storeys."""
    building = building or mr.building("dyke1996")
    return plant_of(building, building.storeys[:n_devices])


def in_units(plant: Plant, metre: float, second: float, newton: float) -> Plant:
    """The same plant in other units, of which a metre, a second and a newton have the given numbers."""
    building = plant.building
    kilogram = newton * second**2 / metre
    changed = frame(
        building.name,
        building.mass * kilogram,
        building.damping * newton * second / metre,
        building.stiffness * newton / metre,
    )
    return plant_of(changed, plant.attachment)


def mean_cost(plant: Plant, gain: np.ndarray, Q: np.ndarray, R: np.ndarray, N: np.ndarray) -> float:
    """Cost of `f = -gain s` from s = T e_i, summed over the unit vectors e_i of the scaled state."""
    T = plant.scaling
    closed = np.linalg.solve(T, (plant.A - plant.B @ gain) @ T)
    if np.linalg.eigvals(closed).real.max() >= 0.0:
        return np.inf
    weight = Q - N @ gain - gain.T @ N.T + gain.T @ R @ gain
    return float(np.trace(scipy.linalg.solve_continuous_lyapunov(closed.T, -T.T @ weight @ T)))
