"""Passive elements of a building: a spring, a dashpot, a loss of head and a loop that yields, in parallel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, ClassVar, Final

from mrwork.base.arguments import NotNegative, Positive, checked
from mrwork.base.hints import Says, Within
from mrwork.base.numbers import format_rounded
from mrwork.base.summary import Summarised, Summary
from mrwork.base.values import Floats, array_dataclass, freeze_samples

KNEE: Final = Says("sharpness of the knee: 1 is round, 10 nearly bilinear")
Sharpness = Annotated[float, Within(least=1.0, most=50.0), KNEE]


@checked
@array_dataclass(repr=False)
class PassiveElement(Summarised):
    """A passive device `f = k x + c v + d |v| v + f_y w` across a row of a building, x its elongation and v = x'.

    `w' = (v - (|v| |w|^(n-1) w + v |w|^n) / 2) / x_y` is the normalised Bouc-Wen loop, which goes to elastic-perfectly
    plastic as n grows (Ikhouane, Rodellar, Systems with Hysteresis, Wiley, 2007). The spring k [N/m] and the dashpot c
    [N s/m] are in the matrices of the building, so that modes, observers and regulators see them; whoever adds the
    element adds them there. The rest they do not see: `head_loss` d [N s2/m2], `yield_force` f_y [N] and
    `yield_displacement` x_y [m] with the initial stiffness f_y / x_y, and `sharpness` n of the knee, 1 for a round and
    10 for a nearly bilinear one. Of a part of the frame, `in_stiffness`, they see this stiffness too: the stiffness
    matrix belongs to the elastic frame, and the loop takes its place when the building is simulated.
    """

    _made_by: ClassVar[str] = (
        "mr.buildings.with_friction_damper(...) and its like, or mr.buildings.PassiveElement(...)"
    )

    name: Annotated[str, Says("name in tables")]
    row: Annotated[Floats, Says("its displacement over the coordinates: a number for each")]
    stiffness: Annotated[NotNegative, Says("spring, which is in the matrices", unit="N/m")] = 0.0
    damping: Annotated[NotNegative, Says("dashpot, which is in the matrices", unit="N s/m")] = 0.0
    head_loss: Annotated[NotNegative, Says("coefficient of head loss, in N s2/m2")] = 0.0
    yield_force: Annotated[NotNegative, Says("force at which it yields or slips", unit="N")] = 0.0
    yield_displacement: Annotated[Positive, Says("displacement at which it does", unit="m")] = 1.0
    sharpness: Sharpness = 10.0
    in_stiffness: Annotated[
        bool,
        Says(
            "whether the stiffness matrix has the initial stiffness of its loop too, as of a storey that yields"
        ),
    ] = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "row", freeze_samples(self.row))

    def _summary(self) -> Summary:
        facts = (
            ("spring", self.stiffness, "N/m"),
            ("dashpot", self.damping, "N s/m"),
            ("head loss", self.head_loss, "N s2/m2"),
            ("yields at", self.yield_force, "N"),
        )
        return Summary(
            title=f"Passive element {self.name}",
            facts=tuple((name, f"{format_rounded(value)} {unit}") for name, value, unit in facts if value),
        )

    @property
    def is_linear(self) -> bool:
        """Whether the matrices contain the whole element, as they do a viscous damper."""
        return not (self.head_loss or self.yield_force)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Its parameters k, c, d, f_y, 1 / x_y, n, for the digest of a run, and 1 where it is part of the frame."""
        linear = self.stiffness, self.damping, self.head_loss
        loop = self.yield_force, 1.0 / self.yield_displacement, self.sharpness
        return (*linear, *loop, *((1.0,) if self.in_stiffness else ()))


def transform_elements(elements: Sequence[PassiveElement], onto: Floats) -> tuple[PassiveElement, ...]:
    """The elements of a building in other coordinates y, with q = onto @ y."""
    return tuple(replace(element, row=element.row @ onto) for element in elements)
