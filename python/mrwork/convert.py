"""Exact converters between equivalent forms of a model; NumPy and JAX arrays both go through."""

from __future__ import annotations

from typing import Any

# NumPy or JAX.
Array = Any


def normalised_from_bouc_wen(theta: Array) -> Array:
    """Parameters of `normalised_bouc_wen`, shape (..., 7), equal in force to those of `bouc_wen`, shape (..., 8).

    With z_max = (A/(beta+gamma))^(1/n): rho = A/z_max, sigma = gamma/(beta+gamma), k_w = alpha z_max
    (Ikhouane, Rodellar 2007).
    """
    xp = theta.__array_namespace__()
    c0, k0, x0, alpha, gamma, beta, A, n = (theta[..., index] for index in range(8))
    z_max = (A / (beta + gamma)) ** (1.0 / n)
    return xp.stack([c0, k0, x0, alpha * z_max, A / z_max, gamma / (beta + gamma), n], axis=-1)


def bouc_wen_from_normalised(theta: Array, A: float) -> Array:
    """Parameters of `bouc_wen`, shape (..., 8), equal in force to those of `normalised_bouc_wen`, shape (..., 7).

    The Spencer form has one freedom of scale too many; `A` settles it.
    """
    xp = theta.__array_namespace__()
    c, k, x0, k_w, rho, sigma, n = (theta[..., index] for index in range(7))
    z_max = A / rho
    sum_ = A / z_max**n
    return xp.stack(
        [c, k, x0, k_w / z_max, sigma * sum_, (1.0 - sigma) * sum_, xp.full(n.shape, A), n], axis=-1
    )


def normalised_from_modified_bouc_wen(theta: Array) -> Array:
    """Parameters of `normalised_modified_bouc_wen`, shape (..., 9), equal in force to those of `modified_bouc_wen`.

    The latter have shape (..., 10); their loop is that of `bouc_wen`, the rest stays.
    """
    return _with_loop(theta, normalised_from_bouc_wen(_plain(theta)))


def modified_bouc_wen_from_normalised(theta: Array, A: float) -> Array:
    """Parameters of `modified_bouc_wen`, shape (..., 10), equal in force to those of `normalised_modified_bouc_wen`.

    The latter have shape (..., 9); `A` settles the scale, as in `bouc_wen_from_normalised`.
    """
    return _with_loop(theta, bouc_wen_from_normalised(_plain(theta), A))


def _plain(theta: Array) -> Array:
    """c0, k0, x0 and the loop: what a modified Bouc-Wen model has of the plain one."""
    return theta.__array_namespace__().concat([theta[..., :2], theta[..., 4:]], axis=-1)


def _with_loop(theta: Array, loop: Array) -> Array:
    """Replace the loop of a modified Bouc-Wen model, the parameters after x0."""
    return theta.__array_namespace__().concat([theta[..., :5], loop[..., 3:]], axis=-1)
