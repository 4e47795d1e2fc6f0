"""Last steps of a tuning by gradients: scores of a smooth law in the twin, differentiated in its free settings.

The twin gives the derivatives in the gains, differences of designs those of the gains in the settings. What is found
is a candidate as any other: it is chosen if it is better in the loop itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mrwork.closed_loop.evaluation import criterion
from mrwork.control.law_design import settings_of
from mrwork.errors import SettingError
from mrwork.study.schema import TuneTable
from mrwork.study.study import Study
from mrwork.tuning.objective import Objective, refuse_within
from mrwork.tuning.problem import Bench
from mrwork.tuning.space import LARGEST, SettingSpace
from mrwork.values import holds_arrays

if TYPE_CHECKING:
    from mrwork.twins.loop.tuned import TunedLoop

Floats = NDArray[np.float64]

# Difference of the unit coordinate of a setting for the derivative of the gains.
_DIFFERENCE = 1e-4
# Longest step of the twin [s].
_LONGEST_STEP = 2e-3


def check_finish(table: TuneTable, study: Study) -> None:
    """Refuse gradient steps of a law without gradients, or of a loop that the twin does not have."""
    if not table.gradient_steps:
        return
    # JAX is loaded only here.
    from mrwork.twins.loop.tuned import SMOOTH

    for law in table.laws:
        if law not in SMOOTH:
            refuse_within(
                table,
                f"{law} has no gradients: it switches, or the twin does not have it; gradient_steps is for "
                f"{', '.join(SMOOTH)}, leave it out",
                "gradient_steps",
            )
    if table.combine != "mean":
        refuse_within(
            table,
            "gradients are those of a mean of criteria; leave gradient_steps out, or combine",
            "gradient_steps",
        )
    if study.building.elements:
        refuse_within(
            table,
            f"gradients are those of a building without passive elements, and this one has "
            f"{study.building.elements[0].name}; leave gradient_steps out, or the element",
            "gradient_steps",
        )
    hardware = study.hardware
    noisy = any(number for pair in hardware.sensors for number in pair)
    if hardware.feedback != "state" or noisy or hardware.faults or math.isfinite(hardware.command_rate):
        refuse_within(
            table,
            "gradients are those of a loop with feedback of the state, without noise, faults and a rate limit; leave "
            "gradient_steps out, or these",
            "gradient_steps",
        )


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class Finish:
    """The point of the unit cube that the gradients have reached, shape (n_free,), and how many there were."""

    unit: Floats
    gradients: int

    @property
    def shape(self) -> tuple[int, ...]:
        """(n_free,)."""
        return self.unit.shape


def gradient_finish(
    space: SettingSpace,
    bench: Bench,
    objective: Objective,
    start: Floats,
    steps: int,
) -> Finish:
    """Follow the gradient from a point of the unit cube by L-BFGS-B; the largest command stays.

    The score is that of the nominal study; limits are not part of it, since the loop decides on the candidate.
    """
    from scipy.optimize import minimize

    largest = space.candidate(start).largest_command
    loop = _twin(space.law, bench, objective, largest)
    moved = [place for place, each in enumerate(space.free) if each.name != LARGEST]
    count = 0

    def value(places: Floats) -> tuple[float, Floats]:
        nonlocal count
        count += 1
        unit = start.copy()
        unit[moved] = places
        gains = _gains(space, bench, unit)
        scores, rates = loop.scores(gains, np.full(len(bench.problem.devices), largest))
        shares = risk_weights(scores, objective)
        slopes = []
        for place in moved:
            change = _gain_change(space, bench, unit, place)
            slopes.append(
                sum(
                    share * float(np.sum(rate[name] * change[name]))
                    for share, rate in zip(shares, rates, strict=True)
                    for name in change
                )
            )
        return float(shares @ scores), np.array(slopes)

    found = minimize(
        value,
        start[moved],
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0, 1.0)] * len(moved),
        options={"maxiter": steps, "maxfun": 2 * steps},
    )
    unit = start.copy()
    unit[moved] = found.x
    return Finish(unit=unit, gradients=count)


def risk_weights(scores: Floats, objective: Objective) -> Floats:
    """Weight of each score in the risk, its derivative in the scores, shape (n,)."""
    n = len(scores)
    if objective.risk == "mean":
        return np.full(n, 1.0 / n)
    worst = np.argsort(-scores, kind="stable")
    tail = 1.0 if objective.risk == "max" else objective.tail * n
    shares = np.clip(tail - np.arange(n), 0.0, 1.0)
    weights = np.empty(n)
    weights[worst] = shares / shares.sum()
    return weights


def _gains(space: SettingSpace, bench: Bench, unit: Floats) -> dict[str, Floats]:
    design = settings_of(space.law, space.candidate(unit, exact=True).settings).design(bench.problem)
    return {name: np.asarray(value, dtype=np.float64) for name, value in design.gains.items()}


def _gain_change(space: SettingSpace, bench: Bench, unit: Floats, place: int) -> dict[str, Floats]:
    """Derivative of the gains in one coordinate, by a central difference within the cube."""
    ends = []
    for sign in (-1.0, 1.0):
        other = unit.copy()
        other[place] = min(max(unit[place] + sign * _DIFFERENCE, 0.0), 1.0)
        ends.append((other[place], _gains(space, bench, other)))
    (below, lower), (above, upper) = ends
    return {name: (upper[name] - lower[name]) / (above - below) for name in upper}


def _twin(law: str, bench: Bench, objective: Objective, largest: float) -> TunedLoop:
    from mrwork.twins.loop.tuned import TunedLoop, TwinDamper

    building, hardware = bench.arrangement.building, bench.study.hardware
    if any(criterion(name).summed or criterion(name).over_weight for name in objective.weights):
        raise SettingError(
            "gradients are of peaks and rms values; leave gradient_steps out, or other criteria"
        )
    curve, theta = bench.problem.limited_to(largest).curve
    devices = bench.problem.devices
    dampers = [
        TwinDamper(
            spec=each.spec,
            theta=each.draws[0],
            row=np.asarray(each.row, dtype=np.float64),
            count=float(each.count),
            differential=each.differential,
        )
        for each in devices
    ]
    own = None
    if curve != devices[0].spec:
        own = [
            TwinDamper(
                spec=curve,
                theta=np.asarray(theta),
                row=each.row,
                count=each.count,
                differential=each.differential,
            )
            for each in dampers
        ]
    steps = max(
        1, math.ceil(hardware.sample_time / min(_LONGEST_STEP, hardware.sample_time / hardware.steps))
    )
    floors, storeys = list(bench.arrangement.floors), list(bench.arrangement.storeys)
    return TunedLoop(
        law,
        matrices={
            "mass": building.mass,
            "damping": building.damping,
            "stiffness": building.stiffness,
            "influence": building.influence,
            "floors": building.floors[floors],
            "storeys": building.storeys[storeys],
        },
        dampers=dampers,
        believed=own,
        motions=[(motion.dt, np.asarray(motion.acceleration)) for motion in bench.motions],
        step=hardware.sample_time / steps,
        steps_per_sample=steps,
        delay=round(hardware.delay / (hardware.sample_time / steps)),
        weights={criterion(name).quantity: weight for name, weight in objective.weights.items()},
        baseline=np.stack(
            [bench.baseline(objective).of(name)[0, :, 0] for name in objective.weights], axis=1
        ),
    )
