"""Inverse LQR: weights of a given gain, or those of the nearest gain that is optimal for some weights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.arguments import checked
from mrwork.base.hints import Within
from mrwork.base.numbers import format_rounded
from mrwork.base.summary import Summarised, Summary
from mrwork.base.values import Floats, array_dataclass
from mrwork.control.linear.plant import Plant, symmetric
from mrwork.control.linear.riccati import solve_riccati
from mrwork.control.weights.limits import LimitedOutputs, RmsLimits, as_forces
from mrwork.control.weights.system import LyapunovEquations, design_system
from mrwork.errors import SettingError
from mrwork.motions.spectral_density import KanaiTajimi, SpectralDensity

OPTIMAL = 1e-3
"""Distance up to which a gain counts as optimal for the weights found: about the accuracy of the program."""

_ROUNDS = 15


@array_dataclass(repr=False)
class InverseWeights(Summarised):
    """Weights `s'Q s + f'R f` of a given gain K, or of the optimal gain that is nearest to it.

    `state_weight` is Q, shape (2n, 2n), `control_weight` R as it was given, shape (n_devices,), and `gain` their
    Riccati gain, shape (n_devices, 2n); the common factor of Q and R is free. `distance` is `|(gain - K) X^1/2| / |K
    X^1/2|` with the covariance X of the state under K: the rms difference of the desired forces over the rms wanted
    force.
    """

    _units: ClassVar[Mapping[str, str]] = {"control_weight": "1/N^2"}

    state_weight: Floats
    control_weight: Floats
    gain: Floats
    distance: float

    @property
    def optimal(self) -> bool:
        """Whether the given gain is that of these weights."""
        return self.distance <= OPTIMAL

    def _summary(self) -> Summary:
        says = (
            "The gain is optimal for these weights."
            if self.optimal
            else "The gain is not that of any Q without cross term: the weights are those of a gain nearby."
        )
        return Summary(
            title="Weights of a gain",
            facts=(
                ("distance", f"{self.distance:.2e} of the rms desired force"),
                (
                    "control weight",
                    f"{', '.join(format_rounded(float(each)) for each in self.control_weight)} 1/N2",
                ),
                ("largest weight", format_rounded(float(np.abs(self.state_weight).max()))),
            ),
            notes=(says,),
        )


@checked
def inverse_weights(
    plant: Plant,
    gain: ArrayLike,
    *,
    control_weight: Annotated[float | Sequence[float], Within(above=0.0)] = 1.0,
    spectrum: SpectralDensity | None = None,
) -> InverseWeights:
    """Weights of a regulator that has a given gain, or the nearest gain that some weights have.

    A gain K' = R^-1 B'P is optimal if `Q = P B R^-1 B'P - A'P - P A >= 0` with P >= 0 (R. E. Kalman, J. Basic Eng. 86,
    1964, 51-60). The distance to K is convex in P and the condition is not; each round replaces the product by its
    tangent at the last gain, which is a semidefinite program whose solution satisfies the condition, so that the
    distance falls from round to round to a local minimum. Compare M. C. Priess et al., IEEE Trans. Control Systems
    Technology 23(2), 2015, 770-777.

    Parameters
    ----------
    gain
        K of the desired force f = -K s, shape (n_devices, 2n), as of a tuned law.
    control_weight
        R [1/N^2]: one number for all devices, or one for each.
    spectrum
        Of the ground under which gains are compared; Kanai-Tajimi on firm soil by default.

    Raises
    ------
    SettingError
        If the gain has another shape, or the loop closed with it is not stable.

    Examples
    --------
    >>> import mrwork as mr
    >>> frame = mr.building("uts")
    >>> plant = mr.control.plant_of(frame, frame.storeys[:1])
    >>> regulator = mr.control.regulator_of_outputs(plant, mr.control.drifts(plant), 1.0, 1e-10)
    >>> mr.control.inverse_weights(plant, regulator.gain).optimal
    True
    """
    K = np.atleast_2d(np.asarray(gain, dtype=np.float64))
    shape = (plant.n_devices, 2 * plant.n_coordinates)
    if K.shape != shape or not np.any(np.abs(K) > np.finfo(float).tiny):
        raise SettingError(f"`gain` has shape {K.shape}; give finite numbers of shape {shape}, not all zero")
    R = np.asarray(control_weight, dtype=np.float64)
    if R.shape not in ((), (plant.n_devices,)):
        raise SettingError(
            f"`control_weight` has {R.size} numbers, and the number of devices is {plant.n_devices}; give one for "
            "each, or one for all"
        )
    R = np.broadcast_to(R, plant.n_devices)
    spectrum = KanaiTajimi() if spectrum is None else spectrum
    outputs = LimitedOutputs.of(RmsLimits(rms_drift=1.0), plant)
    system = design_system(plant, outputs, spectrum, budgets=as_forces(1.0, plant))
    try:
        loop = LyapunovEquations(system.A - system.B @ K @ system.state)
    except SettingError as error:
        raise SettingError(
            "the loop closed with this gain is not stable, so that it is no gain of any weights; give a stabilising one"
        ) from error
    X = system.state @ loop.covariance(system.noise) @ system.state.T
    rms = np.sqrt(np.diag(X))
    best: InverseWeights | None = None
    # Which coordinates the solver finds easy depends on the gain: states over their rms, or those of the energy.
    for T in (np.diag(rms), plant.scaling):
        weights = _in_coordinates(plant, K, R, X, T)
        if weights is not None and (best is None or weights.distance < best.distance):
            best = weights
        if best is not None and best.optimal:
            break
    if best is None:
        raise SettingError(
            "the weights of this gain were not found: the semidefinite program failed; give a gain of less extreme "
            "entries"
        )
    return best


def _in_coordinates(plant: Plant, K: Floats, R: Floats, X: Floats, T: Floats) -> InverseWeights | None:
    """The weights from a program in coordinates z of s = T z; `None` where it fails."""
    back, scale = np.linalg.inv(T), np.sqrt(R)[:, None]
    root: Floats = np.linalg.cholesky(symmetric(back @ X @ back.T)).astype(np.float64)
    # Forces such that they cost one in all.
    size = np.linalg.norm(scale * K @ T @ root)
    force = size / np.sqrt(R)
    A, B, K_z = back @ plant.A @ T, back @ plant.B * force, K @ T / force[:, None]
    rate = float(np.linalg.norm(A, 2))
    P = _nearest(A / rate, B / rate, K_z, root)
    if P is None:
        return None
    gain_z = B.T @ P / rate
    values, vectors = np.linalg.eigh(symmetric(gain_z.T @ gain_z - (A.T @ P + P @ A) / rate))
    Q_z = (vectors * np.maximum(values, 1e-12 * values[-1])) @ vectors.T
    # The cost of u'u in scaled forces is f'R f over size^2.
    Q = symmetric(size**2 * back.T @ Q_z @ back)
    zero = np.zeros((len(Q), len(R)))
    try:
        gain, _ = solve_riccati(plant.A, plant.B, Q, np.diag(R), zero, scaling=plant.scaling)
    except SettingError:
        return None
    distance = float(np.linalg.norm(scale * (gain - K) @ T @ root) / size)
    return InverseWeights(state_weight=Q, control_weight=R.copy(), gain=gain, distance=distance)


def _nearest(A: Floats, B: Floats, gain: Floats, root: Floats) -> Floats | None:
    """P with `B'P` nearest to the gain, of a cost u'u; tangents until the distance stops falling."""
    from mrwork.control.weights.program import nearest_riccati  # loads cvxpy

    best, smallest, at = None, np.inf, gain
    for _ in range(_ROUNDS):
        P = nearest_riccati(A, B, gain, root, at)
        if P is None:
            break
        at = B.T @ P
        distance = float(np.linalg.norm((at - gain) @ root))
        if distance < smallest:
            best = P
        if distance <= 0.1 * OPTIMAL or distance > 0.99 * smallest:
            break
        smallest = distance
    return best
