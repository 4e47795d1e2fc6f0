"""One run of the loop with python-control: a sampled nonlinear system, simulated by `input_output_response`.

Its update is the Runge-Kutta step of all contenders in NumPy: a continuous plant with a sampled controller it does not
take.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from studies.speed.loop_plain import N_STATE, PlainLoop
from studies.speed.loop_workload import STEP, Floats, LoopWorkload


def prepare(workload: LoopWorkload) -> Callable[[], Floats]:
    """Return the call: the first candidate under the first motion, shape (1, 1, N_REDUCTIONS)."""
    control: Any = import_module("control")
    loop = PlainLoop.of(workload, 0)
    ground = workload.ground[0]

    def update(time: float, state: Floats, inputs: Floats, parameters: object) -> Floats:
        return loop.step(state, loop.command(state), inputs)

    # Without an output function the outputs are the states.
    system = control.nlsys(update, inputs=3, states=N_STATE, dt=STEP)
    inputs = np.stack([ground[:-1:2], ground[1::2], ground[2::2]])
    # One sample more, whose input changes nothing: its state is the end.
    inputs = np.concatenate([inputs, inputs[:, -1:]], axis=1)
    times = STEP * np.arange(workload.n_steps + 1)

    def run() -> Floats:
        response = control.input_output_response(system, times, inputs, np.zeros(N_STATE))
        return loop.reductions(response.states.T)[None, None]

    return run
