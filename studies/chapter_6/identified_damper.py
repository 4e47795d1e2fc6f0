"""The damper as an identification knows it: draws from the posterior of one virtual test of an RD-1005-3."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import mrwork as mr
from mrwork.records import DamperTest, build_damper_test
from studies.former.arrays import Floats
from studies.former.frame import DRIVER_RATE

SEED = 6
CURRENTS = (0.0, 0.47, 0.94, 1.41, 1.88)
AMPLITUDES = (0.3e-3, 14e-3)
"""The motion swells from the first to the last [m] at one current, and falls back at the next.

The last is the largest stroke of the pair at i = 0 and 0.3 g; at 3 Hz, that of the frame, it is the largest rate, too.
"""
FREQUENCY, DT, SECONDS = 3.0, 2e-3, 3.0
"""Frequency [Hz] and time step of the motion [s], and how long each current lasts [s]."""
FORCE_NOISE, DISPLACEMENT_NOISE = 15.0, 5e-6
"""Standard deviations of the sensors [N, m]."""
_PRESET = mr.damper("static_hysteretic").preset("kwok2006")


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifiedDamper:
    """Draws of one damper's parameters, shape (n_draws, n_params), the driver's rate behind them.

    `found` has for each parameter the true value, the median, half of the 95 % interval over it, and whether that
    interval holds the truth. `status` and `n_steps` are those of the chain, `error` is the rms of the fit [N].
    """

    theta: Floats
    found: dict[str, dict[str, float | bool]]
    status: str
    n_steps: int
    error: float


def virtual_test() -> DamperTest:
    """A sinusoid whose amplitude swells and falls while the current steps, with sensor noise."""
    count = round(SECONDS / DT)
    time = DT * np.arange(len(CURRENTS) * count)
    place = np.minimum((time / SECONDS).astype(int), len(CURRENTS) - 1)
    share = time / SECONDS - place
    low, high = np.log(AMPLITUDES)
    amplitude = np.exp(low + (high - low) * np.where(place % 2 == 0, share, 1.0 - share))
    x = amplitude * np.sin(2.0 * np.pi * FREQUENCY * time)
    v = np.gradient(x, DT)
    current = np.array(CURRENTS)[place]
    force = mr.simulate_force(
        _PRESET.spec,
        _PRESET.theta,
        mr.Loading(dt=DT, displacement=x, velocity=v, command=current, command_unit="A"),
    )
    rng = np.random.default_rng(SEED)
    return build_damper_test(
        name="swelling and falling, current in steps",
        time=time,
        displacement=x + DISPLACEMENT_NOISE * rng.standard_normal(time.size),
        velocity=v,
        force=force + FORCE_NOISE * rng.standard_normal(time.size),
        current=current,
        synthetic=True,
    )


def identified_damper(n_draws: int, *, most_steps: int = 20_000, threads: int = 0) -> IdentifiedDamper:
    """Identify the damper from the virtual test, and draw from its posterior."""
    test = virtual_test()
    fit = mr.identify(_PRESET.spec, test, rng=SEED, threads=threads)
    draws = mr.sample(fit, test, rng=SEED, most_steps=most_steps, threads=threads)
    chosen = np.random.default_rng(SEED).choice(len(draws.theta), size=n_draws, replace=False)
    truth = dict(zip(draws.names, _PRESET.theta, strict=True))
    return IdentifiedDamper(
        theta=np.column_stack([draws.theta[chosen], np.full(n_draws, DRIVER_RATE)]),
        found={
            each.name: {
                "truth": truth[each.name],
                "median": each.median,
                "half_width": abs((each.upper - each.lower) / (2.0 * each.median)),
                "holds": each.lower <= truth[each.name] <= each.upper,
            }
            for each in draws.summaries
            if each.name in truth
        },
        status=draws.status,
        n_steps=draws.n_steps,
        error=fit.rmse_n,
    )
