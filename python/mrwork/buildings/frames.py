"""Frames: shear buildings, published buildings, and additions to a frame.

Additions are damping from ratios, viscous dampers, braces, base isolation, or any mass on a spring.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Annotated

import numpy as np
import scipy

from mrwork.base.arguments import NotNegative, Positive, Share, checked
from mrwork.base.hints import Says, Within
from mrwork.base.keys import look_up
from mrwork.base.units import RATIOS
from mrwork.base.values import Floats, one_for_each
from mrwork.buildings.building_checks import check_size
from mrwork.buildings.modes import modes_of, spaces_of
from mrwork.buildings.passive_element import PassiveElement, transform_elements
from mrwork.buildings.plane_building import Building, source_with
from mrwork.buildings.structure import Status
from mrwork.errors import SettingError, UnknownNameError

Storey = Annotated[int | str, Says("number of the storey from 1, or its name")]
Floor = Annotated[int | str, Says("number of the floor from 1, or its name")]
TwoModes = Annotated[tuple[int, int], Within(least=1), Says("numbers of these modes from 1, as [1, 3]")]
SlabMass = Annotated[Positive, Says("mass of the slab", unit="kg")]
Name = Annotated[str, Says("name in tables")]
ISOLATORS, ADDED = (0.7, 10.0), (5e-3, 0.8)
"""Usual periods on isolators [s], and usual damping ratios of what is added to a frame."""


@checked
def shear_building(
    *,
    name: str = "building",
    masses: Sequence[Positive],
    stiffnesses: Sequence[Positive],
    storey_damping: Sequence[NotNegative] = (),
    heights: Sequence[Positive] = (),
    floor_names: Sequence[str] = (),
    storey_names: Sequence[str] = (),
    source: str = "",
    status: Status = "ours",
) -> Building:
    """Build a shear building; its coordinates are the floor displacements relative to the ground.

    Parameters
    ----------
    masses
        Floor masses [kg], lowest first.
    stiffnesses, storey_damping
        Storey stiffnesses [N/m] and dashpots [N s/m], lowest first; damping can instead be added as Rayleigh or modal
        damping.
    heights
        Heights of the storeys [m], lowest first, on which drift ratios stand.
    floor_names, storey_names
        Default: "floor 1", "storey 1" and so on.

    Examples
    --------
    >>> frame = shear_building(name="frame", masses=[300.0], stiffnesses=[1.0659e5])
    >>> round(float(frame.frequencies[0]), 3)
    3.0
    """
    n = len(masses)
    check_size(n, name)
    damping = tuple(storey_damping) or (0.0,) * n
    for title, values in (("stiffnesses", stiffnesses), ("storey_damping", damping)):
        if len(values) != n:
            raise SettingError(
                f"building {name}: {len(values)} {title} for {n} masses; give one for each storey"
            )
    storeys = np.eye(n) - np.eye(n, k=-1)

    def chain(values: Sequence[float]) -> Floats:
        # What overflows is refused by `Building`.
        with np.errstate(over="ignore", invalid="ignore"):
            return storeys.T @ np.diag(np.asarray(values, dtype=np.float64)) @ storeys

    return Building(
        name=name,
        mass=np.diag(np.asarray(masses, dtype=np.float64)),
        damping=chain(damping),
        stiffness=chain(stiffnesses),
        floor_names=tuple(floor_names),
        storey_names=tuple(storey_names),
        source=source,
        status=status,
        heights=np.array(heights, dtype=np.float64),
    )


@cache
def buildings() -> tuple[Building, ...]:
    """All published buildings."""
    dyke1996 = Building(
        name="dyke1996",
        mass=98.3 * np.eye(3),
        damping=np.array([[175.0, -50.0, 0.0], [-50.0, 100.0, -50.0], [0.0, -50.0, 50.0]]),
        stiffness=1e5 * np.array([[12.0, -6.84, 0.0], [-6.84, 13.7, -6.84], [0.0, -6.84, 6.84]]),
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
        # The source numbers the floors from the roof down.
        stiffness=np.array(
            [
                [9.35151e7, -1.29507e8, 4.21961e7],
                [-1.29507e8, 3.15537e8, -2.39798e8],
                [4.21961e7, -2.39798e8, 4.40846e8],
            ]
        )[::-1, ::-1],
        floor_names=("floor 1", "floor 2", "roof"),
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
    frames = {building.name: building for building in buildings()}
    if Path(name).suffix and name not in frames:
        raise UnknownNameError(
            f"no published building is called {name!r}; a file is read by mr.buildings.read_building({name!r}), and by "
            f'a study as [building] file = "{name}"'
        )
    return look_up(name, frames, f"no published building is called {name!r}")


@checked
def with_rayleigh_coefficients(
    building: Building,
    *,
    a0: Annotated[float, Says("coefficient of the mass", unit="1/s")],
    a1: Annotated[float, Says("coefficient of the stiffness", unit="s")],
) -> Building:
    """The building with Rayleigh damping, C = a0 M + a1 K.

    Raises
    ------
    SettingError
        If a mode would have negative damping.
    """
    omega, _ = modes_of(building.check().mass, building.stiffness)
    driven = np.flatnonzero(a0 + a1 * omega**2 < 0.0)
    if driven.size:
        raise SettingError(
            f"building {building.name}: Rayleigh damping with a0 = {a0:g} 1/s and a1 = {a1:g} s drives mode "
            f"{driven[0] + 1} instead of damping it; choose other ratios or modes"
        )
    return replace(building, damping=a0 * building.mass + a1 * building.stiffness)


@checked
def with_rayleigh_damping(
    building: Building,
    *,
    ratios: Annotated[
        tuple[Share, Share], Says("damping ratios in two modes, as [0.02, 0.02]", usual=RATIOS)
    ],
    modes: TwoModes = (1, 2),
) -> Building:
    """The building with Rayleigh damping that has given ratios in two modes.

    a0 and a1 solve `ratio = (a0 / omega + a1 omega) / 2` for both (Chopra, Dynamics of Structures, 11.4.1).

    Raises
    ------
    SettingError
        If the modes are equal, do not exist or have zero frequency, or a mode would have negative damping.
    """
    omega, _ = modes_of(building.check().mass, building.stiffness)
    if len(set(modes)) != 2 or max(modes) > omega.size:
        raise SettingError(
            f"building {building.name}: Rayleigh damping in modes {modes[0]} and {modes[1]}; "
            + (
                f"name two different modes from 1 to {omega.size}"
                if omega.size > 1
                else "of one mode give modal damping"
            )
        )
    low, high = (float(omega[mode - 1]) for mode in modes)
    if min(low, high) <= 0.0 or np.isclose(low, high, rtol=1e-8):
        raise SettingError(
            f"building {building.name}: modes {modes[0]} and {modes[1]} have {low / (2 * np.pi):g} and "
            f"{high / (2 * np.pi):g} Hz; Rayleigh damping needs two different frequencies above zero"
        )
    a0, a1 = np.linalg.solve([[0.5 / low, 0.5 * low], [0.5 / high, 0.5 * high]], ratios)
    return with_rayleigh_coefficients(building, a0=float(a0), a1=float(a1))


@checked
def with_modal_damping(
    building: Building,
    *,
    ratios: Annotated[
        Sequence[Share], Says("damping ratios, as [0.01]: one for all modes or one for each", usual=RATIOS)
    ],
) -> Building:
    """The building with given damping ratios of its modes.

    `C = M (sum of 2 ratio omega phi phi') M` over the modes phi, normalised so that phi' M phi = 1.
    """
    omega, modes = modes_of(building.check().mass, building.stiffness)
    of_modes = one_for_each("ratios", np.squeeze(np.array(ratios)), omega.size, "mode")
    for space in spaces_of(omega**2):
        if np.ptp(of_modes[space]):
            raise SettingError(
                f"building {building.name}: modes {space.start + 1} to {space.stop} have one frequency, "
                f"{omega[space.start] / (2.0 * np.pi):.4g} Hz, and damping ratios of {of_modes[space].min():g} to "
                f"{of_modes[space].max():g}, so that which shape has which ratio is not determined; give them one ratio"
            )
    spread = 2.0 * of_modes * omega
    moved = building.mass @ modes
    return replace(building, damping=(moved * spread) @ moved.T)


@checked
def with_viscous_damper(
    building: Building,
    *,
    storey: Storey,
    damping: Annotated[NotNegative, Says("sum over all dampers of the storey", unit="N s/m")],
) -> Building:
    """The building with a linear viscous damper across a storey: C grows by `damping e'e`."""
    name = f"viscous damper in {building.storey_name(storey)}"
    element = PassiveElement(name=name, row=building.storey_row(storey), damping=damping)
    return with_element(building, element, f"has {damping:g} N s/m")


def with_element(building: Building, element: PassiveElement, says: str) -> Building:
    """The building with an element, whose spring and dashpot join the matrices; `says` goes into its source."""
    square = np.outer(element.row, element.row)
    return replace(
        building,
        name=f"{building.name}, {element.name}",
        stiffness=building.stiffness + element.stiffness * square,
        damping=building.damping + element.damping * square,
        elements=(*building.elements, element),
        source=source_with(building, f"{element.name} {says}, added"),
        status="ours",
    )


def with_coordinate(
    building: Building,
    *,
    mass: float,
    damping: float,
    stiffness: float,
    stroke: Floats,
    stroke_name: str,
    added: str,
    label: str = "",
    across: Floats | None = None,
    follows_ground: float = 0.0,
) -> Building:
    """Return the building with one more coordinate, a mass on a spring and a dashpot, that is not a floor.

    Spring and dashpot elongate by across @ q, shape (n + 1,), by default the stroke. `follows_ground` is 1 for a
    displacement relative to the ground, 0 for a deformation. The row `stroke`, shape (n + 1,), is appended to the
    storeys. The name of the building has the `label` of what is `added`, by default the name of the stroke.
    """
    n = building.n_coordinates
    spring = np.outer(stroke, stroke) if across is None else np.outer(across, across)
    grown = replace(
        building,
        mass=scipy.linalg.block_diag(building.mass, np.array([[mass]])),
        damping=np.pad(building.damping, (0, 1)) + damping * spring,
        stiffness=np.pad(building.stiffness, (0, 1)) + stiffness * spring,
        influence=np.append(building.influence, follows_ground),
        floors=np.pad(building.floors, ((0, 0), (0, 1))),
        storeys=np.vstack([np.pad(building.storeys, ((0, 0), (0, 1))), stroke]),
        storey_names=(*building.storey_names, stroke_name),
        status="ours",
        n_strokes=building.n_strokes + 1,
        heights=np.append(building.heights, [0.0] * bool(building.heights.size)),
        loads=np.append(building.loads, [0.0] * bool(building.loads.size)),
        elements=transform_elements(building.elements, np.eye(n, n + 1)),
    )
    source = source_with(building, f"{added} added")
    return replace(grown, name=f"{building.name}, {label or stroke_name}", source=source)


@checked
def with_brace(
    building: Building,
    *,
    storey: Storey,
    stiffness: Annotated[Positive, Says("stiffness of the brace along the drift", unit="N/m")],
    mass: Annotated[
        Positive,
        Says("mass that moves with the deformation of the brace, such as a thousandth of a floor", unit="kg"),
    ],
    damping: Annotated[NotNegative, Says("damping of the brace along the drift", unit="N s/m")] = 0.0,
    name: Annotated[
        str, Says('name of the stroke of the damper in tables, by default "damper in" and the storey')
    ] = "",
) -> Building:
    """The building with a brace in series with a damper: the two share the drift of a storey.

    The deformation d of the brace is a new coordinate, `m d'' + c d' + k d = f`, and the rest of the drift, `e q - d`,
    elongates the damper. This row is appended to the storeys as a stroke, named "damper in storey 1" for storey 1.

    A massless brace would follow `c d' + k d = f`, which is the limit of small `mass`. The mass moves with the
    deformation only, so the mass of the building does not change. With a viscous damper c0, d settles at the rate
    `(c + c0) / m` and oscillates at `sqrt(k / m)`. Choose a mass for which both are fast compared with the building and
    slow compared with the step of the simulation; a thousandth of a floor mass is usually suitable.
    """
    where = building.storey_name(storey)
    row = building.storey_row(storey)
    return brace_across(
        building,
        row,
        where,
        stiffness=stiffness,
        mass=mass,
        damping=damping,
        name=name or f"damper in {where}",
    )


def brace_across(
    building: Building, row: Floats, where: str, *, stiffness: float, mass: float, damping: float, name: str
) -> Building:
    """The building with a brace as of `with_brace`, where brace and damper together have any row, shape (n,)."""
    end = np.append(np.zeros(building.n_coordinates), 1.0)
    return with_coordinate(
        building,
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        across=end,
        stroke=np.append(row, -1.0),
        stroke_name=name,
        label=f"brace in {where}",
        added=f"brace of {stiffness:g} N/m in {where}",
    )


@checked
def with_base_isolation(
    building: Building,
    *,
    mass: SlabMass,
    stiffness: Annotated[Positive, Says("stiffness of all isolators", unit="N/m")],
    damping: Annotated[NotNegative, Says("damping of all isolators", unit="N s/m")],
) -> Building:
    """The building on a base slab with isolators between slab and ground.

    The displacement u of the slab relative to the ground is a new first coordinate. The building stands on the slab, so
    `q - r u` replaces q in its forces. The slab becomes the lowest floor, "base", and the isolators the lowest storey,
    "isolation", which has a stroke and no drift.
    """
    if "isolation" in building.storey_names:
        raise SettingError(
            f"{building.name} stands on isolators already; keep one of isolation and lead_rubber"
        )
    # Displacements relative to the slab, q - r u.
    relative = np.hstack([-building.influence[:, None], np.eye(building.n_coordinates)])
    slab = np.concatenate([[1.0], np.zeros(building.n_coordinates)])
    held = np.outer(slab, slab)
    return replace(
        building,
        name=f"{building.name}, isolated",
        mass=scipy.linalg.block_diag(np.array([[mass]]), building.mass),
        damping=relative.T @ building.damping @ relative + damping * held,
        stiffness=relative.T @ building.stiffness @ relative + stiffness * held,
        influence=np.concatenate([[1.0], building.influence]),
        floors=np.vstack([slab, building.floors @ relative + slab]),
        storeys=np.vstack([slab, building.storeys @ relative]),
        floor_names=("base", *building.floor_names),
        storey_names=("isolation", *building.storey_names),
        isolators=("isolation", *building.isolators),
        heights=np.append([0.0] * bool(building.heights.size), building.heights),
        loads=np.append([0.0] * bool(building.loads.size), building.loads),
        elements=transform_elements(building.elements, relative),
        condensed=tuple(number + 1 for number in building.condensed),
        source=source_with(building, "base isolation added"),
        status="ours",
    )


@checked
def with_base_isolation_of_period(
    building: Building,
    *,
    mass: SlabMass,
    period: Annotated[
        Positive, Says("period of the rigid building on its isolators", unit="s", usual=ISOLATORS)
    ],
    ratio: Annotated[NotNegative, Says("damping ratio of that motion", usual=ADDED)],
) -> Building:
    """The building on a base slab with isolators given by their period and damping ratio.

    With the total mass m above the isolators in rigid-body motion, `stiffness = m (2 pi / period)^2` and
    `damping = 2 ratio m (2 pi / period)` (Naeim, Kelly, Design of Seismic Isolated Structures, 1999).
    """
    omega = 2.0 * np.pi / period
    total = building.total_mass + mass
    return with_base_isolation(
        building, mass=mass, stiffness=total * omega**2, damping=2.0 * ratio * total * omega
    )


def mode_at_floor(building: Building, floor: int | str, mode: int, name: str) -> tuple[float, float, float]:
    """Circular frequency of a mode [rad/s], its damping ratio, and its shape at a floor, with phi' M phi = 1.

    Of several modes of one frequency, as of equal towers, it is the combination that moves the floor most.
    """
    if not 1 <= mode <= building.n_coordinates:
        raise SettingError(
            f"{name} on {building.name}: it is tuned to mode {mode}; give one from 1 to {building.n_coordinates}"
        )
    (space,) = (space for space in spaces_of(building.frequencies**2) if space.start < mode <= space.stop)
    # Of large buildings these modes alone take a fraction of the time of all.
    squares, shapes = scipy.linalg.eigh(
        building.stiffness, building.mass, subset_by_index=[space.start, space.stop - 1]
    )
    shape, moved = shapes[:, 0], building.floor_row(floor) @ shapes
    if len(moved) > 1 and moved.any():
        shape = shapes @ (moved / np.linalg.norm(moved))
    entry = float(building.floor_row(floor) @ shape)
    # An entry below a millionth of the largest is a node of the mode.
    if abs(entry) < 1e-6 * float(np.abs(building.floors @ shape).max()):
        raise SettingError(
            f"{name} on {building.name}: mode {mode} does not move the floor {floor}; choose another"
        )
    omega = float(np.sqrt(max(squares[0], 0.0)))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = float(np.divide(shape @ building.damping @ shape, 2.0 * omega))
    return omega, ratio, entry
