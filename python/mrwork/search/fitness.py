"""Fitness of the chromosomes of a genetic algorithm."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def relative_fitness(misfit: NDArray[np.float64]) -> NDArray[np.float64]:
    """`F = (e_max - e)/(e_max - e_min)` in each population, shape (n_replicates, n_population).

    The extremes are those of the simulations that succeeded. Failures have 0, and all have where all errors are equal.
    """
    succeeded = np.isfinite(misfit)
    best = np.min(misfit, axis=1, keepdims=True)
    worst = np.max(np.where(succeeded, misfit, -math.inf), axis=1, keepdims=True)
    varied = succeeded & (worst > best)
    above = np.where(varied, worst, 0.0) - np.where(varied, misfit, 0.0)
    span = np.where(varied, worst, 1.0) - np.where(varied, best, 0.0)
    return np.asarray(above / span)
