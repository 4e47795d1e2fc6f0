"""Shear buildings: rigid floors, with one spring and one dashpot per storey."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import checked
from mrwork.buildings.matrices import Building
from mrwork.errors import SettingError

Floats = NDArray[np.float64]


# No building is as tall; natural frequencies of more coordinates take many seconds.
_MOST_STOREYS = 1000


def check_storeys(count: int) -> None:
    """Refuse a building whose matrices would not fit into memory."""
    if count > _MOST_STOREYS:
        raise SettingError(
            f"a building of {count:,} storeys would have matrices of {8e-9 * count * count:,.1f} GB each; "
            f"give {_MOST_STOREYS} storeys at most"
        )


@checked
def shear_building(
    *,
    name: str,
    masses: Sequence[float],
    stiffnesses: Sequence[float],
    storey_damping: Sequence[float] = (),
    floor_names: Sequence[str] = (),
    storey_names: Sequence[str] = (),
    source: str = "",
    status: str = "ours",
) -> Building:
    """Build a shear building; its coordinates are the floor displacements relative to the ground.

    Parameters
    ----------
    masses
        Floor masses [kg], lowest first.
    stiffnesses, storey_damping
        Storey stiffnesses [N/m] and dashpots [N s/m], lowest first; damping can instead be added as Rayleigh or modal
        damping.
    floor_names, storey_names
        Default: "floor 1", "storey 1" and so on.

    Raises
    ------
    SettingError
        If the numbers of masses and stiffnesses differ, a stiffness is not positive, or a damping is negative.

    Examples
    --------
    >>> frame = shear_building(name="frame", masses=[300.0], stiffnesses=[1.0659e5])
    >>> round(float(frame.frequencies[0]), 3)
    3.0
    """
    n = len(masses)
    check_storeys(n)
    damping = tuple(storey_damping) or (0.0,) * n
    for title, values in (("stiffnesses", stiffnesses), ("storey_damping", damping)):
        if len(values) != n:
            raise SettingError(
                f"building {name}: {len(values)} {title} for {n} masses; give one for each storey"
            )
    for number, stiffness in enumerate(stiffnesses, start=1):
        if not stiffness > 0.0:
            raise SettingError(
                f"building {name}: the stiffness of storey {number} is {stiffness:g} N/m; it must be positive"
            )
    for number, value in enumerate(damping, start=1):
        if not value >= 0.0:
            raise SettingError(
                f"building {name}: the damping of storey {number} is {value:g} N s/m; it cannot be negative"
            )
    storeys = floor_differences(n)
    return Building(
        name=name,
        mass=np.diag(np.asarray(masses, dtype=np.float64)),
        damping=chain(storeys, damping),
        stiffness=chain(storeys, stiffnesses),
        influence=np.ones(n),
        floors=np.eye(n),
        storeys=storeys,
        floor_names=tuple(floor_names) or numbered("floor", n),
        storey_names=tuple(storey_names) or numbered("storey", n),
        source=source,
        status=status,
    )


@checked
def chain(storeys: Floats, values: Sequence[float]) -> Floats:
    """Matrix of springs or dashpots across storeys: the sum of value e'e, shape (n, n).

    Parameters
    ----------
    storeys
        Row e of each storey, shape (n_storeys, n).
    values
        Stiffness or damping of each storey.

    Raises
    ------
    SettingError
        If there is not one value for each row.
    """
    if storeys.ndim != 2 or len(storeys) != len(values):
        raise SettingError(
            f"`storeys` has shape {storeys.shape}, and there are {len(values)} values; give (n_storeys, n) and one "
            "value for each storey"
        )
    # What overflows is refused by `Building`.
    with np.errstate(over="ignore", invalid="ignore"):
        return storeys.T @ np.diag(np.asarray(values, dtype=np.float64)) @ storeys


def floor_differences(n_floors: int) -> Floats:
    """Matrix from floor displacements to storey drifts, shape (n_floors, n_floors)."""
    return np.eye(n_floors) - np.eye(n_floors, k=-1)


def numbered(noun: str, count: int) -> tuple[str, ...]:
    """Default names of floors or storeys: "floor 1", "floor 2" and so on."""
    return tuple(f"{noun} {number}" for number in range(1, count + 1))
