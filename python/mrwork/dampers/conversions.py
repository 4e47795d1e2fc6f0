"""Exact conversions between equivalent forms of a model.

A conversion accepts NumPy and JAX arrays, its Jacobian NumPy arrays only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from mrwork.base.arguments import AnyArray, checked, unchecked
from mrwork.base.values import Floats
from mrwork.dampers.dependence import Array
from mrwork.errors import SettingError

# A number that is not finite is refused in a sentence.
_QUIET = np.errstate(divide="ignore", invalid="ignore", over="ignore")


# Imaginary step of a derivative, far below what adds to a real part.
_IMAGINARY_STEP = 1e-100


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
        stepped = theta[..., None, :] + 1j * _IMAGINARY_STEP * np.eye(theta.shape[-1])
        return np.asarray(np.swapaxes(self.convert(stepped).imag / _IMAGINARY_STEP, -1, -2))

    def at(self, A: float) -> Conversion:
        """The same conversion with a fixed `A`, for forms with one redundant scale parameter."""
        return Conversion(lambda theta: self.convert(theta, A))


def _columns(theta: Array, count: int) -> list[Array]:
    """The parameters one by one; parameters that are not as many are refused."""
    if theta.ndim < 1 or theta.shape[-1] != count:
        raise SettingError(
            f"`theta` has shape {theta.shape}; give shape (..., {count}), one value a parameter"
        )
    return [theta[..., index] for index in range(count)]


def _joined(theta: Array, *columns: Array) -> Array:
    """Converted parameters on the last axis; those that JAX traces have no values yet."""
    converted = theta.__array_namespace__().stack(columns, axis=-1)
    if isinstance(converted, np.ndarray) and not np.isfinite(converted).all():
        raise SettingError(
            "the parameters have no equivalent in this form: a number would not be finite; give a positive A, rho and "
            "sum of gamma and beta, closer to nominal values"
        )
    return converted


@checked
@_QUIET
def normalised_from_bouc_wen(theta: AnyArray) -> Array:
    """Parameters of `normalised_bouc_wen`, shape (..., 7), equal in force to a `bouc_wen`, shape (..., 8).

    With z_max = (A/(beta+gamma))^(1/n): rho = A/z_max, sigma = gamma/(beta+gamma), k_w = alpha z_max
    (Ikhouane, Rodellar 2007).
    """
    c0, k0, x0, alpha, gamma, beta, A, n = _columns(theta, 8)
    z_max = (A / (beta + gamma)) ** (1.0 / n)
    return _joined(theta, c0, k0, x0, alpha * z_max, A / z_max, gamma / (beta + gamma), n)


@checked
@_QUIET
def bouc_wen_from_normalised(theta: AnyArray, A: float) -> Array:
    """Parameters of `bouc_wen`, shape (..., 8), equal in force to a `normalised_bouc_wen`, shape (..., 7).

    The Spencer form has one redundant scale parameter, which `A` fixes.
    """
    c, k, x0, k_w, rho, sigma, n = _columns(theta, 7)
    z_max = A / rho
    sum_ = A / z_max**n
    return _joined(theta, c, k, x0, k_w / z_max, sigma * sum_, (1.0 - sigma) * sum_, 0.0 * n + A, n)


NORMALISED_FROM_BOUC_WEN: Final = Conversion(unchecked(normalised_from_bouc_wen))
BOUC_WEN_FROM_NORMALISED: Final = Conversion(unchecked(bouc_wen_from_normalised))


@_QUIET
def rescaled_bouc_wen(theta: AnyArray, A: float) -> Array:
    """Rescale a `bouc_wen`, shape (..., 8), to another `A`: z is multiplied by s = A_new/A, the force is the same."""
    c0, k0, x0, alpha, gamma, beta, old, n = _columns(theta, 8)
    s = A / old
    power = s ** (1.0 - n)
    return _joined(theta, c0, k0, x0, alpha / s, power * gamma, power * beta, 0.0 * n + A, n)


def of_modified(plain: Conversion) -> Conversion:
    """The conversion for modified Bouc-Wen models: c0, k0, c1, k1 and x0 stay, the loop is converted."""

    def convert(theta: Array, *scale: float) -> Array:
        xp = theta.__array_namespace__()
        loop = plain.convert(xp.concat([theta[..., :2], theta[..., 4:]], axis=-1), *scale)
        return xp.concat([theta[..., :5], loop[..., 3:]], axis=-1)

    return Conversion(convert)
