"""Cost of a step: operations, counted as the core counts them, and wall time."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from mrwork import dampers as kernels
from mrwork.dampers import damper
from studies.stiff_stepping.batch import BLOCK, PRESET, kernel, motion_table, random_record, scaled
from studies.stiff_stepping.steppers import TIMES, steppers

# e^x of the core, of whose power the logarithm is the other half.
EXP_FLOPS = 25
ROUNDS = 9


@dataclass(slots=True)
class OperationCount:
    """Operations so far; a power and an exponential count as the operations that the core uses for them."""

    flops: int = 0
    divisions: int = 0
    powers: int = 0
    exponentials: int = 0


class Counted:
    """A number that counts the arithmetic done on it; comparisons, signs and choices are free, as in the core."""

    def __init__(self, value: float, tally: OperationCount) -> None:
        self.value, self.tally = value, tally

    def _result(self, value: float) -> Counted:
        self.tally.flops += 1
        return Counted(value, self.tally)

    def __add__(self, other: Any) -> Counted:
        return self._result(self.value + _value(other))

    def __sub__(self, other: Any) -> Counted:
        return self._result(self.value - _value(other))

    def __rsub__(self, other: Any) -> Counted:
        return self._result(_value(other) - self.value)

    def __mul__(self, other: Any) -> Counted:
        return self._result(self.value * _value(other))

    def __truediv__(self, other: Any) -> Counted:
        self.tally.divisions += 1
        return self._result(self.value / _value(other))

    def __rtruediv__(self, other: Any) -> Counted:
        self.tally.divisions += 1
        return self._result(_value(other) / self.value)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> Counted:
        return Counted(-self.value, self.tally)

    def __abs__(self) -> Counted:
        return Counted(abs(self.value), self.tally)

    def __lt__(self, other: Any) -> bool:
        return self.value < _value(other)

    def __gt__(self, other: Any) -> bool:
        return self.value > _value(other)


def _value(number: Any) -> float:
    return number.value if isinstance(number, Counted) else number


def counted(method: str, *, general: bool) -> OperationCount:
    """One step on a general exponent, or on n = 2 as products."""
    tally = OperationCount()
    # What a general exponent adds to the core's four rates, and the product that it replaces.
    theta = damper(PRESET).nominal
    fractional = np.where(np.arange(9) == 8, 2.5, theta)
    power_flops = (
        kernels.flops_per_step(PRESET, fractional) - kernels.flops_per_step(PRESET, theta)
    ) // 4 + 2

    def power(x: Counted, n: Any) -> Counted:
        tally.powers += 1
        tally.flops += power_flops if general else int(_value(n) > 1.5)
        return Counted(x.value ** _value(n), tally)

    def exp(x: Counted) -> Counted:
        tally.exponentials += 1
        tally.flops += EXP_FLOPS
        return Counted(float(np.exp(x.value)), tally)

    step = steppers(power, exp, lambda function: function)[method]
    p: Any = tuple(Counted(value, tally) for value in scaled(theta[None])[0])
    y, w = Counted(1e-3, tally), Counted(0.5, tally)
    # In motion under saturated load, where the exponential step takes e^x; motions and h are shared by all lanes.
    motions = (1e-3, 0.3, 1.0, 1.1e-3, 0.3, 1.0, 1.1e-3, 0.3, 1.0)
    step(p, y, w, motions, 1e-4)  # type: ignore[arg-type] # a number that counts stands in for a float
    return tally


def nanoseconds(methods: tuple[str, ...], *, general: bool) -> dict[str, float]:
    """Processor time of a step per candidate, one thread, median of rounds in which every method takes its turn."""
    theta = scaled(np.tile(damper(PRESET).nominal, (16 * BLOCK, 1)))
    history = random_record(1, n_time=300)
    series = np.empty((history.n_time - 1, len(theta)))
    tables = {method: motion_table(history, 2, TIMES[method]) for method in methods}
    spent: dict[str, list[float]] = {method: [] for method in methods}
    for turn in range(ROUNDS + 1):
        for method in methods:
            begun = time.process_time()
            kernel(method, not general)(theta, tables[method], history.dt, series)
            if turn > 0:  # the first compiles
                spent[method].append(time.process_time() - begun)
    steps = 2 * series.size
    return {method: 1e9 * statistics.median(values) / steps for method, values in spent.items()}


def core_nanoseconds(*, general: bool) -> float:
    """Time of a step of the core per candidate, one thread, median."""
    theta = np.tile(damper(PRESET).nominal, (16 * BLOCK, 1))
    # As near to 2 as can be, so that the candidates are equally stiff, and yet not a whole number.
    theta[:, 8] = 2.0 + 1e-9 if general else 2.0
    history = random_record(1, n_time=300)
    force = np.zeros(history.n_time)
    spent = []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        _, _, substeps = kernels.misfits(PRESET, theta, history, force, threads=1)
        spent.append(time.perf_counter() - begun)
    return 1e9 * statistics.median(spent) / (float(substeps.sum()) * (history.n_time - 1))
