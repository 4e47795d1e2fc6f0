"""A million runs of the three-storey frame with what is kept of them: peak memory of the process and time.

`study.py` runs it in a process of its own.
"""

from __future__ import annotations

import json
import resource
import time

import numpy as np

from mrwork.buildings import building
from mrwork.closed_loop import Device, Hardware, simulate_loop
from mrwork.control import ControlLaw
from mrwork.dampers import damper
from mrwork.motions import synthetic_motion, trimmed

_CANDIDATES, _DRAWS = 1000, 1000


def main() -> None:
    frame = building("dyke1996")
    preset = damper("static_hysteretic").preset("kwok2006")
    rng = np.random.default_rng(1)
    draws = np.array(preset.theta) * np.exp(0.05 * rng.standard_normal((_DRAWS, len(preset.theta))))
    device = Device(name="damper", spec=preset.spec, theta=draws, row=frame.storeys[0], largest_command=1.88)
    law = ControlLaw(name="passive", gains={"command": np.linspace(0.0, 1.88, _CANDIDATES)[:, None]})
    motion = trimmed(synthetic_motion(rng=1), start=4.0, end=6.0)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began = time.perf_counter()
    responses = simulate_loop(
        frame, [device], law, [motion], Hardware(sample_time=5e-3, step=5e-3), threads=1
    )
    seconds = time.perf_counter() - began
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(
        json.dumps(
            {
                "runs": len(responses.outcome),
                "finished": int((responses.outcome == 0).sum()),
                # Linux counts in KiB.
                "peak_mib": peak / 1024.0,
                "before_mib": before / 1024.0,
                "seconds": seconds,
            }
        )
    )


if __name__ == "__main__":
    main()
