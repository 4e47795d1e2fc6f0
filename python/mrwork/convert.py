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
