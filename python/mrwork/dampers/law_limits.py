"""Commands at which the law of a parameter gives a value that the model does not admit, or next to none."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.dampers.parameters import ParamSpec, law_named
from mrwork.dampers.spec import DamperSpec
from mrwork.summary import of_unit
from mrwork.units import CommandUnit

# Commands at which a law is evaluated.
_N_COMMANDS = 201
# A positive parameter below this share of its largest value has vanished.
_VANISHED = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class LawLimit:
    """A parameter whose law gives `value` at `command`, where the model uses `used`.

    `value` is not admissible, or has vanished, at commands from `first` to `last`; it is the worst one there.
    """

    parameter: str
    unit: str
    value: float
    used: float
    command: float
    first: float
    last: float
    command_unit: CommandUnit

    @property
    def in_words(self) -> str:
        """As in "the law of k_w turns negative: -120 N at 0 A, taken as 0.001 N from 0 to 0.12 A"."""
        if self.value == self.used:
            what = "vanishes"
        elif self.value > self.used:
            what = "leaves the admissible range"
        else:
            what = "turns negative" if self.value < 0.0 <= self.used else "leaves the admissible range"
        unit = "" if self.unit == "1" else self.unit
        value = of_unit(self.value, unit, 3)
        at = of_unit(self.command, self.command_unit, 3)
        taken = "" if self.value == self.used else f", taken as {of_unit(self.used, unit, 3)}"
        span = (
            ""
            if self.first == self.last
            else f" from {self.first:.3g} to {self.last:.3g} {self.command_unit}"
        )
        return f"the law of {self.parameter} {what}: {value} at {at}{taken}{span}"


def law_limits(spec: DamperSpec, theta: ArrayLike, commands: tuple[float, float]) -> tuple[LawLimit, ...]:
    """The parameters whose law leaves its admissible range, or vanishes, at commands in a range.

    A parameter that follows the command is limited to the admissible range of the plain model. Where its law leaves
    that range the damper is not the one that was identified: a stiffness or yield force of next to nothing, or an
    equation too stiff to be solved.

    Parameters
    ----------
    theta
        Parameters, shape (n_params,).
    commands
        Smallest and largest command, in the unit of the laws.
    """
    if spec.current is None:
        return ()
    command = np.linspace(*commands, _N_COMMANDS)
    found = []
    for parameter, value in _values(spec, np.asarray(theta, dtype=np.float64), command):
        used = np.clip(value, parameter.lower, parameter.upper)
        beyond = np.abs(value - used)
        if parameter.lower > 0.0:
            beyond[(beyond == 0.0) & (value < _VANISHED * value.max())] = np.finfo(float).tiny
        outside = np.flatnonzero(beyond)
        if outside.size:
            worst = int(np.argmax(beyond))
            found.append(
                LawLimit(
                    parameter=parameter.name,
                    unit=parameter.unit,
                    value=float(value[worst]),
                    used=float(used[worst]),
                    command=float(command[worst]),
                    first=float(command[outside[0]]),
                    last=float(command[outside[-1]]),
                    command_unit=spec.current.unit,
                )
            )
    return tuple(found)


def worst_laws(limits: Iterable[LawLimit]) -> list[LawLimit]:
    """For each parameter the limit with the largest deviation."""
    worst: dict[str, LawLimit] = {}
    for each in limits:
        known = worst.get(each.parameter)
        if known is None or abs(each.value - each.used) > abs(known.value - known.used):
            worst[each.parameter] = each
    return list(worst.values())


def _values(
    spec: DamperSpec, theta: NDArray[np.float64], command: NDArray[np.float64]
) -> Iterator[tuple[ParamSpec, NDArray[np.float64]]]:
    """Each parameter that follows the command, with the values that its law gives."""
    assert spec.current is not None
    start = 0
    for parameter, name in zip(spec.plain, spec.current.laws, strict=True):
        law = law_named(name)
        coefficients = theta[start : start + law.n_coefficients]
        start += law.n_coefficients
        if law.degree != 0:
            yield parameter, law.values(coefficients, command, log=parameter.scale == "log")
