"""Shear buildings: rigid floors, with one spring and one dashpot per storey; and buildings from the literature."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from mrwork.base.arguments import NotNegative, Positive, checked
from mrwork.base.keys import suggestion
from mrwork.base.numbers import bytes_in_words
from mrwork.base.values import Floats
from mrwork.buildings.additions import with_modal_damping, with_rayleigh_coefficients, with_rayleigh_damping
from mrwork.buildings.matrices import Building
from mrwork.errors import SettingError, UnknownNameError

# No building is as tall; natural frequencies of more coordinates take many seconds.
_MOST_STOREYS = 1000


def check_storeys(count: int) -> None:
    """Refuse a building whose matrices would not fit into memory."""
    if count > _MOST_STOREYS:
        raise SettingError(
            f"a building of {count:,} storeys is taller than any, and would have matrices of "
            f"{bytes_in_words(8.0 * count * count)} each; give {_MOST_STOREYS:,} storeys at most"
        )


@checked
def shear_building(
    *,
    name: str,
    masses: Sequence[float],
    stiffnesses: Sequence[Positive],
    storey_damping: Sequence[NotNegative] = (),
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
    storeys = _floor_differences(n)
    return Building(
        name=name,
        mass=np.diag(np.asarray(masses, dtype=np.float64)),
        damping=chain(storeys, damping),
        stiffness=chain(storeys, stiffnesses),
        influence=np.ones(n),
        floors=np.eye(n),
        storeys=storeys,
        floor_names=tuple(floor_names) or number_names("floor", n),
        storey_names=tuple(storey_names) or number_names("storey", n),
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
    """
    if storeys.ndim != 2 or len(storeys) != len(values):
        raise SettingError(
            f"`storeys` has shape {storeys.shape}, and there are {len(values)} values; give (n_storeys, n) and one "
            "value for each storey"
        )
    # What overflows is refused by `Building`.
    with np.errstate(over="ignore", invalid="ignore"):
        return storeys.T @ np.diag(np.asarray(values, dtype=np.float64)) @ storeys


def _floor_differences(n_floors: int) -> Floats:
    """Matrix from floor displacements to storey drifts, shape (n_floors, n_floors)."""
    return np.eye(n_floors) - np.eye(n_floors, k=-1)


def number_names(noun: str, count: int) -> tuple[str, ...]:
    """Default names of floors or storeys: "floor 1", "floor 2" and so on."""
    return tuple(f"{noun} {number}" for number in range(1, count + 1))


@cache
def buildings() -> tuple[Building, ...]:
    """All published buildings."""
    dyke1996 = Building(
        name="dyke1996",
        mass=98.3 * np.eye(3),
        damping=np.array([[175.0, -50.0, 0.0], [-50.0, 100.0, -50.0], [0.0, -50.0, 50.0]]),
        stiffness=1e5 * np.array([[12.0, -6.84, 0.0], [-6.84, 13.7, -6.84], [0.0, -6.84, 6.84]]),
        influence=np.ones(3),
        floors=np.eye(3),
        storeys=_floor_differences(3),
        floor_names=number_names("floor", 3),
        storey_names=number_names("storey", 3),
        source="Dyke, Spencer, Sain, Carlson, Smart Mater. Struct. 5, 1996, 565-575; scaled three-storey frame, "
        "for records with their time axis divided by 5",
        status="verified",
    )
    jansen2000 = shear_building(
        name="jansen2000",
        masses=[22.7] * 6,
        stiffnesses=[29700.0] * 6,
        source="Jansen, Dyke, J. Eng. Mech. 126(8), 2000, 795-803; scaled six-storey frame, 0.5 % damping in each mode",
        status="verified",
    )
    uts = shear_building(
        name="uts",
        masses=[337.0, 330.0, 330.0, 330.0, 330.0],
        stiffnesses=[1.448e6] * 5,
        source="five-storey frame of UTS; its masses are published, equal stiffness and 1 % Rayleigh damping in modes "
        "1 and 3 are ours",
    )
    frame = shear_building(
        name="frame",
        masses=[300.0],
        stiffnesses=[300.0 * (2.0 * np.pi * 3.0) ** 2],
        source="one-storey frame in the manner of Nguyen, PhD thesis, University of Technology, Sydney, 2009, ch. 7; "
        "300 kg, 3 Hz and 1 % are ours",
    )
    half_of_sac3 = Building(
        name="sac3",
        mass=np.diag([4.7835e5, 4.7835e5, 5.1779e5]),
        damping=np.zeros((3, 3)),
        # The source numbers the floors from the roof down.
        stiffness=np.array(
            [
                [9.35151e7, -1.29507e8, 4.21961e7],
                [-1.29507e8, 3.15537e8, -2.39798e8],
                [4.21961e7, -2.39798e8, 4.40846e8],
            ]
        )[::-1, ::-1],
        influence=np.ones(3),
        floors=np.eye(3),
        storeys=_floor_differences(3),
        floor_names=("floor 1", "floor 2", "roof"),
        storey_names=number_names("storey", 3),
        source="Ohtori, Christenson, Spencer, Dyke, J. Eng. Mech. 130(4), 2004, 366-385; half of the SAC three-storey "
        "building, condensed; 2 % Rayleigh damping, in modes 1 and 3 (which modes is ours)",
        status="verified",
    )
    utfpr = shear_building(
        name="utfpr",
        masses=[24.3, 24.3],
        stiffnesses=[6820.0, 8220.0],
        storey_damping=[0.939, 0.29],
        source="two-storey frame of UTFPR (A. N. Vargas)",
        status="published",
    )
    return (
        dyke1996,
        with_modal_damping(jansen2000, ratios=[0.005]),
        with_rayleigh_coefficients(uts, a0=0.309478, a1=1.89972e-4),
        with_modal_damping(frame, ratios=[0.01]),
        with_rayleigh_damping(half_of_sac3, ratios=(0.02, 0.02), modes=(1, 3)),
        utfpr,
    )


@checked
def building(name: str) -> Building:
    """Return the published building with this name.

    Examples
    --------
    >>> building("dyke1996").frequencies.round(2).tolist()
    [5.46, 15.81, 23.64]
    """
    for known in buildings():
        if known.name == name:
            return known
    names = [known.name for known in buildings()]
    raise UnknownNameError(f"no published building is called {name!r}{suggestion(name, names)}")
