"""Weights of regulators and observers, as their papers give them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from mrwork.control.lqr import Regulator, regulator_of_outputs
from mrwork.control.outputs import accelerations
from mrwork.control.plant import Plant
from mrwork.errors import SettingError, UnknownNameError


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedRegulator:
    """Weights of a regulator for a building of `n_floors`, by names of outputs; see `outputs`.

    `status` is "verified" where an independent simulation reproduced what the paper reports, "published" where the
    numbers are only quoted.

    Parameters
    ----------
    weighed
        Floors (from 1) whose absolute acceleration is weighed, with its weight [(s^2/m)^2].
    control_weight
        R [1/N^2].
    ground_over_noise
        S_ag/S_v of the observer: intensity of the ground acceleration over that of each sensor, in SI.
    """

    name: str
    n_floors: int
    weighed: tuple[tuple[int, float], ...]
    control_weight: float
    ground_over_noise: float
    source: str
    status: Literal["verified", "published"]
    note: str = ""


PUBLISHED_REGULATORS = (
    PublishedRegulator(
        name="dyke1996",
        n_floors=3,
        weighed=((3, 1.0),),
        control_weight=1e-17,
        ground_over_noise=50.0,
        source="Dyke, Spencer, Sain, Carlson, Smart Mater. Struct. 5, 1996, 565-575",
        status="verified",
        note="sampled every 0.5 ms; sensors: accelerations of all floors, deformation of the damper",
    ),
)


def published_regulator(name: str) -> PublishedRegulator:
    """Return the published weights called `name`.

    Raises
    ------
    UnknownNameError
        Where there are none of that name; the message lists those that exist.
    """
    for entry in PUBLISHED_REGULATORS:
        if entry.name == name:
            return entry
    known = ", ".join(entry.name for entry in PUBLISHED_REGULATORS)
    raise UnknownNameError(f"no published regulator is called {name!r}; choose one of {known}")


def regulator_as_published(plant: Plant, published: PublishedRegulator) -> Regulator:
    """The regulator of a plant with published weights.

    Raises
    ------
    SettingError
        Where the building has another number of floors than the published one.
    """
    outputs = accelerations(plant)
    if len(outputs.names) != published.n_floors:
        raise SettingError(
            f"{published.name} is for a building of {published.n_floors} floors, {plant.building.name} has "
            f"{len(outputs.names)}; state weights of your own"
        )
    weights = [0.0] * published.n_floors
    for floor, weight in published.weighed:
        weights[floor - 1] = weight
    return regulator_of_outputs(plant, outputs, weights, published.control_weight)
