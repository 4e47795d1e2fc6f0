"""The linear system of a weight design in scaled coordinates: building, devices and the filter of the ground.

`x' = A x + B u + noise`, with u the desired force of each device.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from mrwork.base.values import Floats, array_dataclass
from mrwork.control.linear.plant import Plant, deformation_rates
from mrwork.control.linear.riccati import LyapunovEquations, mean_squares
from mrwork.control.weights.limits import LimitedOutputs, RmsLimits
from mrwork.errors import SettingError
from mrwork.motions.spectral_density import SpectralDensity


@array_dataclass()
class DesignSystem:
    """A plant under its spectrum as the design sees it, in scaled coordinates x, shape (n_states,).

    `ground` is the intensity of the white noise behind the spectrum and `uncontrolled` the covariance of x without
    control, shapes (n_states, n_states). The limited outputs are `y = C x + D u` in SI, the rates of elongation of the
    devices `rates @ x` [m/s]. The state of the building is `s = state @ x`, and its lowest frequency `frequency`
    [rad/s].
    """

    A: Floats
    B: Floats
    ground: Floats
    C: Floats
    D: Floats
    rates: Floats
    state: Floats
    uncontrolled: Floats
    frequency: float

    def rms_without_control(self) -> Floats:
        """Rms of each limited output without device forces, shape (n_outputs,)."""
        return np.asarray(np.sqrt(mean_squares(self.C, self.uncontrolled)))

    def in_units(self, units: Floats) -> DesignSystem:
        """The system with states in other units: x = units * (new x), shape (n_states,)."""
        return replace(
            self,
            A=self.A / units[:, None] * units,
            B=self.B / units[:, None],
            ground=self.ground / np.outer(units, units),
            C=self.C * units,
            rates=self.rates * units,
            state=self.state * units,
            uncontrolled=self.uncontrolled / np.outer(units, units),
        )


def design_system(
    plant: Plant, outputs: LimitedOutputs, spectrum: SpectralDensity, *, n_modes: int | None = None
) -> DesignSystem:
    """The system of a design in modal coordinates over their rms without control.

    On a road velocities are absolute, of which laws read the state there. The `n_modes` lowest modes of the building,
    or all, are coordinates; the other modes follow forces and ground at once, as `0 = A_21 x_1 + A_22 x_2 + B_2 u`.
    """
    building, n = plant.building, plant.n_coordinates
    soil = spectrum.filter_matrices()
    named, elongations = outputs.of_plant(plant), deformation_rates(plant)
    E, G, of_rates = plant.E, named.G, np.zeros(plant.n_devices)
    if soil.of_velocity:
        # As in `observer_of` under a white velocity.
        E, G, of_rates = plant.A @ E, named.C @ E, elongations.C @ E
    shapes, n_soil = building.modes, len(soil.state)
    modes = scipy.linalg.block_diag(shapes, shapes)
    into = scipy.linalg.block_diag(shapes.T @ building.mass, shapes.T @ building.mass)
    A = np.block(
        [
            [into @ plant.A @ modes, np.outer(into @ E, soil.output)],
            [np.zeros((n_soil, 2 * n)), soil.state],
        ]
    )
    B = np.vstack([into @ plant.B, np.zeros((n_soil, plant.n_devices))])
    C, D = np.hstack([named.C @ modes, np.outer(G, soil.output)]), named.D
    rates = np.hstack([elongations.C @ modes, np.outer(of_rates, soil.output)])
    state = np.pad(modes, ((0, 0), (0, n_soil)))
    if n_modes is not None and n_modes < n:
        fast = np.arange(2 * n + n_soil) % n >= n_modes
        fast[2 * n :] = False
        follows = -np.linalg.solve(A[np.ix_(fast, fast)], np.hstack([A[np.ix_(fast, ~fast)], B[fast]]))
        of_state, of_force = np.split(follows, [int(np.sum(~fast))], axis=1)
        B, D = B[~fast] + A[np.ix_(~fast, fast)] @ of_force, D + C[:, fast] @ of_force
        A, C, rates, state = (
            rows[:, ~fast] + rows[:, fast] @ of_state for rows in (A[~fast], C, rates, state)
        )
    noise = np.zeros((len(A), 1))
    noise[-n_soil:, 0] = soil.noise
    ground = 2.0 * np.pi * spectrum.intensity * noise @ noise.T
    try:
        covariance = LyapunovEquations(A).covariance(ground)
    except SettingError as error:
        raise SettingError(
            f"{building.name} has a mode without damping, so that its rms values do not exist; give every mode damping"
        ) from error
    # A variance of zero may be rounded below it; a mode that the ground does not excite still needs a scale.
    rms = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    rms = np.maximum(rms, 1e-9 * rms.max())
    in_si = DesignSystem(
        A=A,
        B=B,
        ground=ground,
        C=C,
        D=D,
        rates=rates,
        state=state,
        uncontrolled=covariance,
        frequency=float(building.frequencies[0]),
    )
    return in_si.in_units(rms)


USEFUL_SHARE = 0.2
"""Rms force over the inertia of the building beyond which more force hardly lowers any rms response."""


def useful_force(plant: Plant, spectrum: SpectralDensity) -> float:
    """Rms force [N] beyond which limits have no use for more: a fifth of the rms inertia without control.

    The inertia is the mass of the building times the largest rms acceleration of a floor. With this force in its first
    storey the least ratio of the rms drifts of the five-storey frame is within 4 % of that with any force.
    """
    limits = LimitedOutputs.of(RmsLimits(rms_acceleration=1.0), plant)
    system = design_system(plant, limits, spectrum)
    return USEFUL_SHARE * plant.building.total_mass * float(system.rms_without_control().max())
