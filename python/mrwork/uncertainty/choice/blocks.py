"""Parts of a record that are nearly independent of one another: whole cycles, longer than residuals remember."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mrwork.records import DamperTest
from mrwork.records.motion import whole_cycles
from mrwork.uncertainty.autocorrelation import autocorrelation_time


def blocks_of(test: DamperTest, least: float) -> tuple[slice, ...]:
    """Cut the samples that count into blocks of whole cycles, each of at least so many samples.

    What lies before the first whole cycle belongs to the first block, what lies after the last to the last one. Where
    there is room for one block only, it is the whole record.

    Returns
    -------
    tuple of slice
        Of the samples that count, without gaps: they begin with the first that counts.
    """
    displacement = test.displacement[test.counted]
    cycles = whole_cycles(displacement)
    edges = [cycle.start for cycle in cycles[1:]]
    end = cycles[-1].stop if cycles else displacement.size
    cuts = [0]
    for edge in edges:
        if edge - cuts[-1] >= least and end - edge >= least:
            cuts.append(edge)
    return tuple(slice(first, last) for first, last in zip(cuts, [*cuts[1:], displacement.size], strict=True))


def longest_memory(residuals: Sequence[Sequence[NDArray[np.float64]]]) -> tuple[float, ...]:
    """Longest autocorrelation time [samples] of each test, shape (n_tests,), over the residuals of several models."""
    return tuple(
        max(autocorrelation_time(each) for each in of_test) for of_test in zip(*residuals, strict=True)
    )
