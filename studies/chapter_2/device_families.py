"""The device families of chapter 2 on the five-storey frame, each with the settings that are tried.

A mass or a liquid is 2 % of the mass of the frame; every semi-active device has the driver of the RD-1005-3. Devices
act between ground and floor 1, masses and liquids stand on the roof.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

import mrwork as mr
from mrwork.buildings import Building, PassiveElement
from mrwork.closed_loop import STANDARD_GRAVITY
from studies.former.arrays import Floats
from studies.former.damper import driven
from studies.former.frame import DRIVER_RATE, FRAME, LARGEST_CURRENT, actuator, pair, regulators

Group = Literal["passive", "semi-active", "active"]

WEIGHT = FRAME.total_mass * STANDARD_GRAVITY
ROOF, STOREY = "floor 5", "storey 1"
MASS_RATIO = 0.02
SLAB, PERIOD = 330.0, 2.0
"""Mass of the slab [kg] and period of the isolated frame [s]."""
WIDTH_RATIO = 0.7
_STOREY_STIFFNESS = 1.448e6
_CONTROL_WEIGHTS = np.geomspace(1e-12, 1e-4, 13)


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """A device with one choice of its settings, and the candidates of its law; one candidate without a law."""

    settings: dict[str, float]
    building: Building
    device: mr.Device | None = None
    law: mr.ControlLaw | None = None
    control_weights: tuple[float, ...] = ()


Variants = Callable[[bool], Iterator[Variant]]


@dataclass(frozen=True, slots=True)
class Family:
    """A family of devices: what it needs, and its variants, fewer of them in the quick form."""

    name: str
    group: Group
    needs: str
    variants: Variants


def _some(values: Sequence[float] | Floats, quick: bool) -> list[float]:
    """The values, or two of them."""
    chosen = [float(value) for value in values]
    return chosen[len(chosen) // 3 :: max(1, len(chosen) // 3)][:2] if quick else chosen


def _viscous(quick: bool) -> Iterator[Variant]:
    for damping in _some(np.geomspace(3e3, 3e5, 9), quick):
        frame = mr.buildings.with_viscous_damper(FRAME, storey=STOREY, damping=damping)
        yield Variant(settings={"damping [N s/m]": damping}, building=_told(frame, STOREY, damping=damping))


def _yielding(quick: bool) -> Iterator[Variant]:
    for force in _some(np.geomspace(0.01, 0.4, 9), quick):
        for displacement in (5e-4,) if quick else (2.5e-4, 5e-4, 1e-3):
            yield Variant(
                settings={"yield force / weight": force, "yield displacement [mm]": 1e3 * displacement},
                building=mr.buildings.with_yielding_damper(
                    FRAME, storey=STOREY, yield_force=force * WEIGHT, yield_displacement=displacement
                ),
            )


def _friction(quick: bool) -> Iterator[Variant]:
    for load in _some(np.geomspace(0.005, 0.4, 14), quick):
        yield Variant(
            settings={"slip load / weight": load},
            building=mr.buildings.with_friction_damper(
                FRAME, storey=STOREY, slip_load=load * WEIGHT, stiffness=_STOREY_STIFFNESS
            ),
        )


def _lead_rubber(quick: bool) -> Iterator[Variant]:
    for strength in _some(np.geomspace(0.005, 0.12, 8), quick):
        yield Variant(
            settings={"strength of the lead / weight": strength},
            building=mr.buildings.with_lead_rubber_bearings(
                FRAME,
                mass=SLAB,
                period=PERIOD,
                ratio=0.02,
                yield_force=strength * WEIGHT,
                yield_displacement=5e-3,
            ),
        )


def _tuned_mass(quick: bool) -> Iterator[Variant]:
    for tuning in ("warburton",) if quick else mr.buildings.TUNINGS:
        yield Variant(
            settings={"frequency ratio": mr.buildings.TUNINGS[tuning](MASS_RATIO, 0.01).frequency_ratio},
            building=_told(
                mr.buildings.with_optimal_tuned_mass(FRAME, floor=ROOF, mass_ratio=MASS_RATIO, tuning=tuning),
                "tuned mass",
            ),
        )


def _liquid_column(quick: bool) -> Iterator[Variant]:
    for velocity in _some(np.geomspace(0.02, 2.0, 9), quick):
        yield Variant(settings={"design rms velocity [m/s]": velocity}, building=_with_column(velocity))


def _with_column(rms_velocity: float) -> Building:
    return mr.buildings.with_optimal_liquid_column(
        FRAME, floor=ROOF, mass_ratio=MASS_RATIO, width_ratio=WIDTH_RATIO, rms_velocity=rms_velocity
    )


def _orifice(quick: bool) -> Iterator[Variant]:
    for loss in _some(np.geomspace(1e6, 1e8, 5), quick):
        device = _valve(FRAME, STOREY, "orifice", d=(0.02 * loss, 0.98 * loss), c=500.0)
        yield _clipped({"largest head loss [N s2/m2]": loss}, FRAME, device, quick)


def _variable_friction(quick: bool) -> Iterator[Variant]:
    for load in _some(np.geomspace(0.03, 0.3, 5), quick):
        force = load * WEIGHT
        device = _valve(FRAME, STOREY, "bingham", f_c=(0.02 * force, 0.98 * force), v_s=2e-3, c0=100.0)
        yield _clipped({"largest slip load / weight": load}, FRAME, device, quick)


def _resettable(quick: bool) -> Iterator[Variant]:
    law = mr.ControlLaw(name="maximum_energy_dissipation", gains={})
    for stiffness in _some(np.geomspace(0.1, 4.0, 9) * _STOREY_STIFFNESS, quick):
        # Full command closes the valve: the spring then lets go within a second, without command within 2 ms. Equal
        # changes of the command are equal ratios of the time, so that the lag of the driver opens the valve soon.
        device = _valve(FRAME, STOREY, "maxwell", k=stiffness, tau=(0.0, 2e-3, np.log(500.0)), c=100.0)
        yield Variant(
            settings={"stiffness / storey": stiffness / _STOREY_STIFFNESS},
            building=FRAME,
            device=device,
            law=law,
        )


def _valved_column(quick: bool) -> Iterator[Variant]:
    frame = _with_column(1.0)
    (column,) = frame.elements
    # The valve has the head loss instead of a fixed orifice.
    bare = replace(frame, elements=())
    for factor in _some((3.0, 10.0, 30.0, 100.0), quick):
        least = column.head_loss / 3.0
        device = _valve(bare, "liquid column", "orifice", d=(least, (factor - 1.0) * least), c=1e-2)
        yield _clipped({"largest / least head loss": factor}, bare, device, quick)


def _magnetorheological(quick: bool) -> Iterator[Variant]:
    for share in (0.7,) if quick else (0.4, 0.7, 1.0):
        device = _pair(FRAME, STOREY, share)
        yield _clipped({"largest current [A]": device.largest_command}, FRAME, device, quick)


def _smart_isolation(quick: bool) -> Iterator[Variant]:
    frame = mr.buildings.with_lead_rubber_bearings(
        FRAME, mass=SLAB, period=PERIOD, ratio=0.02, yield_force=0.005 * WEIGHT, yield_displacement=5e-3
    )
    for share in (0.2,) if quick else (0.02, 0.1, 0.2, 0.4):
        device = _pair(frame, "isolation", share)
        yield _clipped({"largest current [A]": device.largest_command}, frame, device, quick)


def _bracing(quick: bool) -> Iterator[Variant]:
    yield _actuated(FRAME, STOREY, {}, quick)


def _mass_driver(quick: bool) -> Iterator[Variant]:
    for frequency in (1.0,) if quick else (0.5, 1.0, 2.0):
        frame = mr.buildings.with_tuned_mass(
            FRAME, floor=ROOF, mass=MASS_RATIO * FRAME.total_mass, frequency=frequency, ratio=0.1
        )
        yield _actuated(frame, "tuned mass", {"frequency of the mass [Hz]": frequency}, quick)


def _hybrid(quick: bool) -> Iterator[Variant]:
    frame = mr.buildings.with_optimal_tuned_mass(FRAME, floor=ROOF, mass_ratio=MASS_RATIO)
    yield _actuated(frame, "tuned mass", {}, quick)


FAMILIES = (
    Family("Viscous damper", "passive", "nothing", _viscous),
    Family("Yielding damper (ADAS)", "passive", "new plates after strong motions", _yielding),
    Family("Friction damper (Pall)", "passive", "nothing; may stay displaced", _friction),
    Family("Lead-rubber bearings", "passive", "a slab and a gap about it", _lead_rubber),
    Family("Tuned mass, 2 %", "passive", "33 kg on the roof and a path", _tuned_mass),
    Family("Liquid column, 2 %", "passive", "33 kg of liquid in a tall tube", _liquid_column),
    Family("Variable orifice", "semi-active", "sensors, a computer, a valve", _orifice),
    Family("Variable friction", "semi-active", "sensors, a computer, a clamp", _variable_friction),
    Family("Resettable stiffness", "semi-active", "the force and rate of the device, a valve", _resettable),
    Family(
        "Liquid column with valve, 2 %",
        "semi-active",
        "sensors, a computer, a valve, a tall tube",
        _valved_column,
    ),
    Family(
        "Pair of RD-1005-3 (MR)",
        "semi-active",
        "sensors, a computer, a current of 2 A",
        _magnetorheological,
    ),
    Family(
        "Bearings and pair of RD-1005-3",
        "semi-active",
        "a slab, a gap, sensors, a computer, a current of 2 A",
        _smart_isolation,
    ),
    Family("Active bracing", "active", "sensors, a computer, power", _bracing),
    Family("Active mass driver, 2 %", "active", "33 kg, a path, sensors, a computer, power", _mass_driver),
    Family("Hybrid mass damper, 2 %", "active", "33 kg, a path, sensors, a computer, power", _hybrid),
)


def _told(frame: Building, storey: str, *, damping: float | None = None) -> Building:
    """A building with an element that has the force of a linear device which its matrices hold already."""
    row = frame.storey_row(storey)
    if damping is None:
        # The last coordinate is the mass on its spring and dashpot.
        stiffness, damping = float(frame.stiffness[-1, -1]), float(frame.damping[-1, -1])
    else:
        stiffness = 0.0
    element = PassiveElement(name=f"device in {storey}", row=row, stiffness=stiffness, damping=damping)
    return replace(frame, elements=(*frame.elements, element))


def _valve(frame: Building, storey: str, model: str, **parameters: float | tuple[float, ...]) -> mr.Device:
    """A device whose parameter with coefficients follows a command from 0 to 1, behind the lag of the driver."""
    spec, theta = driven(model, parameters, unit="V", rate=DRIVER_RATE, of_three="exponential")
    return mr.Device(name=storey, spec=spec, theta=theta, row=frame.storey_row(storey), largest_command=1.0)


def _pair(frame: Building, storey: str, share: float) -> mr.Device:
    """Two RD-1005-3 in opposition, whose driver gives a share of the largest current."""
    return replace(pair(share * LARGEST_CURRENT), row=frame.storey_row(storey))


def _clipped(settings: dict[str, float], frame: Building, device: mr.Device, quick: bool) -> Variant:
    """Clipped-optimal control of a device, a candidate for each control weight."""
    return _regulated("clipped_optimal", settings, frame, device, quick)


def _actuated(frame: Building, storey: str, settings: dict[str, float], quick: bool) -> Variant:
    """An ideal actuator under linear quadratic control."""
    return _regulated("active", settings, frame, actuator(frame.storey_row(storey), storey), quick)


def _regulated(
    law: str, settings: dict[str, float], frame: Building, device: mr.Device, quick: bool
) -> Variant:
    weights = tuple(_some(_CONTROL_WEIGHTS, quick))
    designed = regulators(law, frame, device, weights)
    return Variant(settings=settings, building=frame, device=device, law=designed, control_weights=weights)


def column_height() -> tuple[float, float]:
    """Length of the liquid column of the frame, and of each of its upright legs [m]."""
    ratio, _ = mr.buildings.liquid_column_optimum(MASS_RATIO, WIDTH_RATIO)
    length = mr.buildings.column_length(ratio * float(FRAME.frequencies[0]))
    return length, 0.5 * (1.0 - WIDTH_RATIO) * length
