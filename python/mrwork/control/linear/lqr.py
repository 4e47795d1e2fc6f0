"""Linear quadratic regulators, with published weights, and the Kalman observer of a sampled loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from mrwork.base.arguments import NotNegative, Positive, Threads, checked
from mrwork.base.hints import Within
from mrwork.base.numbers import counted
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass, one_for_each
from mrwork.buildings.plane_building import Building
from mrwork.control.linear.plant import Outputs, Plant, check_outputs, hold_input, symmetric_part
from mrwork.control.linear.riccati import (
    RiccatiStatus,
    attempt_each,
    kalman_gains,
    only,
    regulator_gains,
    solve_together,
)
from mrwork.errors import InvalidSettingError, SettingError

MatrixRows = tuple[tuple[float, ...], ...]
"""A matrix, row by row."""
Weights = float | tuple[float, ...] | MatrixRows
"""One weight for all entries, a weight for each, or a symmetric matrix."""

_SMALLEST = 1e-9


def weight_matrix(name: str, given: ArrayLike, size: int, each: str) -> Floats:
    """A weight as a symmetric positive semidefinite matrix, shape (size, size).

    The weight is one number for all entries, one for each, or a matrix. Messages have its `name` and the noun of the
    entries, `each`, such as "storeys".
    """
    try:
        value = np.asarray(given, dtype=np.float64)
    except ValueError:
        raise InvalidSettingError(
            name, f"{name} has rows of different lengths; give {size} rows of {size}"
        ) from None
    if value.ndim == 0:
        value = np.full(size, float(value))
    matrix = np.diag(value) if value.ndim == 1 else value
    if matrix.shape != (size, size):
        count = f"{size} {each}" if size > 1 else f"1 {each.removesuffix('s')}"
        form = counted(value.size, "weight") if value.ndim == 1 else f"shape {value.shape}"
        raise InvalidSettingError(
            name,
            f"{name} has {form}, and there {'are' if size > 1 else 'is'} {count}; give one for each, or one for all, "
            f"or a symmetric {size} x {size} matrix",
        )
    if not np.isfinite(matrix).all():
        raise InvalidSettingError(name, f"{name} holds a value that is not a finite number")
    scale = np.sqrt(np.abs(np.diag(matrix)))
    # Checked with a unit diagonal, since the rows of a weight may have different units.
    divisor = np.where(scale > 0.0, scale, 1.0)
    scaled = matrix / np.outer(divisor, divisor)
    asymmetry = np.abs(scaled - scaled.T)
    if not np.all(asymmetry <= _SMALLEST * np.maximum(1.0, np.abs(scaled))):
        row, column = np.unravel_index(int(asymmetry.argmax()), asymmetry.shape)
        raise InvalidSettingError(
            name,
            f"{name} is not symmetric: row {row + 1}, column {column + 1} is {matrix[row, column]:g} and row "
            f"{column + 1}, column {row + 1} is {matrix[column, row]:g}; give a symmetric matrix",
        )
    smallest = float(np.linalg.eigvalsh(symmetric_part(scaled))[0])
    if smallest < -_SMALLEST:
        raise InvalidSettingError(
            name,
            f"{name} is not positive semidefinite: with a unit diagonal its smallest eigenvalue is {smallest:.3g}; "
            "give weights that are not negative, and a matrix without negative eigenvalues",
        )
    return symmetric_part(matrix)


def plain_weight(numbers: Floats) -> Weights:
    """A weight as a setting has it: one number, one for each entry, or rows."""
    if numbers.ndim == 2:
        return tuple(map(tuple, numbers.tolist()))
    return tuple(numbers.tolist()) if numbers.ndim else float(numbers)


@array_dataclass()
class Weighed:
    """Cost of the weights over a state s and device forces f: `s'Q s + 2 s'N f + f'S f`.

    Outputs y = C s + D f with weight W add `Q = C'W C`, `N = C'W D`, `S = D'W D`; N and S are zero unless accelerations
    are weighed.
    """

    _made_by: ClassVar[str] = "the `weigh_outputs` of mr.control.RegulatorSettings"

    Q: Floats
    N: Floats
    S: Floats


def weighed_outputs(outputs: Outputs, weights: Floats) -> Weighed:
    """Cost of a weight W of outputs, shape (n_outputs, n_outputs)."""
    C, D = outputs.C, outputs.D
    return Weighed(Q=C.T @ weights @ C, N=C.T @ weights @ D, S=D.T @ weights @ D)


def weighed_state(plant: Plant, weight: ArrayLike) -> Weighed:
    """Cost of a weight of the state: Q, shape (2n, 2n), or its diagonal."""
    Q, m = weight_matrix("state_weight", weight, 2 * plant.n_coordinates, "states"), plant.n_devices
    return Weighed(Q=Q, N=np.zeros((len(Q), m)), S=np.zeros((m, m)))


@array_dataclass(repr=False)
class Regulator(Summarised):
    """The regulator that minimises `int s'Q s + 2 s'N f + f'R f dt` over the forces f of the devices.

    `gain` is K of the desired force `f_c = -K s`, shape (n_devices, 2n), with the sign of a damper force: positive f_c
    resists elongation of the device. `riccati` is P of the cost to go s'P s, `vectors` B'P + N', one row for each
    device: with `sigma = vectors @ s` the desired forces are `-control_weight^-1 sigma`. `control_weight` is R plus D'W
    D of the weighted outputs, `poles` are the poles of the closed loop A - B K, and `residual` is the residual of the
    Riccati equation, relative to its terms.
    """

    _units: ClassVar[Mapping[str, str]] = {"poles": "1/s", "control_weight": "1/N^2"}

    gain: Floats
    riccati: Floats
    vectors: Floats
    control_weight: Floats
    poles: NDArray[np.complex128]
    residual: float


@checked
def regulator_of_outputs(
    plant: Plant, outputs: Outputs, weights: ArrayLike, control_weight: ArrayLike
) -> Regulator:
    """The regulator that weighs outputs y = C s + D f: `int y'W y + f'R f dt`.

    Hence `Q = C'W C`, `N = C'W D`, and D'W D is added to R. The cross term N matters for accelerations, which depend on
    the force directly.

    Parameters
    ----------
    weights
        W, in the inverse squares of the units of the outputs: one number for all, one for each, shape (n_outputs,), or
        a symmetric matrix, shape (n_outputs, n_outputs).
    control_weight
        R [1/N^2]: one number for all devices, one for each, or a matrix. The force of a device is the force of all its
        dampers together.

    Raises
    ------
    SettingError
        If a weight has the wrong shape or sign or is not symmetric, or the Riccati equation has no stabilising
        solution.

    Examples
    --------
    >>> # The acceleration of the third floor, as in Dyke et al. 1996
    >>> regulator = regulator_of_outputs(plant, accelerations(plant), [0, 0, 1], 1e-17)  # doctest: +SKIP
    """
    check_outputs(plant, outputs)
    W = weight_matrix("weights", weights, len(outputs.names), "outputs")
    return only(regulators_of_costs(plant, [(weighed_outputs(outputs, W), control_weight)], threads=1))


@checked
def regulator_of_state(plant: Plant, state_weight: ArrayLike, control_weight: ArrayLike) -> Regulator:
    """The regulator that weighs the state itself: `int s'Q s + f'R f dt`.

    Parameters
    ----------
    state_weight
        Q over s = [q; q'], shape (2n, 2n), or its diagonal. `plant.energy` weighs twice the energy of the building.
    control_weight
        R [1/N^2], as in `regulator_of_outputs`.

    Raises
    ------
    SettingError
        As `regulator_of_outputs`.
    """
    return only(regulators_of_costs(plant, [(weighed_state(plant, state_weight), control_weight)], threads=1))


@checked
def regulators_of_weights(
    plant: Plant,
    weighed: Sequence[Weighed | ArrayLike],
    control_weights: Sequence[ArrayLike] | Floats,
    *,
    threads: Threads = 0,
) -> tuple[Regulator | SettingError, ...]:
    """The regulators of many weights, by one call of the compiled solver; see `regulator_of_state`.

    Parameters
    ----------
    weighed
        For each regulator its state weight, as in `regulator_of_state`, or what the weights of its outputs and state
        add up to. A single weight holds for all regulators.
    control_weights
        R [1/N^2] of each regulator.

    Returns
    -------
    tuple
        For each weight a regulator, or the error that says why there is none; a failure leaves the other regulators
        alone.

    Examples
    --------
    >>> import numpy as np, mrwork as mr
    >>> frame = mr.building("uts")
    >>> plant = mr.control.plant_of(frame, [frame.storeys[0]])
    >>> designs = mr.control.regulators_of_weights(plant, [plant.energy], np.geomspace(1e-9, 1e-5, 200))
    >>> len(designs), designs[0].gain.shape
    (200, (1, 10))
    """
    if isinstance(control_weights, np.ndarray):
        control_weights = np.atleast_1d(control_weights)
    if len(weighed) == 1:
        weighed = [*weighed] * len(control_weights)
    if not weighed or len(weighed) != len(control_weights):
        raise SettingError(
            f"there are {len(weighed)} weights of outputs and state, and {len(control_weights)} control weights; give "
            "both for each of one or more regulators"
        )

    def cost(pair: tuple[Weighed | ArrayLike, ArrayLike]) -> tuple[Weighed, ArrayLike]:
        weight, control_weight = pair
        return weight if isinstance(weight, Weighed) else weighed_state(plant, weight), control_weight

    costs = attempt_each(cost, zip(weighed, control_weights, strict=True))
    return tuple(regulators_of_costs(plant, costs, threads))


def regulators_of_costs(
    plant: Plant, costs: Sequence[tuple[Weighed, ArrayLike] | SettingError], threads: int = 0
) -> list[Regulator | SettingError]:
    """Regulators of `int s'Q s + 2 s'N f + f'(R + S) f dt` in one call, with Q, N, S of weights and R of the forces.

    An error stands in the place of its regulator.
    """

    def matrices(cost: tuple[Weighed, ArrayLike] | SettingError) -> tuple[Floats, Floats, Floats]:
        weight, control_weight = only([cost])
        R = weight_matrix("control_weight", control_weight, plant.n_devices, "devices") + weight.S
        return weight.Q, R, weight.N

    return solve_together(lambda sound: _regulators(plant, sound, threads), attempt_each(matrices, costs))


def _regulators(
    plant: Plant, costs: Sequence[tuple[Floats, Floats, Floats]], threads: int
) -> list[Regulator | SettingError]:
    Q, R, N = (np.array(matrices) for matrices in zip(*costs, strict=True))
    solutions = regulator_gains(plant.A, plant.B, Q, R, N, scaling=plant.scaling, threads=threads)
    gain = np.where(solutions.solved[:, None, None], solutions.gain, 0.0)
    inverse = np.linalg.inv(plant.scaling)
    poles = np.linalg.eigvals(
        inverse @ plant.A @ plant.scaling - (inverse @ plant.B) @ (gain @ plant.scaling)
    ).astype(np.complex128)

    def regulator(row: int) -> Regulator:
        if solutions.status[row] == RiccatiStatus.WEIGHT_NOT_POSITIVE:
            raise SettingError(
                "the weight of the forces, with what the outputs add to it, is not positive definite; "
                "give a positive `control_weight`"
            )
        solutions.check(row)
        P = solutions.P[row]
        return Regulator(
            gain=gain[row],
            riccati=P,
            vectors=plant.B.T @ P + N[row].T,
            control_weight=R[row],
            poles=poles[row],
            residual=float(solutions.residual[row]),
        )

    return attempt_each(regulator, range(len(costs)))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class PublishedRegulator(Summarised):
    """Published weights: of the absolute acceleration of each floor [(s^2/m)^2], and R [1/N^2]."""

    _made_by: ClassVar[str] = "the setting `published` of a law"

    name: str
    weights: tuple[float, ...]
    control_weight: float
    source: str


PUBLISHED_REGULATORS = (
    # An independent simulation with this regulator has the results of the paper.
    PublishedRegulator(
        name="dyke1996",
        weights=(0.0, 0.0, 1.0),
        control_weight=1e-17,
        source="Dyke, Spencer, Sain, Carlson, Smart Mater. Struct. 5, 1996, 565-575; sampled every 0.5 ms, sensors: "
        "accelerations of all floors, deformation of the damper",
    ),
)


@array_dataclass(repr=False)
class Observer(Summarised):
    """`x_{k+1} = Ad x_k + Bd f_k + L (y_k - C x_k - D f_k)`: x_k is the state predicted before y_k is measured.

    Where the ground acceleration is measured, `Ed a_g` belongs to the state and `G a_g` to the measurements.

    Ad and Bd are the transition over a sample with the forces held, shapes (2n, 2n) and (2n, n_devices), `gain` is L,
    shape (2n, n_measurements). `covariance` is the covariance of the error of x_k for noise of the given intensities.
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
    Ed: Floats
    G: Floats


@checked
def observer_of(
    plant: Plant,
    measurements: Outputs,
    sample_time: Positive,
    *,
    noise_intensity: Annotated[ArrayLike, Within(above=0.0)] | None = None,
    unmodelled: NotNegative = 1e-6,
    white: Literal["acceleration", "velocity"] = "acceleration",
) -> Observer:
    """The steady Kalman filter for a white acceleration or velocity of the ground and white, independent sensor noise.

    The device forces are measured. Over a sample all inputs are held; the ground acceleration has the variance 1 / Ts
    [(m/s^2)^2] and the noise of each sensor its intensity / Ts, so that the gain tends to the gain of the continuous
    filter as Ts goes to zero. The gain depends on the ratio of the intensities only; the covariance scales with them.

    Parameters
    ----------
    measurements
        Accelerations of floors and deformations of devices; see `accelerations`, `deformations` and `stack_outputs`.
    sample_time
        Ts of the controller [s].
    noise_intensity
        S_v of each measurement, in its unit squared per Hz: one number or shape (n_measurements,). The ground has 1
        (m/s^2)^2/Hz, two-sided. The default is 1 / 50 for all, in SI, as in Dyke et al., Smart Mater. Struct. 5, 1996,
        565-575.
    unmodelled
        White noise on every scaled coordinate, as a fraction of the noise of the ground. Without it, the error of a
        coordinate that the ground does not excite, such as an undamped brace, would not decay.
    white
        What is white of the ground. Under a white velocity, as of a road, the state is [q; q' + r v_g]: displacements
        relative to the ground and absolute velocities, and the ground has 1 (m/s)^2/Hz.

    Raises
    ------
    SettingError
        If an undamped mode is not observable, or a measurement has the acceleration of the ground, whose velocity is
        white, in it.
    """
    check_outputs(plant, measurements)
    if not measurements.names:
        raise SettingError("there is no measurement; give one or more")
    intensities = 1.0 / 50.0 if noise_intensity is None else noise_intensity
    noise = one_for_each("noise_intensity", intensities, len(measurements.names), "measurement")
    T, ground = plant.scaling, 1.0 / sample_time
    E, G = plant.E, measurements.G
    if white == "velocity":
        if G.any():
            raise SettingError(
                "a white velocity of the ground has no acceleration, and one is in a measurement; measure absolute "
                "accelerations, elongations and drifts"
            )
        # With q' = z - r v_g and E = [0; -r]: x' = A [q; z] + A E v_g, y = C [q; z] + C E v_g.
        E, G = plant.A @ E, measurements.C @ E
    inputs = np.column_stack([plant.B, E])
    slope, pushed = (np.linalg.solve(T, matrix).astype(np.float64) for matrix in (plant.A @ T, inputs))
    F_z, held = hold_input(slope, pushed, sample_time)
    Ad, Bd, Ed = T @ F_z @ np.linalg.inv(T), (T @ held)[:, :-1], (T @ held)[:, -1]
    # The Riccati equation is solved in z, with sensors scaled by their noise.
    deviation = np.sqrt(noise / sample_time)
    A_z = np.linalg.solve(T, Ad @ T)
    E_z = np.linalg.solve(T, Ed) * np.sqrt(ground)
    C_z = measurements.C @ T / deviation[:, None]
    G_z = G * np.sqrt(ground) / deviation
    # Scale of the state such that the process noise of a step is 1, as the noise of the sensors is.
    unit = float(np.linalg.norm(E_z))
    if not unit:
        # The ground moves nothing, and of its noise the unmodelled part is a fraction.
        unit, unmodelled = 1.0, 0.0
    E_z, C_z = E_z / unit, C_z * unit
    solution = kalman_gains(
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
    if solution.status[0] == RiccatiStatus.NO_STABILISING_SOLUTION:
        raise SettingError(
            "no observer is stable with these measurements; add a measurement in which every undamped mode is "
            "observable"
        )
    if not solution.solved[0]:
        raise SettingError(
            f"the Riccati equation of the observer is met to {solution.residual[0]:.1e} of its terms; give "
            "intensities of less extreme ratio, or measure more"
        )
    return Observer(
        Ad=Ad,
        Bd=Bd,
        gain=unit * T @ solution.gain[0] / deviation,
        C=measurements.C,
        D=measurements.D,
        names=measurements.names,
        sample_time=sample_time,
        covariance=unit**2 * T @ solution.P[0] @ T.T,
        Ed=Ed,
        G=G,
    )


def kinematic_observer_of(
    building: Building, n_devices: int, storeys: Sequence[int], sample_time: float, noise_intensity: float
) -> Observer:
    """The observer of a motion of which floors, ground and these storeys are measured, without a model of the frame.

    Each coordinate is `q'' = a - r a_g` with the measured absolute acceleration a of its floor, held over a sample, and
    is corrected by the drifts: the steady Kalman filter of a double integrator, for white errors of the accelerations
    of intensity 1 and of the drifts of `noise_intensity`. It is as near on a frame that yields as on an elastic one. In
    the form of `Observer` accelerations and devices are measurements of which none is expected: C = D = 0.
    """
    n = building.n_coordinates
    if not np.array_equal(building.floors, np.eye(n)):
        raise SettingError(
            f"a kinematic observer takes the motion from the accelerations of floors, which are not the coordinates of "
            f"{building.name}; leave `kinematic` out"
        )
    rows = building.storeys[list(storeys)]
    if np.linalg.matrix_rank(rows) < n:
        raise SettingError(
            f"a kinematic observer is corrected by measured drifts, and the drifts of `measured_storeys` "
            f"({list(storeys)}, counted from 0) leave motions of {building.name} without one; give all storeys"
        )
    step = sample_time * np.eye(n)
    Ad = np.block([[np.eye(n), step], [np.zeros((n, n)), np.eye(n)]])
    pushed = np.vstack([0.5 * sample_time * step, step])
    seen = np.hstack([rows, np.zeros_like(rows)])
    error = noise_intensity / sample_time * np.eye(len(rows))
    covariance = scipy.linalg.solve_discrete_are(Ad.T, seen.T, pushed @ pushed.T / sample_time, error)
    correction = np.linalg.solve(seen @ covariance @ seen.T + error, seen @ covariance @ Ad.T).T
    unseen = np.zeros((n + n_devices, 2 * n))
    return Observer(
        Ad=Ad,
        Bd=np.zeros((2 * n, n_devices)),
        gain=np.hstack([pushed, np.zeros((2 * n, n_devices)), correction]),
        C=np.vstack([unseen, seen]),
        D=np.zeros((len(unseen) + len(rows), n_devices)),
        names=(
            *building.floor_names,
            *(f"device {index + 1}" for index in range(n_devices)),
            *(f"drift {building.storey_names[storey]}" for storey in storeys),
        ),
        sample_time=sample_time,
        covariance=covariance,
        Ed=-pushed @ building.influence,
        G=np.zeros(len(unseen) + len(rows)),
    )
