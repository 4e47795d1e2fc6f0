"""Standard errors from the Jacobian of the residuals, under residuals that are independent and of one variance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.identification.equivalent import Form
from mrwork.identification.estimate import remark_of
from mrwork.identification.linearisation import linearised
from mrwork.identification.objective import Objective

# A combination of parameters (each scaled to unit sensitivity) that moves the residuals less than this, relative
# to the one that moves them most, is not seen by the data. Rounding leaves about 1e-11.
_UNSEEN = 1e-7


def jacobian(objective: Objective, box: Box, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivative of the residuals with respect to the free parameters, shape (n_residuals, n_free)."""
    return np.asarray(linearised(objective, theta[None], box.free)[1][0].T)


def standard_errors(
    derivative: Callable[[Box, NDArray[np.float64]], NDArray[np.float64]],
    form: Form,
    theta: NDArray[np.float64],
    misfit: float,
) -> NDArray[np.float64]:
    """Standard error of each parameter of the model asked for, shape (n_params,); 0 for those that do not vary.

    A parameter on its bound counts as known: the data push it no further inward.

    Parameters
    ----------
    derivative
        Jacobian of the residuals with respect to the free parameters of a box, shape (n_residuals, n_free).
    """
    box = form.box
    interior = [index for index in box.free if remark_of(box, index, theta[index]) == ""]
    n_params = len(theta)
    cov = np.zeros((n_params, n_params))
    if interior:
        lower, upper = list(box.lower), list(box.upper)
        for index in set(box.free) - set(interior):
            lower[index] = upper[index] = float(theta[index])
        free = Box(names=box.names, lower=tuple(lower), upper=tuple(upper), log=box.log)
        cov[np.ix_(interior, interior)] = covariance(derivative(free, theta), misfit)
    return spread_through(form.back.jacobian(theta), cov)


def covariance(jacobian: NDArray[np.float64], misfit: float) -> NDArray[np.float64]:
    """Covariance of the columns' parameters, shape (n_params, n_params); NaN where the data do not tell.

    `cov = s^2 (J'J)^-1` with `s^2 = misfit^2 / (n_residuals - n_params)`, for the Jacobian of residuals whose sum
    of squares is the squared misfit. Parameters that take part in a combination which the data do not see
    have NaN in their rows and columns.
    """
    n_residuals, n_params = jacobian.shape
    result = np.full((n_params, n_params), np.nan)
    norm = np.linalg.norm(jacobian, axis=0)
    seen = np.flatnonzero(norm > 0.0)
    if seen.size == 0 or n_residuals <= n_params or not np.all(np.isfinite(jacobian)):
        return result
    _, singular, right = np.linalg.svd(jacobian[:, seen] / norm[seen], full_matrices=False)
    told = singular > _UNSEEN * singular[0]
    variance = misfit**2 / (n_residuals - n_params)
    root = right[told].T / singular[told] / norm[seen, None]
    block = variance * root @ root.T
    blind = np.sum(right[~told] ** 2, axis=0) > _UNSEEN
    block[blind, :] = np.nan
    block[:, blind] = np.nan
    result[np.ix_(seen, seen)] = block
    return result


def spread_through(map_jacobian: NDArray[np.float64], cov: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard errors of mapped parameters, shape (n_mapped,), by the delta method; NaN where one it needs is."""
    errors = np.empty(len(map_jacobian))
    for index, row in enumerate(map_jacobian):
        used = np.flatnonzero(row)
        errors[index] = np.sqrt(row[used] @ cov[np.ix_(used, used)] @ row[used])
    return errors
