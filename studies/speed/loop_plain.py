"""The loop in plain NumPy, one run, one step after another: what other ways are checked with, and two are built on.

`solve_ivp` is called anew at every control sample, as its command is held. Its tolerances are loose and a step is the
whole interval, so that none is rejected: 5th order where the others have 4th, and as few evaluations as it can do with.
python-control simulates a sampled nonlinear system, whose update is our step: a continuous plant with a sampled
controller it does not take.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from studies.former.arrays import Floats
from studies.speed.loop_workload import LAG, LARGEST_COMMAND, N_STOREYS, STEP, LoopWorkload

# A run's state: displacements, velocities, the coil's current, and the energies entered, lost to damping, taken by
# the device.
N_STATE = 2 * N_STOREYS + 4
_CURRENT = 2 * N_STOREYS
# No error estimate of `solve_ivp` reaches it: the step is what the control sample prescribes.
_ANY_ERROR = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class PlainLoop:
    """One run: matrices of s' = A s + B f + E a_g, with s = [q; v]."""

    workload: LoopWorkload
    gain: Floats
    state_matrix: Floats
    force_column: Floats
    ground_column: Floats

    @classmethod
    def of(cls, workload: LoopWorkload, candidate: int) -> PlainLoop:
        """The loop of one candidate."""
        n = N_STOREYS
        matrix = np.zeros((2 * n, 2 * n))
        matrix[:n, n:] = np.eye(n)
        matrix[n:, :n] = -workload.stiffness / workload.mass[:, None]
        matrix[n:, n:] = -workload.damping / workload.mass[:, None]
        force, ground = np.zeros(2 * n), np.zeros(2 * n)
        force[n] = -1.0 / workload.mass[0]
        ground[n:] = -1.0
        return cls(
            workload=workload,
            gain=workload.gains[candidate],
            state_matrix=matrix,
            force_column=force,
            ground_column=ground,
        )

    def pull(self, x: float, v: float, i: float) -> float:
        """Force of the pair [N], f(x, v) - f(-x, -v), at the coil's current."""
        c0, c1, k0, k1, a0, a1, a2, beta, d0, d1, x_s, f0 = self.workload.device.tolist()

        def force(x: float, v: float) -> float:
            hysteresis = math.tanh(beta * v + (d0 + d1 * i) * math.tanh(x / x_s))
            found: float = (c0 + c1 * i) * v + (k0 + k1 * i) * x + (a0 + (a1 + a2 * i) * i) * hysteresis + f0
            return found

        return force(x, v) - force(-x, -v)

    def command(self, state: Floats) -> float:
        """i_max H((f_c - f) f) of what is measured now."""
        force = self.pull(state[0], state[N_STOREYS], state[_CURRENT])
        wanted = -float(self.gain @ state[: 2 * N_STOREYS])
        return LARGEST_COMMAND if (wanted - force) * force > 0.0 else 0.0

    def rate(self, state: Floats, current: float, a_g: float) -> Floats:
        """Time derivative of the state but the current, whose lag is stepped exactly; shape (N_STATE,)."""
        n = N_STOREYS
        s, v = state[: 2 * n], state[n : 2 * n]
        force = self.pull(s[0], s[n], current)
        rate = np.zeros(N_STATE)
        rate[: 2 * n] = self.state_matrix @ s + self.force_column * force + self.ground_column * a_g
        rate[-3] = -a_g * (self.workload.mass @ v)
        rate[-2] = v @ (self.workload.damping @ v)
        rate[-1] = force * v[0]
        return rate

    def step(self, state: Floats, command: float, ground: Floats) -> Floats:
        """One Runge-Kutta step with the ground's acceleration at its start, middle and end."""
        h = STEP
        start = float(state[_CURRENT])
        middle = command + (start - command) * math.exp(-0.5 * LAG * h)
        end = command + (start - command) * math.exp(-LAG * h)
        first = self.rate(state, start, ground[0])
        second = self.rate(state + 0.5 * h * first, middle, ground[1])
        third = self.rate(state + 0.5 * h * second, middle, ground[1])
        fourth = self.rate(state + h * third, end, ground[2])
        after = state + h / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        after[_CURRENT] = end
        return after

    def reductions(self, states: Floats) -> Floats:
        """Reductions of a run, shape (N_REDUCTIONS,), from its states, shape (n_steps + 1, N_STATE)."""
        n = N_STOREYS
        at = states[:-1]
        q, v = at[:, :n], at[:, n : 2 * n]
        force = np.array([self.pull(s[0], s[n], s[_CURRENT]) for s in at])
        # Absolute: what moves all floors alike does not enter.
        acceleration = at[:, : 2 * n] @ self.state_matrix[n:].T + np.outer(force, self.force_column[n:])
        drift = np.diff(q, axis=1, prepend=0.0)
        kept: list[Floats] = []
        shear = acceleration @ self.workload.mass
        current = at[:, _CURRENT]
        for history in (q, acceleration, drift, shear[:, None], force[:, None]):
            kept += [np.abs(history).max(axis=0), np.sqrt((history**2).mean(axis=0))]
        device = [np.abs(q[:, 0]).max(), np.abs(v[:, 0]).max()]
        device += [current.max(), current.mean(), np.sqrt((current**2).mean())]
        q, v = states[-1, :n], states[-1, n : 2 * n]
        kinetic, strain = 0.5 * v @ (self.workload.mass * v), 0.5 * q @ self.workload.stiffness @ q
        entered, lost, taken = states[-1, -3:]
        return np.concatenate([*kept, device, [taken, entered, kinetic, strain, lost]])

    def run(self, motion: int) -> Floats:
        """One run by Runge-Kutta steps, reduced."""
        ground = self.workload.ground[motion]
        states = np.zeros((self.workload.n_steps + 1, N_STATE))
        for k in range(self.workload.n_steps):
            states[k + 1] = self.step(states[k], self.command(states[k]), ground[k])
        return self.reductions(states)


def by_solve_ivp(workload: LoopWorkload) -> Callable[[], Floats]:
    """Return the call: the first candidate under the first motion, shape (1, 1, N_REDUCTIONS)."""
    loop = PlainLoop.of(workload, 0)
    ground = workload.ground[0]

    def interval(state: Floats, before: float, after: float) -> Floats:
        command = loop.command(state)

        def rate(time: float, now: Floats) -> Floats:
            slope = loop.rate(now, float(now[_CURRENT]), before + (after - before) * time / STEP)
            slope[_CURRENT] = -LAG * (now[_CURRENT] - command)
            return slope

        solution = solve_ivp(
            rate, (0.0, STEP), state, method="RK45", first_step=STEP, rtol=_ANY_ERROR, atol=_ANY_ERROR
        )
        end: Floats = solution.y[:, -1]
        return end

    def run() -> Floats:
        states = np.zeros((workload.n_steps + 1, N_STATE))
        for k in range(workload.n_steps):
            states[k + 1] = interval(states[k], ground[k, 0], ground[k, 2])
        return loop.reductions(states)[None, None]

    return run


def by_python_control(workload: LoopWorkload) -> Callable[[], Floats]:
    """Return the call: the first candidate under the first motion, shape (1, 1, N_REDUCTIONS)."""
    control: Any = import_module("control")
    loop = PlainLoop.of(workload, 0)
    ground = workload.ground[0]

    def update(time: float, state: Floats, inputs: Floats, parameters: object) -> Floats:
        return loop.step(state, loop.command(state), inputs)

    # Without an output function the outputs are the states.
    system = control.nlsys(update, inputs=3, states=N_STATE, dt=STEP)
    # One sample more, whose input changes nothing: its state is the end.
    inputs = np.concatenate([ground, ground[-1:]]).T
    times = STEP * np.arange(workload.n_steps + 1)

    def run() -> Floats:
        response = control.input_output_response(system, times, inputs, np.zeros(N_STATE))
        return loop.reductions(response.states.T)[None, None]

    return run
