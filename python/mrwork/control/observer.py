"""A Kalman observer at the sample time of the controller: estimates the state from measurements."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from mrwork.arguments import NotNegative, Positive, Within, checked
from mrwork.control.plant import Outputs, Plant, check_outputs
from mrwork.control.riccati import RiccatiStatus, kalman_gains
from mrwork.errors import SettingError
from mrwork.summary import Summarised
from mrwork.values import Floats, holds_arrays


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Observer(Summarised):
    """`x_{k+1} = Ad x_k + Bd f_k + L (y_k - C x_k - D f_k)`: x_k is the state predicted before y_k is measured.

    Parameters
    ----------
    Ad, Bd
        Transition over a sample with the forces held, shapes (2n, 2n), (2n, n_devices).
    gain
        L, shape (2n, n_measurements).
    C, D, names
        The measurements, shapes (n_measurements, 2n), (n_measurements, n_devices).
    sample_time
        [s].
    covariance
        Of the error of x_k for noise of the given intensities, shape (2n, 2n).
    """

    _units: ClassVar[Mapping[str, str]] = {"sample_time": "s"}

    Ad: Floats
    Bd: Floats
    gain: Floats
    C: Floats
    D: Floats
    names: tuple[str, ...]
    sample_time: float
    covariance: Floats


@checked
def observer_of(
    plant: Plant,
    measurements: Outputs,
    sample_time: Positive,
    *,
    ground_intensity: Positive = 1.0,
    noise_intensity: Annotated[ArrayLike, Within(above=0.0)] | None = None,
    unmodelled: NotNegative = 1e-6,
) -> Observer:
    """The steady Kalman filter for a white ground acceleration and white, independent sensor noise.

    The device forces are measured. Over a sample all inputs are held; the ground acceleration has the variance
    `ground_intensity` / Ts and each sensor that of its intensity / Ts, so that the gain tends to that of the continuous
    filter as Ts goes to zero. The gain depends on the ratio of the intensities only; the covariance scales with them.

    Parameters
    ----------
    measurements
        Accelerations of floors and deformations of devices; see `accelerations`, `deformations` and `stacked`.
    sample_time
        Ts of the controller [s].
    ground_intensity
        S_ag, two-sided, of the ground acceleration [(m/s^2)^2/Hz].
    noise_intensity
        S_v of each measurement, in its unit squared per Hz: one number or shape (n_measurements,). The default is
        S_ag / 50 for all, in SI, as in Dyke et al., Smart Mater. Struct. 5, 1996, 565-575.
    unmodelled
        White noise on every scaled coordinate, as a fraction of that of the ground. Without it, the error of a
        coordinate that the ground does not excite, such as an undamped brace, would not decay.

    Raises
    ------
    SettingError
        If an undamped mode is not observable.
    """
    check_outputs(plant, measurements)
    n_measurements = len(measurements.names)
    noise = np.asarray(
        ground_intensity / 50.0 if noise_intensity is None else noise_intensity, dtype=np.float64
    )
    if n_measurements == 0 or noise.shape not in ((), (n_measurements,)):
        raise SettingError(
            f"`noise_intensity` has shape {noise.shape} for {n_measurements} measurements; "
            f"give one number for each of one or more measurements"
        )
    noise = np.broadcast_to(noise, n_measurements)
    Ad, Bd, Ed = _hold_input(plant, sample_time)
    covariance, gain = _filter(
        plant, Ad, Ed, measurements, ground_intensity / sample_time, noise / sample_time, unmodelled
    )
    return Observer(
        Ad=Ad,
        Bd=Bd,
        gain=gain,
        C=measurements.C,
        D=measurements.D,
        names=measurements.names,
        sample_time=sample_time,
        covariance=covariance,
    )


def _hold_input(plant: Plant, sample_time: float) -> tuple[Floats, Floats, Floats]:
    """Transition over one sample with held inputs (zero-order hold), by the exponential of [A B E; 0 0 0]."""
    size = 2 * plant.n_coordinates
    T = plant.scaling
    A_z = np.linalg.solve(T, plant.A @ T)
    inputs = np.column_stack([plant.B, plant.E])
    inputs_z = np.linalg.solve(T, inputs)
    whole = np.zeros((size + inputs.shape[1], size + inputs.shape[1]))
    whole[:size] = np.hstack([A_z, inputs_z]) * sample_time
    exponential = scipy.linalg.expm(whole)
    Ad = T @ exponential[:size, :size] @ np.linalg.inv(T)
    held = T @ exponential[:size, size:]
    return Ad, held[:, :-1], held[:, -1]


def _filter(
    plant: Plant,
    Ad: Floats,
    Ed: Floats,
    measurements: Outputs,
    ground: float,
    noise: Floats,
    unmodelled: float,
) -> tuple[Floats, Floats]:
    """Covariance of the error and gain, from the Riccati equation in z with sensors scaled by their noise."""
    T = plant.scaling
    deviation = np.sqrt(noise)
    A_z = np.linalg.solve(T, Ad @ T)
    E_z = np.linalg.solve(T, Ed) * np.sqrt(ground)
    C_z = measurements.C @ T / deviation[:, None]
    G_z = measurements.G * np.sqrt(ground) / deviation
    # Scale of the state such that the process noise of a step is 1, as that of the sensors is.
    unit = float(np.linalg.norm(E_z))
    E_z, C_z = E_z / unit, C_z * unit
    found = kalman_gains(
        A_z,
        C_z,
        np.outer(E_z, E_z) + unmodelled * np.eye(len(E_z)),
        # The ground noise enters the sensors directly.
        np.eye(len(deviation)) + np.outer(G_z, G_z),
        np.outer(E_z, G_z),
        time="discrete",
        scaling=np.eye(len(E_z)),
        threads=1,
    )
    if found.status[0] == RiccatiStatus.NO_STABILISING_SOLUTION:
        raise SettingError(
            "no observer is stable with these measurements; add a measurement in which every undamped mode is "
            "observable"
        )
    if not found.solved[0]:
        raise SettingError(
            f"the Riccati equation of the observer is met to {found.residual[0]:.1e} of its terms; give intensities of "
            "less extreme ratio, or measure more"
        )
    return unit**2 * T @ found.P[0] @ T.T, unit * T @ found.gain[0] / deviation
