"""Residuals of an objective with their exact derivatives, from one simulation of each candidate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mrwork.identification.objective import Objective
from mrwork.identification.threads import on_every_test

# Largest block of a Jacobian, in numbers, that is in memory beside the whole: 64 MiB.
_BLOCK_SIZE = 1 << 23


def linearised(
    objective: Objective, theta: NDArray[np.float64], columns: Sequence[int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Residuals and their exact derivatives with respect to columns of `theta`, from one simulation of each row.

    Shapes (n_batch, n_residuals) and (n_batch, n_columns, n_residuals), per unit of the column; derivatives are zero
    where a simulation failed. They include the observation model, the nuisance parameters and the power of the misfit.
    """
    n_rows = max(1, _BLOCK_SIZE // (objective.n_time * max(len(columns), 1)))
    blocks = [_block(objective, theta[at : at + n_rows], columns) for at in range(0, len(theta), n_rows)]
    if len(blocks) == 1:
        return blocks[0]
    n_columns = len(columns)
    residuals = [block[0] for block in blocks] or [np.empty((0, objective.n_time))]
    jacobians = [block[1] for block in blocks] or [np.empty((0, n_columns, objective.n_time))]
    return np.concatenate(residuals), np.concatenate(jacobians)


def _block(
    objective: Objective, theta: NDArray[np.float64], columns: Sequence[int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    objective.tally.simulations += len(theta)
    residuals = np.empty((len(theta), objective.n_time))
    jacobian = np.empty((len(theta), len(columns), objective.n_time))
    lengths = [test.n_counted for test in objective.tests]
    ends = np.cumsum(lengths)
    slices = [slice(end - length, end) for end, length in zip(ends, lengths, strict=True)]

    def fill(index: int, threads: int) -> None:
        each = objective.compared[index]
        own, derivative, failed = each.linearised(theta, columns, threads=threads)
        weight = each.weight(len(objective.compared))
        np.multiply(own, weight, out=residuals[:, slices[index]])
        np.multiply(derivative, weight, out=jacobian[..., slices[index]])
        residuals[failed, slices[index]] = 1.0

    on_every_test(len(objective.tests), objective.threads, fill)
    if not objective.is_plain:
        _apply_power(objective, residuals, jacobian, slices)
    return residuals, jacobian


def _apply_power(
    objective: Objective,
    residuals: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    slices: Sequence[slice],
) -> None:
    """Multiply the residuals of each test by its factor s, and their derivatives by the product rule, in place.

    With e = NRMSE, M = misfit, q = power/2 - 1: ds/s = q (de/e - dM/M), dM/M = sum(e^power de/e)/sum(e^power).
    """
    tiny = np.finfo(float).tiny
    squared = objective.squared_nrmse(residuals[:, part] for part in slices)
    factors = objective.power_factors(squared)
    # de/e of each test, (n_tests, n_batch, n_columns)
    change = len(objective.tests) * np.array(
        [np.einsum("bt,bpt->bp", residuals[:, part], jacobian[..., part]) for part in slices]
    )
    change /= np.maximum(squared, tiny)[..., None]
    share = squared ** (objective.settings.power / 2.0)
    share /= np.maximum(share.sum(axis=0), tiny)
    change -= np.einsum("nb,nbp->bp", share, change)
    for part, factor, each in zip(slices, factors, change, strict=True):
        jacobian[..., part] += (
            (objective.settings.power / 2.0 - 1.0) * each[..., None] * residuals[:, None, part]
        )
        jacobian[..., part] *= factor[:, None, None]
        residuals[:, part] *= factor[:, None]
