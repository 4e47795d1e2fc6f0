"""Histories of both programs: the order of convergence of OpenSees, its limit, and how far ours is from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from studies.former.arrays import Floats
from studies.yielding_frame import frame, opensees
from studies.yielding_frame.frame import Case, Histories

STEPS = (1e-3, 5e-4, 2.5e-4, 1.25e-4)
KNEES = (1.0, 3.0, 10.0, 20.0, 50.0)
_SIGNALS = ("drift", "shear", "acceleration")


def apart(one: Floats, other: Floats) -> float:
    """Largest difference of two histories over the largest value of the second."""
    return float(np.abs(one - other).max() / np.abs(other).max())


def extrapolated(halvings: Sequence[Floats], order: int = 1) -> Floats:
    """Limit of histories whose step is halved each time, whose error has the powers `order`, `order` + 1, ... of it.

    Romberg's scheme: each column of differences removes the lowest power that is left (Richardson 1911).
    """
    column = list(halvings)
    for power in range(order, order + len(halvings) - 1):
        column = [fine + (fine - coarse) / (2.0**power - 1.0) for coarse, fine in pairwise(column)]
    return column[0]


def peaks_apart(one: Floats, other: Floats) -> float:
    """Largest relative difference of the peaks of the storeys or floors."""
    peaks = [np.abs(each).max(axis=0) for each in (one, other)]
    return float(np.abs(peaks[0] / peaks[1] - 1.0).max())


def compared(ops: Any, case: Case, steps: Sequence[float] = STEPS) -> dict[str, Any]:
    """Errors as shares: of OpenSees at each step, of its limit, of ours against that, and the orders between steps."""
    theirs = [opensees.theirs(ops, case, step) for step in steps]
    ours, halved = frame.ours(case), frame.ours(case, step_factor=2)
    drifts = [each.drift for each in theirs]
    # The trapezoidal rule of an elastic frame has even powers of the step alone, of which the second is the least.
    order = 2 if case.elastic else 1
    limits = {name: extrapolated([getattr(each, name) for each in theirs[-3:]], order) for name in _SIGNALS}
    changes = [apart(coarse, fine) for coarse, fine in pairwise(drifts)]
    before = extrapolated(drifts[-4:-1], order)
    return {
        "ductility": float(np.abs(ours.drift).max() / frame.YIELD_DRIFT),
        "errors": [apart(each, limits["drift"]) for each in drifts],
        "orders": [float(np.log2(first / second)) for first, second in pairwise(changes)],
        "limit": apart(before, limits["drift"]),
        **{name: apart(getattr(ours, name), limits[name]) for name in _SIGNALS},
        "peaks": max(peaks_apart(getattr(ours, name), limits[name]) for name in _SIGNALS),
        "half_step": apart(halved.drift, ours.drift),
    }


def knees(ops: Any, case: Case, steps: Sequence[float] = STEPS[-2:]) -> dict[str, Any]:
    """Peaks of bilinear storeys in OpenSees, and how far those of a rounded knee are from them, by its sharpness."""
    bilinear = replace(case, sharpness=np.inf)
    coarse, fine = (opensees.theirs(ops, bilinear, step).drift for step in steps)
    sharp = np.abs(extrapolated([coarse, fine], order=2)).max(axis=0)
    rounded: dict[float, Floats] = {}
    for sharpness in KNEES:
        found: Histories = frame.ours(replace(case, sharpness=sharpness))
        rounded[sharpness] = np.abs(found.drift).max(axis=0)
    return {
        "ductility": float(sharp.max() / frame.YIELD_DRIFT),
        "own": peaks_apart(coarse, fine),
        "largest": {f"{each:g}": float(peak.max() / sharp.max() - 1.0) for each, peak in rounded.items()},
        "storeys": {f"{each:g}": float(np.abs(peak / sharp - 1.0).max()) for each, peak in rounded.items()},
    }
