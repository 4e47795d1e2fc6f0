"""Relations between models: exact conversions between equivalent forms, and the simpler model that a model contains.

A conversion accepts NumPy and JAX arrays, its Jacobian NumPy arrays only. A nested model is a limit of the other;
`Nesting` gives points near it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from mrwork.base.arguments import AnyArray, checked
from mrwork.base.units import unit_of
from mrwork.base.values import Floats
from mrwork.errors import SettingError

# NumPy or JAX.
Array = Any

# A number that is not finite is refused in a sentence.
_QUIET = np.errstate(divide="ignore", invalid="ignore", over="ignore")


# Imaginary step of a derivative, far below what adds to a real part.
_STEP = 1e-100


@dataclass(frozen=True, slots=True)
class Conversion:
    """A map of parameter sets by an analytic function, from shape (..., n_from) to (..., n_to)."""

    convert: Callable[..., Array]

    def __call__(self, theta: Array) -> Array:
        """Converted parameters, shape (..., n_to)."""
        return self.convert(theta)

    def jacobian(self, theta: Floats) -> Floats:
        """Derivatives, shape (..., n_to, n_from): the imaginary part after an imaginary step, exact to rounding.

        Squire & Trapp, SIAM Rev. 40, 1998, 110-112.
        """
        stepped = theta[..., None, :] + 1j * _STEP * np.eye(theta.shape[-1])
        return np.asarray(np.swapaxes(self.convert(stepped).imag / _STEP, -1, -2))

    def at(self, A: float) -> Conversion:
        """The same conversion with a fixed `A`, for forms with one redundant scale parameter."""
        return Conversion(lambda theta: self.convert(theta, A))


def check_columns(theta: Array, count: int) -> None:
    """Refuse parameters that are not as many."""
    if theta.ndim < 1 or theta.shape[-1] != count:
        raise SettingError(
            f"`theta` has shape {theta.shape}; give shape (..., {count}), one value a parameter"
        )


def _refuse_infinite(theta: Array) -> Array:
    """Converted parameters; those that JAX traces have no values yet."""
    if isinstance(theta, np.ndarray) and not np.isfinite(theta).all():
        raise SettingError(
            "the parameters have no equivalent in this form: a number would not be finite; give a positive A, rho and "
            "sum of gamma and beta, closer to nominal values"
        )
    return theta


@_QUIET
def _normalised_from_bouc_wen(theta: Array) -> Array:
    check_columns(theta, 8)
    xp = theta.__array_namespace__()
    c0, k0, x0, alpha, gamma, beta, A, n = (theta[..., index] for index in range(8))
    z_max = (A / (beta + gamma)) ** (1.0 / n)
    return _refuse_infinite(
        xp.stack([c0, k0, x0, alpha * z_max, A / z_max, gamma / (beta + gamma), n], axis=-1)
    )


@_QUIET
def _bouc_wen_from_normalised(theta: Array, A: float) -> Array:
    check_columns(theta, 7)
    xp = theta.__array_namespace__()
    c, k, x0, k_w, rho, sigma, n = (theta[..., index] for index in range(7))
    z_max = A / rho
    sum_ = A / z_max**n
    return _refuse_infinite(
        xp.stack([c, k, x0, k_w / z_max, sigma * sum_, (1.0 - sigma) * sum_, xp.full(n.shape, A), n], axis=-1)
    )


@checked
def normalised_from_bouc_wen(theta: AnyArray) -> Array:
    """Parameters of `normalised_bouc_wen`, shape (..., 7), equal in force to a `bouc_wen`, shape (..., 8).

    With z_max = (A/(beta+gamma))^(1/n): rho = A/z_max, sigma = gamma/(beta+gamma), k_w = alpha z_max
    (Ikhouane, Rodellar 2007).
    """
    return _normalised_from_bouc_wen(theta)


@checked
def bouc_wen_from_normalised(theta: AnyArray, A: float) -> Array:
    """Parameters of `bouc_wen`, shape (..., 8), equal in force to a `normalised_bouc_wen`, shape (..., 7).

    The Spencer form has one redundant scale parameter, which `A` fixes.
    """
    return _bouc_wen_from_normalised(theta, A)


NORMALISED_FROM_BOUC_WEN: Final = Conversion(_normalised_from_bouc_wen)
BOUC_WEN_FROM_NORMALISED: Final = Conversion(_bouc_wen_from_normalised)


@_QUIET
def rescaled_bouc_wen(theta: AnyArray, A: float) -> Array:
    """Rescale a `bouc_wen`, shape (..., 8), to another `A`: z is multiplied by s = A_new/A, the force is the same."""
    check_columns(theta, 8)
    xp = theta.__array_namespace__()
    c0, k0, x0, alpha, gamma, beta, old, n = (theta[..., index] for index in range(8))
    s = A / old
    power = s ** (1.0 - n)
    return _refuse_infinite(
        xp.stack([c0, k0, x0, alpha / s, power * gamma, power * beta, xp.full(n.shape, A), n], axis=-1)
    )


def of_modified(plain: Conversion) -> Conversion:
    """The conversion for modified Bouc-Wen models: c0, k0, c1, k1 and x0 stay, the loop is converted."""

    def without_series(theta: Array) -> Array:
        """Parameters that a modified Bouc-Wen model shares with the plain one: c0, k0, x0 and the loop."""
        return theta.__array_namespace__().concat([theta[..., :2], theta[..., 4:]], axis=-1)

    def convert(theta: Array, *scale: float) -> Array:
        loop = plain.convert(without_series(theta), *scale)
        return theta.__array_namespace__().concat([theta[..., :5], loop[..., 3:]], axis=-1)

    return Conversion(convert)


Values = Mapping[str, float]

# Distances from the limit, in the scale of the tests: the nearest has the simpler model's force within a few per cent,
# from the others a local minimisation sees the parameters of the larger model.
_DISTANCES = (3.0, 10.0, 30.0, 100.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scales:
    """Half ranges of the tests: `stroke` [m], `speed` [m/s], `force` [N]."""

    stroke: float
    speed: float
    force: float

    def of_unit(self, unit: str) -> float | None:
        """Size of a parameter of this unit in SI, as force/speed^3 of N s3/m3; `None` if it is not of kg, m and s."""
        read = unit_of(unit)
        if read is None or not read.powers.keys() <= {"kg", "m", "s"}:
            return None
        mass, length, time = (read.powers.get(base, 0) for base in ("kg", "m", "s"))
        # A force is kg m/s2, a speed m/s: what is left of m and s is that of the speed, then of the stroke.
        of_speed = -(time + 2 * mass)
        powers = ((self.force, mass), (self.stroke, length - mass - of_speed), (self.speed, of_speed))
        over = math.prod(size**power for size, power in powers if power > 0)
        return over / math.prod(size**-power for size, power in powers if power < 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Nesting:
    """A simpler `model` in the limit of a larger one, with the parameters that they share.

    `near`: the other parameters of the larger one, from the parameters of the simpler one in the scales of the tests,
    as a distance of at least 1 grows.
    """

    model: str
    shared: tuple[str, ...]
    near: Callable[[Values, Scales, float], Values]

    def points(self, simpler: Values, scales: Scales) -> tuple[Values, ...]:
        """Points of the larger model near the simpler one with these parameters, farthest first."""
        return tuple(
            {**{name: simpler[name] for name in self.shared}, **self.near(simpler, scales, distance)}
            for distance in _DISTANCES
        )


_NORMALISED = ("c", "k", "x0", "k_w", "rho", "sigma", "n")


def _small_shift(side: str, width: Callable[[Scales], float]) -> Callable[[Values, Scales, float], Values]:
    return lambda _, scales, distance: {
        "mu": 0.1 * scales.speed / distance,
        "share": 0.5,
        side: 0.1 * width(scales),
    }


def _series_dashpot(p: Values, scales: Scales, distance: float) -> Values:
    """A dashpot c1 in series that hardly moves; the stiffness in parallel is divided between k0 and k1."""
    k0 = 0.1 * scales.force / scales.stroke
    k1 = p["k"] - k0
    x0 = p["k"] * p["x0"] / k1 if k1 else p["x0"]
    return {"c0": p["c"], "k0": k0, "c1": distance * scales.force / scales.speed, "k1": k1, "x0": x0}


def _exponential_knee(p: Values, scales: Scales, distance: float) -> Values:
    """The loop of Dahl; a small stiffness carries the offset of the force."""
    k = scales.force / scales.stroke / distance
    return {"c": p["k_x"], "k": k, "x0": -p["f0"] / k, "sigma": 1.0, "n": 1.0 + 1.0 / distance}


NESTINGS: Mapping[str, Nesting] = {
    "viscous_dahl": Nesting(model="dahl", shared=("k_w", "rho", "f0"), near=lambda _, scales, distance: {
        "k_x": scales.force / scales.speed / distance}),
    "lugre": Nesting(model="viscous_dahl", shared=("f0",), near=lambda p, scales, distance: {
        "sigma_0": p["k_w"] * p["rho"], "a0": p["rho"], "sigma_1": 0.1 * scales.force / scales.speed / distance,
        "sigma_2": p["k_x"]}),
    "normalised_bouc_wen": Nesting(model="viscous_dahl", shared=("k_w", "rho"), near=_exponential_knee),
    "backlash_bouc_wen": Nesting(model="normalised_bouc_wen", shared=_NORMALISED, near=lambda _, scales, distance: {
        "g": 0.3 * scales.stroke / distance}),
    "normalised_modified_bouc_wen": Nesting(model="normalised_bouc_wen", shared=("k_w", "rho", "sigma", "n"),
        near=_series_dashpot),
    "shear_thinning_modified_bouc_wen": Nesting(model="normalised_modified_bouc_wen",
        shared=("c0", "k0", "c1", "k1", "x0", "k_w", "rho", "sigma", "n"), near=lambda _, scales, distance: {
        "c2": scales.force / scales.speed / distance, "v_s": 0.3 * scales.speed}),
    "non_symmetric_bouc_wen": Nesting(model="normalised_bouc_wen", shared=_NORMALISED,
        near=_small_shift("w_s", lambda _: 1.0)),
    "non_symmetric_bouc_wen_displacement": Nesting(model="normalised_bouc_wen", shared=_NORMALISED,
        near=_small_shift("x_s", lambda scales: scales.stroke)),
    "elasto_visco_plastic": Nesting(model="bingham", shared=("f0",), near=lambda p, scales, distance: {
        "f_y": p["f_c"], "v_r": p["v_s"], "c": p["c0"], "rho": distance / scales.stroke,
        "r": scales.speed / scales.stroke / distance, "k": 0.0}),
    "extended_bingham": Nesting(model="bingham", shared=("f_c", "c0", "f0"), near=lambda _, scales, distance: {
        "rho": distance / scales.stroke, "a": 1.0 / distance, "tau": scales.stroke / scales.speed / distance}),
    "hyperbolic_tangent_gavin": Nesting(model="bingham", shared=("c0", "f0"), near=lambda p, scales, distance: {
        "f_o": p["f_c"], "V_r": p["v_s"], "d_r": distance * scales.stroke * p["v_s"] / scales.speed, "k0": 0.0}),
    "hyperbolic_tangent_guo": Nesting(model="bingham", shared=("f0",), near=lambda p, scales, distance: {
        "A1": p["f_c"], "A2": p["c0"], "A3": 1.0 / p["v_s"], "omega": scales.speed / scales.stroke / distance}),
    # From Gavin's x/d_r: with a wide x_s, delta tanh(x/x_s) is proportional to x.
    "static_hysteretic": Nesting(model="hyperbolic_tangent_gavin", shared=("f0",), near=lambda p, scales, distance: {
        "c": p["c0"], "k": p["k0"], "alpha": p["f_o"], "beta": 1.0 / p["V_r"],
        "delta": distance * scales.stroke / p["d_r"], "x_s": distance * scales.stroke}),
    "polynomial_fitting": Nesting(model="bingham", shared=("f0",), near=lambda p, scales, distance: {
        "a": p["f_c"], "b": 2.0 / p["v_s"], "v0": 0.0, "c": p["c0"], "h": scales.force / distance, "v1": 0.0,
        "w": 0.3 * scales.speed, "x_s": 0.3 * scales.stroke}),
}  # fmt: skip
"""The simpler model of each model that contains one."""
