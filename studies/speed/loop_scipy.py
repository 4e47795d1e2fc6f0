"""One run of the loop with `scipy.integrate.solve_ivp`: called anew at every control sample, as its command is held.

Tolerances are loose and a step is the whole interval, so that none is rejected: 5th order where the others have 4th,
and as few evaluations as it can do with.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from studies.speed.loop_plain import N_STATE, PlainLoop
from studies.speed.loop_workload import LAG, N_STOREYS, STEP, Floats, LoopWorkload

_CURRENT = 2 * N_STOREYS
# No error estimate reaches it: the step is what the control sample prescribes.
_ANY_ERROR = 1e6


def prepare(workload: LoopWorkload) -> Callable[[], Floats]:
    """Return the call: the first candidate under the first motion, shape (1, 1, N_REDUCTIONS)."""
    loop = PlainLoop.of(workload, 0)
    ground = workload.ground[0]

    def run() -> Floats:
        states = np.zeros((workload.n_steps + 1, N_STATE))
        for k in range(workload.n_steps):
            command = loop.command(states[k])
            states[k + 1] = _interval(loop, states[k], command, ground[2 * k], ground[2 * k + 2])
        return loop.reductions(states)[None, None]

    return run


def _interval(loop: PlainLoop, state: Floats, command: float, before: float, after: float) -> Floats:
    def rate(time: float, now: Floats) -> Floats:
        slope = loop.rate(now, float(now[_CURRENT]), before + (after - before) * time / STEP)
        slope[_CURRENT] = -LAG * (now[_CURRENT] - command)
        return slope

    found = solve_ivp(
        rate, (0.0, STEP), state, method="RK45", first_step=STEP, rtol=_ANY_ERROR, atol=_ANY_ERROR
    )
    end: Floats = found.y[:, -1]
    return end
