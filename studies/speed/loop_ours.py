"""The loop on our kernel, as users run it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mrwork.buildings import building
from mrwork.closed_loop import Device, Hardware, Responses, simulate_loop
from mrwork.control import ControlLaw
from mrwork.dampers import damper
from mrwork.errors import MrworkError
from studies.former.arrays import Floats
from studies.speed.loop_workload import KEPT, LAG, LARGEST_COMMAND, N_REDUCTIONS, STEP, LoopWorkload


def prepare(workload: LoopWorkload, threads: int) -> Callable[[], Floats]:
    """Return the call: (n_motions, n_candidates, N_REDUCTIONS)."""
    uts = building("uts")
    c0, c1, k0, k1, a0, a1, a2, beta, d0, d1, x_s, f0 = workload.device.tolist()
    spec = damper("static_hysteretic").with_current_laws(
        {"c": "linear", "k": "linear", "alpha": "quadratic", "delta": "linear"}, lagged=True
    )
    pair = Device(
        name="pair",
        spec=spec,
        theta=[c0, c1, k0, k1, a0, a1, a2, beta, d0, d1, x_s, f0, LAG],
        row=uts.storeys[0],
        largest_command=LARGEST_COMMAND,
        differential=True,
    )
    law = ControlLaw(name="clipped_optimal", gains={"gain": workload.gains[:, None, :]})
    hardware = Hardware(sample_time=STEP, step=STEP)

    def run() -> Floats:
        found = simulate_loop(uts, [pair], law, workload.records, hardware, threads=threads)
        return _columns(found)

    return run


def _columns(found: Responses) -> Floats:
    """Reductions that the contenders keep, motions first."""
    if found.outcome.any() or (found.steps != 1).any():
        raise MrworkError(
            f"expected every run to end with one step to a sample, {int(found.outcome.astype(bool).sum())} did not end "
            f"and the most steps were {int(found.steps.max())}; use a milder workload in bench/loop_workload.py"
        )
    kept = np.column_stack([getattr(found, name) for name in KEPT])
    candidates, motions, _ = found.shape
    return np.swapaxes(kept.reshape(candidates, motions, N_REDUCTIONS), 0, 1)
