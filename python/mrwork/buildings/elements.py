"""Passive elements of a building that its matrices cannot say: loops that yield and losses of head."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import NotNegative, Positive, Within, checked
from mrwork.errors import SettingError
from mrwork.records.damper_test import frozen
from mrwork.summary import Summarised, Summary, rounded
from mrwork.values import holds_arrays

Floats = NDArray[np.float64]


@holds_arrays
@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class PassiveElement(Summarised):
    """A passive device `f = k x + c v + d |v| v + f_y w` across a row of a building, x its elongation and v = x'.

    `w' = (v - (|v| |w|^(n-1) w + v |w|^n) / 2) / x_y` is the normalised Bouc-Wen loop, which goes to elastic-perfectly
    plastic as n grows (Ikhouane, Rodellar, Systems with Hysteresis, Wiley, 2007). The spring k and the dashpot c are in
    the matrices of the building, so that modes, observers and regulators see them; the rest they do not see.

    Parameters
    ----------
    row
        Elongation = row @ q, shape (n,).
    stiffness, damping
        k [N/m] and c [N s/m], which whoever adds the element adds to the matrices as well.
    head_loss
        d [N s2/m2].
    yield_force, yield_displacement
        f_y [N] and x_y [m]: the initial stiffness of the loop is f_y / x_y.
    sharpness
        n, how sharp the knee is: 1 is round, 10 nearly bilinear.

    Raises
    ------
    SettingError
        If a number is not finite, or is outside its range.
    """

    _made_by: ClassVar[str] = (
        "mr.buildings.with_friction_damper(...) and its like, or mr.buildings.PassiveElement(...)"
    )

    name: str
    row: Floats
    stiffness: NotNegative = 0.0
    damping: NotNegative = 0.0
    head_loss: NotNegative = 0.0
    yield_force: NotNegative = 0.0
    yield_displacement: Positive = 1.0
    sharpness: Annotated[float, Within(least=1.0, most=50.0)] = 10.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "row", frozen(self.row))
        if self.row.ndim != 1 or not self.row.size:
            raise SettingError(
                f"{self.name}: `row` has shape {self.row.shape}; give (n,), a row of `building.storeys`"
            )

    def _summary(self) -> Summary:
        facts = (
            ("spring", self.stiffness, "N/m"),
            ("dashpot", self.damping, "N s/m"),
            ("head loss", self.head_loss, "N s2/m2"),
            ("yields at", self.yield_force, "N"),
        )
        return Summary(
            title=f"Passive element {self.name}",
            facts=tuple((name, f"{rounded(value)} {unit}") for name, value, unit in facts if value),
        )

    @property
    def numbers(self) -> tuple[float, ...]:
        """Its parameters in the order of the core: k, c, d, f_y, 1 / x_y, n."""
        return (
            self.stiffness,
            self.damping,
            self.head_loss,
            self.yield_force,
            1.0 / self.yield_displacement,
            self.sharpness,
        )


def carried(elements: Sequence[PassiveElement], onto: Floats) -> tuple[PassiveElement, ...]:
    """The elements of a building in other coordinates y, with q = onto @ y."""
    return tuple(replace(element, row=element.row @ onto) for element in elements)
