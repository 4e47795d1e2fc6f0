"""Effect of the step, sample time, delay, sensors and driver of the loop on the score of a law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from mrwork.closed_loop import Hardware
from studies.chapter_6.tuning import Tuned, control_law_of
from studies.common.frame import HARDWARE, Bench, Figures, figures, pair


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
