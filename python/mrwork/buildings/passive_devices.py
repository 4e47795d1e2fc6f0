"""Passive devices of a building: yielding and friction dampers, lead-rubber bearings, liquid columns, tuned masses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import pi, sqrt
from typing import Annotated, Final, Literal

import numpy as np

from mrwork.base.arguments import Level, NotNegative, Positive, checked
from mrwork.base.hints import Says, Within
from mrwork.base.units import STANDARD_GRAVITY
from mrwork.buildings.frames import (
    ADDED,
    ISOLATORS,
    Floor,
    Name,
    SlabMass,
    Storey,
    mode_at_floor,
    with_base_isolation_of_period,
    with_coordinate,
    with_element,
)
from mrwork.buildings.passive_element import PassiveElement, Sharpness
from mrwork.buildings.plane_building import Building, source_with
from mrwork.errors import SettingError

# Usual displacements at which devices yield [m], and masses as a share of the building's.
_YIELDS, _SHARES = (2e-5, 0.15), (5e-4, 0.5)
MassRatio = Annotated[
    Positive, Says("mass over the mass of the building, as 0.02, with a published tuning", usual=_SHARES)
]
TunedMode = Annotated[int, Within(least=1), Says("number of the mode that it is tuned to; with mass_ratio")]
WidthRatio = Annotated[Level, Says("alpha, horizontal share of the length of the column")]


@checked
def with_yielding_damper(
    building: Building,
    *,
    storey: Storey,
    yield_force: Annotated[Positive, Says("force at which it yields, along the drift", unit="N")],
    yield_displacement: Annotated[
        Positive, Says("displacement at which it yields, with its brace", unit="m", usual=_YIELDS)
    ],
    post_yield_ratio: Annotated[
        float, Within(least=0.0, below=1.0), Says("stiffness after yielding over that before")
    ] = 0.05,
    sharpness: Sharpness = 10.0,
    name: Name = "",
) -> Building:
    """The building with a metallic yielding damper (ADAS, TADAS) across a storey.

    Of the force F_y at the yield displacement x_y, the share `1 - r` yields and the share r is elastic:
    `f = r F_y / x_y x + (1 - r) F_y w`, bilinear but for the rounded knee (Whittaker, Bertero, Thompson, Alonso,
    Earthquake Spectra 7, 1991, 563-604, who test such elements; the form is the usual Bouc-Wen one).
    """
    return with_element(
        building,
        PassiveElement(
            name=name or f"yielding damper in {building.storey_name(storey)}",
            row=building.storey_row(storey),
            stiffness=post_yield_ratio * yield_force / yield_displacement,
            yield_force=(1.0 - post_yield_ratio) * yield_force,
            yield_displacement=yield_displacement,
            sharpness=sharpness,
        ),
        f"yields at {yield_force:g} N",
    )


@checked
def with_friction_damper(
    building: Building,
    *,
    storey: Storey,
    slip_load: Annotated[Positive, Says("force at which it slips, along the drift", unit="N")],
    stiffness: Annotated[Positive, Says("stiffness of the brace until it slips", unit="N/m")],
    sharpness: Sharpness = 20.0,
    name: Name = "",
) -> Building:
    """The building with a friction damper (Pall) in a brace across a storey.

    The brace is elastic up to the slip load and slips at it: a yielding damper without post-yield stiffness (Pall,
    Marsh, J. Struct. Div. ASCE 108(6), 1982, 1313-1323).
    """
    return with_element(
        building,
        PassiveElement(
            name=name or f"friction damper in {building.storey_name(storey)}",
            row=building.storey_row(storey),
            yield_force=slip_load,
            yield_displacement=slip_load / stiffness,
            sharpness=sharpness,
        ),
        f"slips at {slip_load:g} N",
    )


@checked
def with_lead_rubber_bearings(
    building: Building,
    *,
    mass: SlabMass,
    period: Annotated[
        Positive | None,
        Says(
            "period of the rigid building on the rubber alone; or post_yield_stiffness",
            unit="s",
            usual=ISOLATORS,
        ),
    ] = None,
    post_yield_stiffness: Annotated[
        Positive | None, Says("stiffness K_d of the rubber of all bearings; or period", unit="N/m")
    ] = None,
    ratio: Annotated[NotNegative, Says("damping ratio of the rubber", usual=ADDED)] = 0.0,
    characteristic_strength: Annotated[
        Positive | None,
        Says("characteristic strength Q_d of all leads together, some per cent of the weight", unit="N"),
    ] = None,
    yield_force: Annotated[Positive | None, Says("another name of characteristic_strength", unit="N")] = None,
    yield_displacement: Annotated[
        Positive, Says("displacement at which the leads yield", unit="m", usual=_YIELDS)
    ] = 0.01,
    sharpness: Sharpness = 20.0,
    name: Name = "lead-rubber bearings",
) -> Building:
    """The building on a base slab with lead-rubber bearings between slab and ground.

    The rubber is the spring of `with_base_isolation_of_period`, the lead a loop in parallel:
    `f = K_d x + Q_d w` with the post-yield stiffness K_d and the characteristic strength Q_d, the force at no
    displacement (Naeim, Kelly, Design of Seismic Isolated Structures, 1999, ch. 3). Before the leads yield the
    stiffness is `K_d + Q_d / yield_displacement`. Accelerations see the knee: with the default sharpness those of the
    roof of a frame of three storeys under five motions are within 1 % of the bilinear loop. With the round knee 2 of
    many bearing programs they are 3 to 16 % smaller, and strokes within 3 %.

    Raises
    ------
    SettingError
        If both or neither of period and post-yield stiffness, or of the names of Q_d, are given.
    """
    if (period is None) is (post_yield_stiffness is None):
        raise SettingError(
            f"{name}: give either period or post_yield_stiffness, which follow from each other"
        )
    if (yield_force is None) is (characteristic_strength is None):
        raise SettingError(f"{name}: give either characteristic_strength or yield_force, which are the same")
    if period is None:
        period = 2.0 * pi * sqrt((building.total_mass + mass) / (post_yield_stiffness or 1.0))
    yield_force = yield_force or characteristic_strength or 0.0
    isolated = with_base_isolation_of_period(building, mass=mass, period=period, ratio=ratio)
    # The first coordinate is the slab; the rubber is in the matrices already.
    rubber = PassiveElement(
        name=name,
        row=isolated.storeys[0],
        stiffness=isolated.total_mass * (2.0 * pi / period) ** 2,
        damping=2.0 * ratio * isolated.total_mass * (2.0 * pi / period),
        yield_force=yield_force,
        yield_displacement=yield_displacement,
        sharpness=sharpness,
    )
    return replace(
        isolated,
        elements=(*isolated.elements, rubber),
        source=source_with(isolated, f"{name} yield at {yield_force:g} N"),
    )


@checked
def with_liquid_column(
    building: Building,
    *,
    floor: Floor,
    width_ratio: WidthRatio,
    mass: Annotated[Positive, Says("mass of the liquid, rho A L", unit="kg")],
    frequency: Annotated[
        Positive, Says("frequency of the liquid on the fixed floor, sqrt(2 g / L) / (2 pi)", unit="Hz")
    ],
    head_loss: Annotated[NotNegative, Says("xi, coefficient of head loss of orifice and tube")],
    name: Name = "liquid column",
) -> Building:
    """The building with a tuned liquid column damper on a floor: a U-tube in which a liquid sways.

    A tube of constant section A holds a liquid of density rho over the length L, of which the share alpha is
    horizontal. Its elevation y is a new coordinate, with the floor's displacement u:
    `rho A L (y'' + alpha u'') + rho A xi |y'| y' / 2 + 2 rho A g y = 0`, and the liquid adds its mass and
    `alpha rho A L y''` to the floor (Sakai, Takaeda, Tamaki, 1989; Gao, Kwok, Samali, Eng. Struct. 19, 1997, 476-486).
    The elevation is appended to the storeys as a stroke, under the name `name`; the head loss is a passive element.
    """
    row = building.floor_row(floor)
    elevation, length = np.append(np.zeros(building.n_coordinates), 1.0), column_length(frequency)
    with_liquid = with_coordinate(
        building,
        mass=mass,
        damping=0.0,
        stiffness=mass * (2.0 * pi * frequency) ** 2,
        stroke=elevation,
        stroke_name=name,
        added=f"{name} of {mass:g} kg, {length:.4g} m long,",
    )
    # The liquid moves with the floor, and its elevation accelerates the floor.
    coupled = with_liquid.mass.copy()
    coupled[:-1, :-1] += mass * np.outer(row, row)
    coupled[-1, :-1] = coupled[:-1, -1] = width_ratio * mass * row
    orifice = PassiveElement(name=name, row=elevation, head_loss=0.5 * head_loss * mass / length)
    return replace(with_liquid, mass=coupled, elements=(*with_liquid.elements, orifice))


def column_length(frequency: Positive) -> float:
    """Length of a liquid column [m] of a frequency [Hz]: `2 g / omega^2`."""
    return 2.0 * STANDARD_GRAVITY / (2.0 * pi * frequency) ** 2


@checked
def liquid_column_optimum(mass_ratio: Positive, width_ratio: Level) -> tuple[float, float]:
    """Frequency ratio and damping ratio of a liquid column for the least displacement under white noise.

    `sqrt(1 + mu (1 - alpha^2 / 2)) / (1 + mu)` and `alpha / 2 sqrt(mu (1 + mu - alpha^2 mu / 4) / ((1 + mu) (1 + mu -
    alpha^2 mu / 2)))`, of an undamped structure of one coordinate under a force (Yalla, Kareem, J. Struct. Eng. 126(8),
    2000, 906-915), with the mass ratio mu of liquid and structure and the width ratio alpha, horizontal over whole
    length of the column.
    """
    mu, square = mass_ratio, width_ratio**2
    frequency = sqrt(1.0 + mu * (1.0 - square / 2.0)) / (1.0 + mu)
    within = mu * (1.0 + mu - square * mu / 4.0) / ((1.0 + mu) * (1.0 + mu - square * mu / 2.0))
    return frequency, width_ratio / 2.0 * sqrt(within)


@checked
def head_loss_of(ratio: NotNegative, frequency: Positive, rms_velocity: Positive) -> float:
    """Coefficient of head loss xi that has a damping ratio at an rms velocity sigma of the liquid [m/s].

    By equivalent linearisation for a Gaussian velocity, `xi |y'| y' / 2` has the mean slope `xi sqrt(2 / pi) sigma`:
    `xi = 2 ratio omega L sqrt(pi / 2) / sigma` (Yalla, Kareem 2000), at the frequency [Hz] of the liquid on the fixed
    floor.
    """
    return 2.0 * ratio * 2.0 * pi * frequency * column_length(frequency) * sqrt(pi / 2.0) / rms_velocity


@checked
def with_optimal_liquid_column(
    building: Building,
    *,
    floor: Floor,
    width_ratio: WidthRatio,
    mass_ratio: MassRatio,
    rms_velocity: Annotated[
        Positive,
        Says("velocity of the liquid at which its damping is the optimum; with mass_ratio", unit="m/s"),
    ],
    mode: TunedMode = 1,
    name: Name = "liquid column",
) -> Building:
    """The building with a liquid column tuned to a mode by the optimum of `liquid_column_optimum`.

    The loss of head is quadratic, so that the damping of a liquid column grows with its motion.

    Raises
    ------
    SettingError
        If a number is out of range, or the mode does not exist or does not move the floor.
    """
    omega, _, entry = mode_at_floor(building, floor, mode, name)
    mass = mass_ratio * _mass_of_ratio(building, entry)
    frequency_ratio, ratio = liquid_column_optimum(mass * entry**2, width_ratio)
    frequency = frequency_ratio * omega / (2.0 * pi)
    return with_liquid_column(
        building,
        floor=floor,
        mass=mass,
        frequency=frequency,
        width_ratio=width_ratio,
        head_loss=head_loss_of(ratio, frequency, rms_velocity),
        name=name,
    )


Tuning = tuple[float, float]
"""Frequency of the tuned mass over the frequency of the mode, and damping ratio of the tuned mass."""


def den_hartog(mass_ratio: float, _: float) -> Tuning:
    """Tuning for the least peak displacement of an undamped structure under a harmonic force.

    `1 / (1 + mu)` and `sqrt(3 mu / (8 (1 + mu)))` (Den Hartog, Mechanical Vibrations, 1956, ch. 3).
    """
    mu = mass_ratio
    return 1.0 / (1.0 + mu), sqrt(3.0 * mu / (8.0 * (1.0 + mu)))


def warburton(mass_ratio: float, _: float) -> Tuning:
    """Tuning for the least rms displacement of an undamped structure under white ground acceleration.

    `sqrt(1 - mu / 2) / (1 + mu)` and `sqrt(mu (1 - mu / 4) / (4 (1 + mu) (1 - mu / 2)))` (Warburton, Earthquake Eng.
    Struct. Dyn. 10, 1982, 381-401).
    """
    mu = mass_ratio
    damping_ratio = sqrt(mu * (1.0 - mu / 4.0) / (4.0 * (1.0 + mu) * (1.0 - mu / 2.0)))
    return sqrt(1.0 - mu / 2.0) / (1.0 + mu), damping_ratio


def sadek(mass_ratio: float, damping_ratio: float) -> Tuning:
    """Tuning for equal damping in both modes of structure and tuned mass.

    `(1 - beta sqrt(mu / (1 + mu))) / (1 + mu)` and `beta / (1 + mu) + sqrt(mu / (1 + mu))`, where beta is the
    damping ratio of the mode (Sadek, Mohraz, Taylor, Chung, Earthquake Eng. Struct. Dyn. 26, 1997, 617-635).
    """
    mu, beta = mass_ratio, damping_ratio
    share = sqrt(mu / (1.0 + mu))
    return (1.0 - beta * share) / (1.0 + mu), beta / (1.0 + mu) + share


TUNINGS: Final[Mapping[str, Callable[[float, float], Tuning]]] = {
    "den_hartog": den_hartog, "warburton": warburton, "sadek": sadek
}  # fmt: skip


@checked
def with_tuned_mass(
    building: Building,
    *,
    floor: Floor,
    mass: Annotated[Positive, Says("mass", unit="kg")],
    frequency: Annotated[
        Positive, Says("frequency of the mass on its spring, on the fixed floor", unit="Hz")
    ],
    ratio: Annotated[NotNegative, Says("damping ratio of that motion", usual=ADDED)],
    name: Name = "tuned mass",
) -> Building:
    """The building with a mass on a floor, attached by a spring and a dashpot.

    Its displacement relative to the ground is a new coordinate but not a floor; its stroke is appended to the storeys
    under the name `name`.
    """
    row = building.floor_row(floor)
    omega = 2.0 * np.pi * frequency
    stroke = np.append(-row, 1.0)
    return with_coordinate(
        building,
        mass=mass,
        damping=2.0 * ratio * mass * omega,
        stiffness=mass * omega**2,
        follows_ground=float(row @ building.influence),
        stroke=stroke,
        stroke_name=name,
        added=f"{name} of {mass:g} kg, {frequency:g} Hz, {ratio:g}",
    )


@checked
def with_optimal_tuned_mass(
    building: Building,
    *,
    floor: Floor,
    mass_ratio: MassRatio,
    tuning: Annotated[
        Literal["warburton", "den_hartog", "sadek"],
        Says("published optimum, warburton for ground motion; with mass_ratio"),
    ] = "warburton",
    mode: TunedMode = 1,
    name: Name = "tuned mass",
) -> Building:
    """The building with a mass on a floor, tuned to a mode by a published optimum.

    The optima are derived for a single mass; the effective mass of a mode at a floor where its shape has the entry p is
    `1 / p^2`, with phi' M phi = 1.

    Raises
    ------
    SettingError
        If the mass ratio is not positive, there is no such mode, the mode does not move the floor, or the tuned mass
        is at least twice the effective mass of the mode.
    """
    omega, damping_ratio, entry = mode_at_floor(building, floor, mode, name)
    mass = mass_ratio * _mass_of_ratio(building, entry)
    modal_ratio = mass * entry**2
    if not modal_ratio < 2.0:
        raise SettingError(
            f"{name} on {building.name}: its mass is {modal_ratio:.3g} times the mass of mode {mode} at this floor; "
            "the optima hold for small ratios, give a smaller mass"
        )
    frequency_ratio, ratio = TUNINGS[tuning](modal_ratio, damping_ratio)
    return with_tuned_mass(
        building,
        floor=floor,
        mass=mass,
        frequency=frequency_ratio * omega / (2.0 * np.pi),
        ratio=ratio,
        name=name,
    )


def _mass_of_ratio(building: Building, entry: float) -> float:
    """What mass ratios are of: the building, or its mode of this `entry` at the floor if nothing follows the ground."""
    return building.total_mass if building.follows_ground else 1.0 / entry**2
