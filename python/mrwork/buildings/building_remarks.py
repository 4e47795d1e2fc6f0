"""What a colleague would ask about a building: its periods, damping, coordinates, storeys and passive devices."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from mrwork.base.numbers import counted
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.units import STANDARD_GRAVITY, unusual_number
from mrwork.buildings.building_checks import ASYMMETRY
from mrwork.buildings.modes import OF_ADDITIONS, Modes, apart_of
from mrwork.buildings.structure import Structure

# First periods of frames [s]: the shortest for each storey, and the longest by number of storeys, with room for models
# of a laboratory and for isolation. A mass or stiffness that is off by a thousand changes a period by 32.
_SHORTEST, _LONGEST = 0.005, (1.5, 0.5)
# Share of the first mode within the lowest storey from which on a frame stands on isolators; their longest period [s].
_RIGID, _ISOLATED = 0.75, 10.0
# Share of the mass up to which the first mode belongs to a small part.
_SMALL_PART: Final = 0.1
# Frequency [Hz] and share of the mass of a mode that is of no use to a frame; damping ratio of its main mode.
_STIFF, _MOVES_LITTLE, _OVERDAMPED = 1e3, 1e-3, 0.5
# Positive coupling of two coordinates beside their stiffness, coupling beside their masses, and share of the largest
# mass that is light.
_COUPLED, _SHARED, _LIGHT = 0.1, 0.05, 1e-4
DRIFT_RATIOS: Final = (5e-4, 0.1)
"""Usual limits of a drift ratio."""
# Height of a storey for people [m], and least mass of the heaviest floor of such a building [kg].
_HUMAN, _LEAST_FLOOR = 2.0, 200.0
# Stiffness of a storey over that of ordinary ones; isolators are a hundred times softer.
_STIFFER: Final = 300.0
# Share of the base shear that goes to the ground by the lowest storey.
_STANDS: Final = 0.02
MOST_QUESTIONED: Final = 300
"""Coordinates of a building whose modes take a fraction of a second."""


def asked_of(building: Structure, modes: Modes) -> Iterator[Remark]:
    """What a colleague would ask about modes, coordinates, damping and strength of a building with mass."""
    yield from _mode_remarks(building, modes)
    yield from coordinate_remarks(building)
    yield from _storey_remarks(building, modes)


_PERIOD: Final = RemarkKind(
    "period_unusual",
    "{0}: the {1} period is {value:.3g} s for {storeys}, and frames have about 0.1 s a storey",
    "masses are in kg, stiffnesses in N/m: check whether one is off by a thousand",
)
_SOFT_PART: Final = RemarkKind(
    "part_soft",
    "{0}: mode 1 moves {first:.0f} % of the mass and mode {main} {most:.0f} %; a part is softer than the frame",
    "check its stiffness",
)
_MODE_DAMPING: Final = RemarkKind(
    "mode_overdamped",
    "{0}: mode {mode} at {frequency:.4g} Hz has {percent:.3g} % of critical damping",
    "check damping in N s/m and ratios as shares, or give modal_damping",
)
_STIFF_MODE: Final = RemarkKind(
    "mode_stiff",
    "{0}: mode {mode} at {frequency:.4g} Hz has {percent:.3g} % of critical damping; it moves {share:.1g} of the mass, "
    "by coordinate {part}, {mass:g} kg",
    "leave this coordinate out of floors, storeys and influence and give condense = true in [building], or damp its "
    "mode by modal_damping",
)


def _mode_remarks(building: Structure, modes: Modes) -> Iterator[Remark]:
    """Remarks on periods, on a part that is softer than its frame, on stiff coordinates without mass, on damping."""
    omega, shapes, storeys = modes.omega, modes.shapes, len(building.chain) or 1
    shares, frequency = modes.effective_masses / building.total_mass, omega / (2.0 * np.pi)
    moved = np.abs(building.floors @ shapes[:, 0]).max(initial=0.0)
    # A frame on isolators moves as a whole in its first mode, and bends in the second.
    isolated = storeys > 1 and abs(building.chain[0] @ shapes[:, 0]) > _RIGID * moved
    mode = int(isolated and float(modes.periods[0]) <= _ISOLATED)
    period = float(modes.periods[mode])
    longest = _ISOLATED if isolated else _LONGEST[0] + _LONGEST[1] * storeys
    if np.isfinite(period) and not _SHORTEST * storeys <= period <= longest:
        words, measured = (building.name, ("first", "second")[mode]), Measured(period, "s")
        yield _PERIOD.remark(*words, measured=measured, storeys=counted(storeys, "storey"))
    most, apart = int(shares.argmax()), apart_of(shapes, building.mass, building.floors) >= OF_ADDITIONS
    if not apart[0] and shares[0] < _SMALL_PART and shares[most] > 2.0 * shares[0]:
        yield _SOFT_PART.remark(
            building.name, first=100.0 * shares[0], main=most + 1, most=100.0 * shares[most]
        )
    dashpots = (element.damping * (element.row @ shapes) ** 2 for element in building.added)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = modes.damping_ratios - sum(dashpots) / (2.0 * omega)
    seen = (omega > 0.0) & ~apart
    stiff = seen & (frequency > _STIFF) & (shares < _MOVES_LITTLE)
    damped = seen & (ratios > np.where(np.arange(len(omega)) == most, _OVERDAMPED, 1.0))
    for number in np.flatnonzero(stiff if stiff.any() else damped)[-1:]:
        part = int((np.abs(shapes[:, number]) * np.sqrt(np.diag(building.mass))).argmax())
        yield (_STIFF_MODE if stiff.any() else _MODE_DAMPING).remark(
            building.name,
            measured=Measured(float(ratios[number]), ""),
            mode=number + 1,
            frequency=frequency[number],
            percent=100.0 * ratios[number],
            share=shares[number],
            part=part + 1,
            mass=building.mass[part, part],
        )


_ROTATION: Final = RemarkKind(
    "coordinate_no_displacement",
    "{0}: by its stiffness coordinate {coordinate} is no displacement of a floor, and the ground moves it as one",
    "give influence, 0 of a rotation, and the rows floors and storeys of those that there are, in [building]",
)

_RELATIVE: Final = RemarkKind(
    "coordinates_relative",
    "{0}: coordinates {first} and {second} share a mass of {value:.4g} kg, off the diagonal of the mass matrix, and "
    "each is taken for a floor; drifts of storeys share masses so, as do motions relative to a floor",
    "give floors, the rows from coordinates to displacements relative to the ground, storeys and influence, in "
    "[building], or the masses and stiffnesses of floors",
)


def coordinate_remarks(building: Structure) -> Iterator[Remark]:
    """Warn of coordinates that the influence says the ground moves, but whose stiffness shows no displacements.

    Springs between displacements have negative entries beside the diagonal, and condensed frames positive ones between
    every second floor. Rotations have positive ones between neighbours, and without their own influence K r there.
    Displacements relative to other floors share masses.
    """
    if not building.follows_ground:
        return
    follows = np.flatnonzero(building.influence)
    stiffness = building.stiffness[np.ix_(follows, follows)]
    diagonal, mass = np.diag(stiffness), np.diag(building.mass)[follows]
    if not building.knows_masses or (diagonal <= 0.0).any():
        return
    coupled = stiffness / np.sqrt(np.outer(diagonal, diagonal)) > _COUPLED
    np.fill_diagonal(coupled, val=False)
    index = building.floors.argmax(axis=0) if building.ordering else np.arange(len(follows))
    wrong = coupled & ((index[:, None] - index) % 2 == 1)
    yield from _lowest_remark(building)
    held = (building.stiffness @ building.influence)[follows] / diagonal
    light = (mass < _LIGHT * mass.max()) & (np.abs(held) > ASYMMETRY)
    wrong |= coupled & (light[:, None] | light)
    if wrong.any() or (light & (held < 0.0)).any():
        first = int(follows[(light if light.any() else wrong.any(axis=1)).argmax()])
        yield _ROTATION.remark(building.name, coordinate=first + 1)
    elif building.ordering or np.array_equal(building.floors, np.eye(len(building.mass))):
        # Elements with distributed mass couple neighbours by their stiffness more than by their mass.
        shared, joined = (
            np.abs(matrix) / np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
            for matrix in (building.mass, building.stiffness)
        )
        shared[shared < np.maximum(_SHARED, joined)] = 0.0
        np.fill_diagonal(shared, 0.0)
        if shared.any():
            one, other = divmod(int(shared.argmax()), len(shared))
            measured = Measured(float(building.mass[one, other]), "kg")
            yield _RELATIVE.remark(building.name, measured=measured, first=one + 1, second=other + 1)


_LOWEST: Final = RemarkKind(
    "lowest_storey_in_doubt",
    "{0}: {1} is taken between the ground and coordinate {coordinate}, and {percent:.2g} % of what the stiffness holds "
    "stands on the ground there",
    "give floors and storeys, the rows from coordinates to floors and drifts, lowest first, in [building]",
)


def _lowest_remark(building: Structure) -> Iterator[Remark]:
    """A remark on a lowest storey that holds nothing, as of matrices with the roof first."""
    lowest = building.storeys[0]
    coordinate = int(lowest.argmax())
    beside = any(element.row[coordinate] for element in building.elements)
    if beside or not (np.array_equal(lowest, np.eye(len(lowest))[coordinate]) and building.influence.all()):
        return
    try:
        moved = np.linalg.solve(building.stiffness, building.mass @ building.influence)
    except np.linalg.LinAlgError:
        return
    shares = (building.stiffness @ building.influence) * moved / building.total_mass
    if abs(shares[coordinate]) < _STANDS:
        yield _LOWEST.remark(
            *(building.name, building.storey_names[0]),
            coordinate=coordinate + 1,
            percent=100.0 * shares[coordinate],
        )


_STOREY_STIFF: Final = RemarkKind(
    "storey_stiff",
    "{0}: {1} has {value:.3g} N/m, and half of the storeys {ordinary:.3g} N/m or less",
    "check whether one is off by a thousand",
)
_FLOORS_LIGHT: Final = RemarkKind(
    "floors_light",
    "{0}: its heaviest floor has {value:.3g} kg, and its storeys are {height:g} m high",
    "masses are in kg, stiffnesses in N/m and forces in N: check whether all are off by a thousand",
)


def _storey_remarks(building: Structure, modes: Modes) -> Iterator[Remark]:
    """Remarks on heights, drifts, strengths and passive devices, beside weight and modes."""
    heights, weight = building.heights[: len(building.chain)], building.total_mass * STANDARD_GRAVITY
    real, drifts = heights[heights > 0.0], building.yield_drifts[: len(building.chain)]
    numbers = [("the height of a storey", height, (0.05, 25.0), "m") for height in (*real[:1], *real[-1:])]
    if building.drift_limit:
        numbers.append(("drift_limit", building.drift_limit, DRIFT_RATIOS, "1"))
    if drifts.any():
        first, springs = int((drifts > 0.0).argmax()), building.storey_stiffnesses
        if springs.size:
            strength = float(springs[first] * drifts[first]) / weight
            numbers.append(("the yield shear of a storey over the weight", strength, (2e-3, 100.0), ""))
        if heights.size and (heights[drifts > 0.0] > 0.0).all():
            ratio = float((drifts[drifts > 0.0] / heights[drifts > 0.0]).max())
            numbers.append(("the drift ratio at which a storey yields", ratio, (2e-4, 0.05), "1"))
        else:
            numbers.append(("the drift at which a storey yields", float(drifts.max()), (1e-5, 0.5), "m"))
    twice = np.maximum(2.0 * modes.omega, 1e-9)
    for element in building.elements:
        ratio = float((element.damping * (element.row @ modes.shapes) ** 2 / twice).max())
        if element.yield_force and not element.in_stiffness:
            share = element.yield_force / weight
            numbers.append((f"the force of {element.name} over the weight", share, (2e-4, 3.0), ""))
        elif element.is_linear and ratio:
            numbers.append((f"the damping ratio that {element.name} adds to a mode", ratio, (2e-4, 50.0), ""))
    for name, value, usual, unit in dict.fromkeys(numbers):
        yield from unusual_number(name, float(value), usual, unit, where=f"{building.name}: ")
    springs = building.storey_stiffnesses
    ordinary = float(np.sort(springs)[(springs.size - 1) // 2]) if springs.size else np.inf
    if springs.max(initial=0.0) > _STIFFER * ordinary:
        words = building.name, building.storey_names[int(springs.argmax())]
        yield _STOREY_STIFF.remark(*words, measured=Measured(float(springs.max()), "N/m"), ordinary=ordinary)
    heaviest = float(np.diag(building.mass).max())
    if real.size and real.min() > _HUMAN and heaviest < _LEAST_FLOOR:
        measured = Measured(heaviest, "kg")
        yield _FLOORS_LIGHT.remark(building.name, measured=measured, height=float(real.max()))
