"""Random motions as severe as the damper meets in a building, and a batch of candidates through one by any stepper."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import njit

from mrwork.dampers import Loading, LoadingHistory
from studies.former.arrays import Floats
from studies.stiff_stepping import elementary
from studies.stiff_stepping.steppers import TIMES, steppers

STROKE = 0.006
PEAK_VELOCITY = 0.6


def random_record(seed: int, dt: float = 1.0 / 3000.0, n_time: int = 3000) -> LoadingHistory:
    """Sinusoids of random phase, +-6 mm and 0.6 m/s; it starts in motion, from a damper at rest.

    The time is stretched until the peak velocity is right, and the displacement is then sampled.
    """
    rng = np.random.default_rng(seed)
    frequency = np.linspace(0.5, 25.0, 80)[:, None]
    phase = rng.uniform(0.0, 2.0 * np.pi, (80, 1))
    time = np.linspace(0.0, 1.0, 3001)

    def motion(time: np.ndarray) -> np.ndarray:
        return np.sin(2.0 * np.pi * frequency * time + phase).sum(axis=0)

    scale = STROKE / np.max(np.abs(motion(time)))
    velocity = (2.0 * np.pi * frequency * np.cos(2.0 * np.pi * frequency * time + phase)).sum(axis=0)
    stretch = PEAK_VELOCITY / (scale * np.max(np.abs(velocity)))
    sampled = np.arange(0.0, min(1.0 / (stretch * dt), n_time)) * dt * stretch
    return Loading(dt=dt, displacement=scale * motion(sampled)).history()


PRESET = "normalised_modified_bouc_wen"  # its nominal values are the damper of Dyke et al. at 2.25 V
BLOCK = 64


def motion_table(history: LoadingHistory, substeps: int, times: tuple[float, ...]) -> Floats:
    """x, v, v' at three fractions of every sub-step, shape (n_time - 1, substeps, 9).

    Within a sample x and v are cubics: four of the core's own stages give them everywhere, to rounding.
    """
    stages = history.stages(2 * substeps)
    nodes = stages[:, 4 * np.arange(substeps)[:, None] + np.arange(4)]
    to_cubic = np.linalg.inv(np.vander([0.0, 0.25, 0.5, 0.75], 4, increasing=True))
    u = np.array(times)
    value = np.vander(u, 4, increasing=True) @ to_cubic
    slope = np.stack([0.0 * u, u**0, 2.0 * u, 3.0 * u**2], axis=1) @ to_cubic * (substeps / history.dt)
    motion = np.einsum("tn,iknq->iktq", value, nodes)
    acceleration = np.einsum("tn,ikn->ikt", slope, nodes[..., 1])
    table: Floats = np.concatenate([motion, acceleration[..., None]], axis=-1)
    return table.reshape(len(stages), substeps, 9)


def scaled(theta: Floats) -> Floats:
    """The steppers' parameters from those of normalised_modified_bouc_wen, shapes (n_batch, 9) to (n_batch, 6)."""
    c0, k0, c1, _, _, k_w, rho, sigma, n = theta.T
    damping = c0 + c1
    return np.stack([c0 / damping, k0 / damping, k_w / damping, rho, 2.0 * sigma - 1.0, n], axis=1)


def forces(method: str, theta: Floats, history: LoadingHistory, substeps: int) -> Floats:
    """Forces [N] of normalised_modified_bouc_wen by a method, shape (n_batch, n_time - 1): without the last sample."""
    rows = np.resize(np.arange(len(theta)), -(-len(theta) // BLOCK) * BLOCK)
    series = np.empty((history.n_time - 1, len(rows)))
    squares = bool(np.all(theta[:, 8] == 2.0))
    kernel(method, squares)(
        scaled(theta)[rows], motion_table(history, substeps, TIMES[method]), history.dt, series
    )
    displacement = history.stages(1)[:, 0, 0]
    c1, k1, x0 = theta[:, 2:5].T[..., None]
    return c1 * series.T[: len(theta)] + k1 * (displacement - x0)


@njit(inline="always", error_model="numpy")
def whole_power(x: float, n: float) -> float:
    """x^n for n = 1 or 2, as products."""
    return x * x if n > 1.5 else x


@cache
def kernel(method: str, squares: bool) -> Callable[[Floats, Floats, float, Floats], None]:
    """The compiled loop: scaled parameters, motion table, sampling step; y' comes back, shape (n_time - 1, n_batch).

    `squares` takes n = 2 as products, as the core does; otherwise every power is a general one.
    """
    inlined = njit(inline="always", error_model="numpy")
    step = steppers(whole_power if squares else elementary.power, elementary.exp, inlined)[method]

    def run(theta: Floats, motions: Floats, dt: float, series: Floats) -> None:
        n_interval, substeps, _ = motions.shape
        h = dt / substeps
        for first in range(0, theta.shape[0], BLOCK):
            y, w = np.zeros(BLOCK), np.zeros(BLOCK)
            q = theta[first : first + BLOCK].T.copy()
            q0, q1, q2, q3, q4, q5 = q[0], q[1], q[2], q[3], q[4], q[5]
            for i in range(n_interval):
                x_start, v_start = motions[i, 0, 0], motions[i, 0, 1]
                for j in range(BLOCK):
                    series[i, first + j] = q2[j] * w[j] + (q0[j] * v_start + q1[j] * (x_start - y[j]))
                for k in range(substeps):
                    u = motions[i, k]
                    m = (u[0], u[1], u[2], u[3], u[4], u[5], u[6], u[7], u[8])
                    for j in range(BLOCK):
                        y[j], w[j] = step((q0[j], q1[j], q2[j], q3[j], q4[j], q5[j]), y[j], w[j], m, h)

    compiled: Callable[[Floats, Floats, float, Floats], None] = njit(error_model="numpy")(run)
    return compiled
