"""A short descent from each start of a search, so that only the best minima are finished."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.identification.levenberg_marquardt import Descended, descend
from mrwork.identification.multistart import distinct_minima
from mrwork.identification.objective import Objective

_FIRST_EVALUATIONS = 15
_SEMIFINALISTS = 4
_LAST_EVALUATIONS = 60


def best_few(
    objective: Objective,
    box: Box,
    starts: NDArray[np.float64],
    *,
    mirrored: tuple[int, ...],
    on_start: Callable[[Descended, float], None],
) -> NDArray[np.float64]:
    """Descend a little from every start, shape (n_starts, n_params), and to the end from the best of them.

    Returns the `distinct_minima`, shape (1 or 2, n_params).

    Parameters
    ----------
    mirrored
        Parameters whose signs can be changed together with little effect, but through a barrier that no
        descent crosses; the best minimum is tried again from its mirror image.
    on_start
        Called after every descent with the best so far and the share of the work done.
    """
    done = 0
    total = len(starts) + min(_SEMIFINALISTS, len(starts)) + bool(mirrored)
    found: list[Descended] = []

    def follow(start: NDArray[np.float64], max_evaluations: int) -> Descended:
        nonlocal done
        descended = descend(objective, box, start, max_evaluations=max_evaluations)
        found.append(descended)
        done += 1
        on_start(min(found, key=_misfit), done / total)
        return descended

    first = sorted((follow(start, _FIRST_EVALUATIONS) for start in starts), key=_misfit)
    last = sorted((follow(each.theta, _LAST_EVALUATIONS) for each in first[:_SEMIFINALISTS]), key=_misfit)
    if mirrored:
        image = last[0].theta.copy()
        image[list(mirrored)] *= -1.0
        last = sorted([*last, follow(image, _LAST_EVALUATIONS)], key=_misfit)
    return distinct_minima(
        box, np.array([each.theta for each in last]), np.array([each.misfit for each in last])
    )


def _misfit(descended: Descended) -> float:
    return descended.misfit
