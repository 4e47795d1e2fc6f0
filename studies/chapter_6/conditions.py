"""Conditions under which the laws are tried again: sample times, delays, noise, observers, and broken hardware."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from mrwork.buildings import Building
from mrwork.closed_loop import Fault, Hardware, simulate_loop
from mrwork.control import ControlLaw
from mrwork.dampers import Outcome
from mrwork.errors import MrworkError
from mrwork.motions import GroundMotion, read_motion
from studies.chapter_6.tuning import Tuned, control_law_of
from studies.former.frame import FRAME, HARDWARE, Bench, Figures, bench, figures, figures_of, pair


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """One way to build the loop."""

    name: str
    hardware: Hardware = HARDWARE
    lagged: bool = True
    step_factor: int = 1


OBSERVED = replace(HARDWARE, feedback="observer")
NOISY = replace(
    OBSERVED, acceleration_noise=0.02, deformation_noise=2e-5, force_noise=10.0, acceleration_resolution=0.005
)
CONDITIONS = (
    Condition(name="reference"),
    Condition(name="half the step", step_factor=2),
    Condition(name="Ts 2 ms", hardware=replace(HARDWARE, sample_time=2e-3)),
    Condition(name="Ts 5 ms", hardware=replace(HARDWARE, sample_time=5e-3)),
    Condition(name="Ts 10 ms", hardware=replace(HARDWARE, sample_time=1e-2)),
    Condition(name="delay 2 ms", hardware=replace(HARDWARE, delay=2e-3)),
    Condition(name="delay 5 ms", hardware=replace(HARDWARE, delay=5e-3)),
    Condition(name="observer", hardware=OBSERVED),
    Condition(name="observer, noise", hardware=NOISY),
    Condition(name="no driver lag", lagged=False),
)
REFERENCE, HALF_STEP = CONDITIONS[:2]


def under(over: Bench, tuned: Tuned, condition: Condition) -> Figures:
    """A law under a condition; the settings stay, only a network is trained for the sample time."""
    law = control_law_of(tuned, condition.hardware.sample_time)
    device = tuned.device
    if not condition.lagged and tuned.law != "active":
        device = pair(tuned.largest_current, lagged=False)
    return figures(over, law, device=device, hardware=condition.hardware, step_factor=condition.step_factor)


def scores_under(
    over: Bench, at_level: Sequence[Tuned], conditions: Sequence[Condition] = CONDITIONS
) -> dict[str, tuple[Figures, ...]]:
    """By name of the condition, what the settings of each level come to there."""
    found: dict[str, tuple[Figures, ...]] = {}
    for condition in conditions:
        each = {id(tuned): under(over, tuned, condition) for tuned in at_level}
        found[condition.name] = tuple(each[id(tuned)] for tuned in at_level)
    return found


BROKEN: tuple[tuple[float | Literal["hold"], str], ...] = (
    ("hold", "holds"),
    (0.0, "reads zero"),
    (math.nan, "reads NaN"),
)
"""Values of a broken sensor, and what they are called in the table."""


Case = tuple[str, dict[str, Any]]
"""A fault, and what came of it: an outcome with the score under El Centro at 0.3 g, or a refusal without one."""


def cases(records: Path, tuned: Tuned) -> Iterator[Case]:
    """Every fault, with a clipped-optimal law where it needs one; sensors fail from 3 to 8 s."""
    over = bench(records, names=("El Centro",), threads=1)
    law = control_law_of(tuned)
    yield _ran(over, "none", law, tuned, HARDWARE)
    for value, says in BROKEN:
        faults = (Fault(channel="force", start=3.0, end=8.0, value=value),)
        yield _ran(over, f"force sensor {says}", law, tuned, replace(HARDWARE, faults=faults))
    yield _ran(over, "none, observer", law, tuned, OBSERVED)
    for value, says in BROKEN:
        faults = (Fault(channel="acceleration", index=4, start=3.0, end=8.0, value=value),)
        yield _ran(over, f"roof accelerometer {says}, observer", law, tuned, replace(OBSERVED, faults=faults))
    for stuck in (0.0, tuned.largest_current):
        faults = (Fault(channel="command", start=3.0, value=stuck),)
        yield _ran(
            over, f"current stuck at {stuck:g} A from 3 s", law, tuned, replace(HARDWARE, faults=faults)
        )
    held = (Fault(channel="command", start=3.0, value="hold"),)
    yield _ran(over, "current stuck where it was at 3 s", law, tuned, replace(HARDWARE, faults=held))
    wrong = ControlLaw(name=law.name, gains={"gain": -100.0 * np.asarray(law.gains["gain"])})
    yield _ran(over, "gain of the wrong sign, x 100, clipped", wrong, tuned, HARDWARE)
    unstable = ControlLaw(name="active", gains=wrong.gains)
    yield _ran(over, "the same gain, ideal force", unstable, tuned, HARDWARE)
    yield _refused(
        "record of no samples", lambda: GroundMotion(name="empty", dt=0.02, acceleration=np.zeros(0))
    )
    yield _refused(
        "record with a NaN", lambda: GroundMotion(name="torn", dt=0.02, acceleration=np.array([0.0, np.nan]))
    )
    yield _refused("file of no samples", _read_empty)
    mass = FRAME.mass.copy()
    mass[4, 4] = 0.0
    yield _refused("singular mass", lambda: _simulated(over, replace(FRAME, mass=mass)))
    yield _refused("gain of another building", lambda: _simulated(over, FRAME, np.zeros((1, 6))))


def _ran(over: Bench, fault: str, law: ControlLaw, tuned: Tuned, hardware: Hardware) -> Case:
    responses = simulate_loop(FRAME, [pair(tuned.largest_current)], law, over.motions, hardware, threads=1)
    outcome = Outcome(int(responses.outcome[-1])).name.lower()
    score = float(figures_of(over, responses).score[0, -1])
    return fault, {"outcome": outcome, "score": score if math.isfinite(score) else None}


def _refused(fault: str, attempt: Callable[[], object]) -> Case:
    try:
        attempt()
    except MrworkError as error:
        return fault, {"outcome": f"{type(error).__name__}: {error}", "score": None}
    return fault, {"outcome": "not refused", "score": None}


def _simulated(over: Bench, frame: Building, gain: np.ndarray | None = None) -> object:
    gains = {"gain": np.zeros((1, 10)) if gain is None else gain}
    return simulate_loop(frame, [pair()], ControlLaw(name="clipped_optimal", gains=gains), over.motions)


def _read_empty() -> object:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "empty.csv"
        file.write_text("t_s,a_mps2\n")
        try:
            return read_motion(file)
        except MrworkError as error:
            raise type(error)(str(error).replace(f"{folder}/", "")) from None
