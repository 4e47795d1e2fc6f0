"""Cases that share one set of weights: buildings of other stiffness, soils, draws of the dampers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import Count, Positive, checked
from mrwork.buildings.devices import Device, elongation_rows
from mrwork.buildings.matrices import Building
from mrwork.motions.spectral_density import KanaiTajimi, SpectralDensity
from mrwork.simulate import Loading, simulate_force
from mrwork.summary import Summarised


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DesignCase(Summarised):
    """A building under a spectrum of ground acceleration, one of those that a design averages over.

    The buildings of all cases have the same coordinates, floors and storeys.
    """

    _made_by: ClassVar[str] = "mr.control.stiffness_cases(building)"

    name: str
    building: Building
    spectrum: SpectralDensity = field(default_factory=KanaiTajimi)


@checked
def stiffness_cases(
    building: Building,
    factors: Sequence[Positive] = (0.75, 1.0, 1.25),
    spectrum: SpectralDensity | None = None,
) -> tuple[DesignCase, ...]:
    """The building with its stiffness multiplied by each factor; the damping matrix stays.

    Raises
    ------
    SettingError
        If a factor is not positive.
    """
    spectrum = KanaiTajimi() if spectrum is None else spectrum
    return tuple(
        DesignCase(
            name=f"stiffness x {factor:g}",
            building=replace(building, stiffness=factor * building.stiffness),
            spectrum=spectrum,
        )
        for factor in factors
    )


@checked
def soil_cases(building: Building, spectra: Sequence[SpectralDensity]) -> tuple[DesignCase, ...]:
    """The building under each spectrum."""
    return tuple(
        DesignCase(name=f"{spectrum.name} {number + 1}", building=building, spectrum=spectrum)
        for number, spectrum in enumerate(spectra)
    )


@checked
def damper_cases(
    building: Building,
    devices: Sequence[Device],
    *,
    amplitude: Positive,
    frequency: Positive,
    spectrum: SpectralDensity | None = None,
    most: Count = 8,
) -> tuple[DesignCase, ...]:
    """The building with the dampers at zero command as springs and dashpots, for draws of their parameters.

    The force of a damper at zero command is replaced by `k x + c v` of the same work and the same force at the largest
    displacement in a sinusoid (equivalent linearisation). Budgets are then of the force beyond it.

    Parameters
    ----------
    devices
        With draws: `theta` of shape (n_draws, n_params).
    amplitude, frequency
        Of the sinusoid [m, Hz], as in the motions to come.
    most
        Number of draws, evenly taken from those of the devices.

    Raises
    ------
    SettingError
        If there is no device, or it does not fit the building.
    """
    rows = elongation_rows(building, devices)
    n_draws = min(len(device.draws) for device in devices)
    spectrum = KanaiTajimi() if spectrum is None else spectrum
    chosen = np.unique(np.linspace(0, n_draws - 1, min(most, n_draws)).round().astype(int))
    found = []
    for draw in chosen:
        stiffness, damping = building.stiffness.copy(), building.damping.copy()
        for device, row in zip(devices, rows, strict=True):
            k, c = _linearised(device, device.draws[draw], amplitude, frequency)
            stiffness += k * np.outer(row, row)
            damping += c * np.outer(row, row)
        found.append(
            DesignCase(
                name=f"draw {draw + 1} of the dampers",
                building=replace(building, stiffness=stiffness, damping=damping),
                spectrum=spectrum,
            )
        )
    return tuple(found)


def _linearised(
    device: Device, theta: NDArray[np.float64], amplitude: float, frequency: float
) -> tuple[float, float]:
    """Stiffness [N/m] and damping [N s/m] of all dampers of a device at zero command, over the last cycle of three."""
    samples = 400
    w = 2.0 * np.pi * frequency
    time = np.arange(3 * samples + 1) / (samples * frequency)
    x, v = amplitude * np.sin(w * time), amplitude * w * np.cos(w * time)
    force = np.zeros_like(x)
    for sign in (1.0, -1.0) if device.differential else (1.0,):
        current = device.spec.current
        loading = Loading(
            dt=float(time[1]),
            displacement=sign * x,
            velocity=sign * v,
            command=None if current is None else 0.0,
            command_unit=None if current is None else current.unit,
        )
        force += sign * device.count * simulate_force(device.spec, theta, loading)
    cycle = slice(2 * samples, 3 * samples)
    force = force - force[cycle].mean()
    k = 2.0 * float(np.mean(force[cycle] * np.sin(w * time[cycle]))) / amplitude
    c = 2.0 * float(np.mean(force[cycle] * np.cos(w * time[cycle]))) / (amplitude * w)
    return max(k, 0.0), max(c, 0.0)
