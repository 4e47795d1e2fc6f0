"""Evaluation criteria by name, with the labels that papers give them.

Each is one number of a run. Papers divide it: the benchmarks by its value without dampers (Dyke, Jansen, Ohtori), the
thesis by its value at i = 0. `||.||` is the root mean square over the record.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import UnknownNameError

Floats = NDArray[np.float64]

STANDARD_GRAVITY = 9.80665
"""[m/s^2]"""


class Reductions(Protocol):
    """What is kept of one run or of many: arrays whose last axis is floors, storeys or devices, if they have one."""

    @property
    def peak_displacement(self) -> Floats:
        """Of each floor relative to the ground [m]."""

    @property
    def rms_displacement(self) -> Floats:
        """[m]."""

    @property
    def peak_drift(self) -> Floats:
        """Of each storey [m]."""

    @property
    def rms_drift(self) -> Floats:
        """[m]."""

    @property
    def peak_acceleration(self) -> Floats:
        """Of each floor, absolute [m/s^2]."""

    @property
    def rms_acceleration(self) -> Floats:
        """[m/s^2]."""

    @property
    def peak_base_shear(self) -> Floats:
        """[N], no last axis."""

    @property
    def rms_base_shear(self) -> Floats:
        """[N], no last axis."""

    @property
    def peak_force(self) -> Floats:
        """Of each device [N]."""

    @property
    def peak_stroke(self) -> Floats:
        """Of each device [m]."""

    @property
    def mean_current(self) -> Floats:
        """Of each device [A or V]."""

    @property
    def rms_current(self) -> Floats:
        """[A or V]."""

    @property
    def device_energy(self) -> Floats:
        """Taken up by each device [J]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """One number of a run; less is better where `ratio` says that papers compare by it.

    `labels` are those of papers for its ratio to the value without dampers. `uncontrolled` names the criterion of
    the building without dampers that this ratio divides by; it is empty where there is none.
    """

    name: str
    title: str
    unit: str
    value: Callable[[Reductions, float], Floats]
    labels: tuple[str, ...] = ()
    uncontrolled: str = ""
    ratio: bool = True


def criteria() -> tuple[Criterion, ...]:
    """Every criterion, in the order of tables.

    Examples
    --------
    >>> from mrwork.closed_loop.evaluation import criterion
    >>> criterion("peak_drift").labels
    ('J1 of Ohtori et al. 2004', 'J2 of Jansen & Dyke 2000')
    """
    return _CRITERIA


def criterion(name: str) -> Criterion:
    """Return the criterion called `name`.

    Raises
    ------
    UnknownNameError
        Where there is none of that name; the message lists them.
    """
    for entry in _CRITERIA:
        if entry.name == name:
            return entry
    known = ", ".join(entry.name for entry in _CRITERIA)
    raise UnknownNameError(f"no criterion is called {name!r}; choose from {known}")


def values(responses: Reductions, *, weight: float) -> dict[str, Floats]:
    """Every criterion; `weight` of the building [N]."""
    return {entry.name: entry.value(responses, weight) for entry in _CRITERIA}


def ratio(numerator: Floats, denominator: Floats) -> Floats:
    """One over the other, NaN where there is nothing to divide by."""
    above, below = np.broadcast_arrays(np.asarray(numerator, float), np.asarray(denominator, float))
    quotient: Floats = np.divide(above, below, out=np.full(above.shape, np.nan), where=below != 0.0)
    return quotient


SCORE = ("peak_drift", "peak_acceleration", "rms_drift", "rms_acceleration")
"""What the score is the mean of."""


def score(controlled: Sequence[dict[str, Floats]], passive: Sequence[dict[str, Floats]]) -> Floats:
    """Mean over motions of the mean over `SCORE` of each criterion over its value at i = 0; ours, not a paper's.

    Parameters
    ----------
    controlled, passive
        The criteria of one law and of i = 0, for each motion.
    """
    ratios = [
        ratio(with_law[name], without[name])
        for with_law, without in zip(controlled, passive, strict=True)
        for name in SCORE
    ]
    mean: Floats = np.mean(np.stack(ratios), axis=0)
    return mean


def _largest(of: Callable[[Reductions], Floats]) -> Callable[[Reductions, float], Floats]:
    # A building without devices has an axis of length zero: its largest force is none.
    return lambda responses, weight: np.asarray(np.max(of(responses), axis=-1, initial=0.0))


_OHTORI = "Ohtori et al. 2004"
_JANSEN = "Jansen & Dyke 2000"

_CRITERIA = (
    Criterion(
        name="peak_displacement",
        title="Peak displacement",
        unit="m",
        value=_largest(lambda responses: responses.peak_displacement),
        labels=(f"J1 of {_JANSEN}",),
        uncontrolled="peak_displacement",
    ),
    Criterion(
        name="peak_drift",
        title="Peak drift",
        unit="m",
        value=_largest(lambda responses: responses.peak_drift),
        labels=(f"J1 of {_OHTORI}", f"J2 of {_JANSEN}"),
        uncontrolled="peak_drift",
    ),
    Criterion(
        name="peak_acceleration",
        title="Peak acceleration",
        unit="m/s2",
        value=_largest(lambda responses: responses.peak_acceleration),
        labels=(f"J2 of {_OHTORI}", f"J3 of {_JANSEN}"),
        uncontrolled="peak_acceleration",
    ),
    Criterion(
        name="peak_base_shear",
        title="Peak base shear",
        unit="N",
        value=lambda responses, weight: responses.peak_base_shear,
        labels=(f"J3 of {_OHTORI}",),
        uncontrolled="peak_base_shear",
    ),
    Criterion(
        name="rms_displacement",
        title="RMS displacement",
        unit="m",
        value=_largest(lambda responses: responses.rms_displacement),
        uncontrolled="rms_displacement",
    ),
    Criterion(
        name="rms_drift",
        title="RMS drift",
        unit="m",
        value=_largest(lambda responses: responses.rms_drift),
        labels=(f"J4 of {_OHTORI}",),
        uncontrolled="rms_drift",
    ),
    Criterion(
        name="rms_acceleration",
        title="RMS acceleration",
        unit="m/s2",
        value=_largest(lambda responses: responses.rms_acceleration),
        labels=(f"J5 of {_OHTORI}",),
        uncontrolled="rms_acceleration",
    ),
    Criterion(
        name="rms_base_shear",
        title="RMS base shear",
        unit="N",
        value=lambda responses, weight: responses.rms_base_shear,
        labels=(f"J6 of {_OHTORI}",),
        uncontrolled="rms_base_shear",
    ),
    Criterion(
        name="peak_force",
        title="Peak device force",
        unit="N",
        value=_largest(lambda responses: responses.peak_force),
        ratio=False,
    ),
    Criterion(
        name="peak_force_share",
        title="Peak device force over weight",
        unit="1",
        value=lambda responses, weight: np.max(responses.peak_force, axis=-1, initial=0.0) / weight,
        labels=(f"J11 of {_OHTORI}", f"J4 of {_JANSEN}"),
        ratio=False,
    ),
    Criterion(
        name="peak_stroke",
        title="Peak stroke",
        unit="m",
        value=_largest(lambda responses: responses.peak_stroke),
        labels=(f"J12 of {_OHTORI}",),
        uncontrolled="peak_drift",
        ratio=False,
    ),
    Criterion(
        name="mean_current",
        title="Mean command",
        unit="A or V",
        value=_largest(lambda responses: responses.mean_current),
        ratio=False,
    ),
    Criterion(
        name="rms_current",
        title="RMS command",
        unit="A or V",
        value=_largest(lambda responses: responses.rms_current),
        ratio=False,
    ),
    Criterion(
        name="device_energy",
        title="Energy taken up by devices",
        unit="J",
        value=lambda responses, weight: np.asarray(np.sum(responses.device_energy, axis=-1)),
        ratio=False,
    ),
)
