"""What is wanted of an export, apart from it as the help of the command line loads no runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from mrwork.base.hints import Says
from mrwork.dampers.conventions import OpenSeesError, OpenSeesTimeStep
from mrwork.errors import SettingError

Target = Literal["mat", "opensees", "csv", "c", "fmu"]
Command = Annotated[
    str | None,
    Says("command at which the damper is exported, as in 0.5A; csv: default five over the tested ones"),
]
Error = Annotated[
    OpenSeesError | None,
    Says("wanted error of BoucWen in OpenSees, a share of the largest force of the loop; default 0.005"),
]
TimeStep = Annotated[
    OpenSeesTimeStep | None,
    Says(
        "step of the analysis in OpenSees, whose sub-steps are told, or between samples of C; default 0.001"
    ),
]
Libm = Annotated[bool, Says("C calls exp, log, pow and tanh of math.h, which changes last bits")]
Single = Annotated[bool, Says("C computes with float")]
Example = Annotated[
    bool, Says("C of a controller comes with a program around it to copy, and a Makefile for it")
]
Law = Annotated[
    str | None, Says("law of the study whose controller is printed as C, where there are several")
]

# Targets that take an option, of a fit; a study or a tuning takes none.
_TARGETS: dict[str, tuple[Target, ...]] = {
    "command": ("opensees", "csv"),
    "error": ("opensees",),
    "time_step": ("opensees", "c", "fmu"),
    "libm": ("c",),
    "single": ("c",),
    "example": ("c",),
    "law": ("c", "fmu"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """A target and what is asked of it."""

    to: Target
    command: Command = None
    error: Error = None
    time_step: TimeStep = None
    libm: Libm = False
    single: Single = False
    law: Law = None
    example: Example = False

    def __post_init__(self) -> None:
        for name, targets in _TARGETS.items():
            if getattr(self, name) not in (None, False) and self.to not in targets:
                raise SettingError(
                    f"the {name.replace('_', ' ')} is only for an export to {' or '.join(targets)}; leave it out"
                )
